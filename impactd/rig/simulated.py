"""The simulated rig: real drivers over simulated transports that share one world.

::

    settings, materials ──> World ──┬── SimulatedUsbBoard (USB)    <── Daq3500, Usb2637
                                    ├── RelayTerminal (serial)     <── NumatoValve, LcusValve
                                    └── SimulatedTechnician (hangs spheres)

What the world draws (true moduli, true cell, the hidden effect) goes into
``<data>/sealed-truth.json``, readable by its owner only; nothing of it reaches a shot file.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.campaign import Sphere, Surface
from drivers.simulated.effects import EFFECTS, Effect, make_effect
from drivers.simulated.label_spread import SPREADS
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.rig_model import DEFAULT_RIG
from drivers.simulated.specimens import SURFACES, CellSpec, SphereSpec, SurfaceSpec
from drivers.simulated.truth import seal
from drivers.simulated.usb2637_device import SimulatedUsb2637
from drivers.simulated.usb_bus import SimulatedUsbBoard
from drivers.simulated.usb_device import SimulatedDaq3500
from drivers.simulated.world import World
from drivers.simulated.world_settings import WorldSettings
from impactd.rig.digitizer_board import build_digitizer
from impactd.rig.relay_board import build_valve
from impactd.rig.rig import Rig, in_words
from impactd.settings.materials import Materials
from impactd.settings.sections import SimulationSection
from impactd.settings.settings import Settings, SettingsError

SEALED_NAME = "sealed-truth.json"
_BOARDS: dict[str, Callable[..., SimulatedUsbBoard]] = {
    "daq3500": SimulatedDaq3500,
    "usb2637": SimulatedUsb2637,
}


class SimulatedTechnician:
    """Hangs whatever is asked for, after a delay on the host's clock."""

    def __init__(self, world: World, delay_s: float) -> None:
        self._world = world
        self._delay_s = delay_s
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None

    def ask(self, sphere: str, surface: str, drop_height_m: float) -> str:
        """Hang the sphere now or a little later; return the request in words."""
        if self._delay_s <= 0:
            self._world.load(sphere, surface, drop_height_m)
        else:
            timer = threading.Timer(
                self._delay_s, self._world.load, (sphere, surface, drop_height_m)
            )
            timer.daemon = True
            with self._lock:
                self._timer = timer
            timer.start()
        return in_words(sphere, surface, drop_height_m)

    def cancel(self) -> None:
        """Take the request back if the sphere does not hang yet."""
        with self._lock:
            timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()


def build_simulated_rig(settings: Settings, materials: Materials) -> Rig:
    """Return an unopened rig whose transports are simulated, and seal its truth.

    A modulus of the materials is drawn within its uncertainty; an unknown one is drawn anywhere.
    Raises SettingsError if the hidden effect is none that the simulator knows.
    """
    section = settings.simulation
    assert section is not None, "the caller looks for the simulation section"
    world = World(world_settings(settings, materials, section))
    board = _BOARDS[settings.digitizer.driver]
    terminal = RelayTerminal(world, kind=settings.valve.driver)
    rig = Rig(
        digitizer=build_digitizer(
            settings.digitizer,
            backend=board(world, serial_number=f"SIM-{section.seed:04d}"),
            # The count of samples can be held against the clock only where the rig keeps its pace.
            pace_checked=section.clock_speed == 1.0,
        ),
        valve=build_valve(settings.valve, terminal.port),
        loader=SimulatedTechnician(world, section.technician_delay_s),
        name=settings.rig.name,
        simulated=True,
        clock_speed=section.clock_speed,
        world=world,
    )
    settings.storage.directory.mkdir(mode=0o750, parents=True, exist_ok=True)
    sealed = settings.storage.directory / SEALED_NAME
    seal(sealed, world.truth())
    rig.closing += [terminal.close, lambda: seal(sealed, world.truth())]
    return rig


def world_settings(
    settings: Settings, materials: Materials, section: SimulationSection
) -> WorldSettings:
    """Return the world that labels, certificate and simulation section describe.

    Its truth is drawn within what the labels leave open. Raises SettingsError if the hidden effect
    is none that the simulator knows.
    """
    sensor = settings.sensor
    return WorldSettings(
        seed=section.seed,
        clock_speed=section.clock_speed,
        spheres={name: _sphere(sphere) for name, sphere in materials.spheres.items()},
        surfaces={name: _surface(surface) for name, surface in materials.surfaces.items()},
        cell=CellSpec(
            compliance_m_per_v=sensor.compliance_m_per_v.value,
            compliance_u_m_per_v=sensor.compliance_m_per_v.u,
            crystal_mass_kg=sensor.crystal_mass_kg.value,
            crystal_mass_u_kg=sensor.crystal_mass_kg.u,
            crystal_stiffness_n_per_m=sensor.crystal_stiffness_n_per_m.value,
            crystal_stiffness_u_n_per_m=sensor.crystal_stiffness_n_per_m.u,
            crystal_damping_n_s_per_m=sensor.crystal_damping_n_s_per_m.value,
            crystal_damping_u_n_s_per_m=sensor.crystal_damping_n_s_per_m.u,
            hsd_n_per_v=sensor.hsd_n_per_v.value,
        ),
        effects=_effects(section),
        noise=replace(NoiseSettings(), rms_v=section.noise_rms_v),
        gravity_m_per_s2=settings.release.gravity_m_per_s2,
        speed_repeatability=settings.release.speed_repeatability,
        rig=section.rig or DEFAULT_RIG,
        spread=SPREADS[section.labels],
    )


def check_effect(effect: str) -> None:
    """Raise SettingsError where the simulator does not know an effect, or one of several.

    A cell that rings is what this rig has.
    """
    for name in effect.split("+"):
        if name == "crystal_dynamics":
            raise SettingsError(
                None, "simulation.effect", "the simulated rig's cell rings already: name another"
            )
        if effect not in ("random", "none") and name not in EFFECTS:
            raise SettingsError(
                None,
                "simulation.effect",
                f"the simulator knows no effect {name!r}; it knows none, random, "
                f"{', '.join(EFFECTS)}",
            )


def _effects(section: SimulationSection) -> tuple[Effect, ...] | str:
    """Return the hidden effects; parameters that were left out are drawn from the seed."""
    check_effect(section.effect)
    if section.effect == "random":
        return "random"
    if section.effect == "none":
        return ()
    rng = np.random.default_rng([section.seed, 60])
    effects = []
    for name in section.effect.split("+"):
        try:
            values = {**EFFECTS[name].draw(rng), **section.effect_parameters.get(name, {})}
            form = EFFECTS[name].form_on(section.rig or DEFAULT_RIG)
            effects.append(make_effect(name, values, form=form))
        except ValueError as error:
            raise SettingsError(None, f"simulation.effect_parameters.{name}", str(error)) from None
    return tuple(effects)


def _sphere(sphere: Sphere) -> SphereSpec:
    assert sphere.radius_m is not None
    assert sphere.mass_kg is not None
    assert sphere.poissons_ratio is not None
    modulus = sphere.youngs_modulus_pa
    if modulus is None:
        raise SettingsError(
            None, f"sphere.{sphere.name}", "the simulated rig needs its youngs_modulus_pa"
        )
    return SphereSpec(
        radius_m=sphere.radius_m,
        mass_kg=sphere.mass_kg,
        youngs_modulus_pa=modulus.value,
        youngs_modulus_u_pa=modulus.u,
        poissons_ratio=sphere.poissons_ratio.value,
        poissons_ratio_u=sphere.poissons_ratio.u,
    )


def _surface(surface: Surface) -> SurfaceSpec:
    assert surface.poissons_ratio is not None
    modulus, mass_kg = surface.youngs_modulus_pa, surface.coupon_mass_kg
    if mass_kg is None or not math.isfinite(mass_kg):
        known = SURFACES.get(surface.name)
        mass_kg = known.coupon_mass_kg if known else SurfaceSpec(None, 0.0, 0.37).coupon_mass_kg
    return SurfaceSpec(
        youngs_modulus_pa=modulus.value if modulus else None,
        youngs_modulus_u_pa=modulus.u if modulus else 0.0,
        poissons_ratio=surface.poissons_ratio.value,
        poissons_ratio_u=surface.poissons_ratio.u,
        coupon_mass_kg=mass_kg,
    )
