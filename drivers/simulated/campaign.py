"""Whole campaigns straight to arrays, without transports: food for coverage and blind trials.

The same rig, effects and integrator as `World`, in the shape of the exchange format
``impactd-campaign/1``: a dictionary, one array of codes per shot, and the truth apart from both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.drawn_rig import DrawnRig, draw_rig
from drivers.simulated.effects import Effect, Shot
from drivers.simulated.flight import Flight, begin_flight, render_flight
from drivers.simulated.impact import simulate_impact
from drivers.simulated.noise import NoiseSettings, noise_record
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec, SphereSpec, SurfaceSpec

_CODES = 65536


@dataclass(frozen=True)
class CampaignSettings:
    """What a campaign consists of.

    Attributes
    ----------
    spheres, surfaces : Mapping
        Labels by name; the surface ``specimen`` gets a random coupon mass and Poisson's ratio.
    drop_heights_m : tuple of float
        Heights; each campaign shifts each of them by up to 6 %. [m]
    repeats : int
        Drops per sphere, surface and height. [1]
    samples, touch_at : int
        Length of a record and sample near which the sphere touches. [1]
    sample_rate_hz, range_v : float
        Converter. [Hz, V]
    cell : CellSpec
        Certificate of the cell; its compliance is replaced when ``fill`` is given.
    fill : float or None
        Part of the range that the tallest pulse of the base model reaches: the compliance on the
        certificate is chosen for it, as one sets a gain in the laboratory; ``None`` keeps it. [1]
    cell_model : str
        ``"kv"``, or ``"hsd"`` for a rigid cell.
    effects : sequence of Effect or str
        What acts; ``"random"`` draws one.
    noise : NoiseSettings
        Level and AR(1) correlation; the 1/f part is left out of so short a record.
    restitution_scatter, restitution_u : float
        Scatter of eps from shot to shot, and standard uncertainty of the measured rebound. [1]
    restitution_seen_after_s : float
        How long after lift-off the rebound speed is read; gravity has slowed the sphere by then,
        as in recordings whose camera looks once, at the end. [s]
    baseline_scatter_v : float
        Standard deviation of the baseline from shot to shot. [V]
    speed_repeatability : float
        Relative standard deviation of the impact speed. [1]
    gravity_m_per_s2 : float
        [m/s^2]
    trigger_v : float
        A record's trigger index is the first sample beyond this level, above the baseline. [V]
    exact : bool
        Labels and certificate are the truth.
    """

    spheres: Mapping[str, SphereSpec] = field(
        default_factory=lambda: {n: SPHERES[n] for n in ("acetal", "hdpe", "acetal_small")}
    )
    surfaces: Mapping[str, SurfaceSpec] = field(
        default_factory=lambda: {n: SURFACES[n] for n in ("aluminium", "polycarbonate", "specimen")}
    )
    drop_heights_m: tuple[float, ...] = (0.0115, 0.030, 0.0465)
    repeats: int = 2
    samples: int = 4096
    touch_at: int = 1500
    sample_rate_hz: float = 1e6
    range_v: float = 10.0
    cell: CellSpec = field(default_factory=CellSpec)
    fill: float | None = 0.85
    cell_model: str = "kv"
    effects: Sequence[Effect] | str = ()
    noise: NoiseSettings = field(
        default_factory=lambda: NoiseSettings(rms_v=1.5e-3, ar1=0.6, pink_corner_hz=0.0)
    )
    restitution_scatter: float = 0.008
    restitution_u: float = 0.01
    restitution_seen_after_s: float = 0.0
    baseline_scatter_v: float = 2e-3
    speed_repeatability: float = 0.003
    gravity_m_per_s2: float = 9.80665
    trigger_v: float = 0.1
    exact: bool = False


def simulate_campaign(settings: CampaignSettings, seed: int) -> dict[str, Any]:
    """Simulate a campaign.

    Parameters
    ----------
    settings : CampaignSettings
        What it consists of.
    seed : int
        Same settings and seed, same campaign to the last code.

    Returns
    -------
    dict
        ``campaign``: the ``impactd-campaign/1`` dictionary, ready for JSON; ``codes``: a list of
        int16 arrays of shape (samples,), one per shot in the campaign's order; ``truth``: what the
        rig truly was, ready for JSON.

    Raises
    ------
    ValueError
        If an effect and the cell's model do not go together.
    """
    rng = np.random.default_rng([seed, 100])
    surfaces = {
        name: _random_specimen(spec, rng) if name == "specimen" and not settings.exact else spec
        for name, spec in settings.surfaces.items()
    }
    heights = [h * math.exp(rng.uniform(-0.06, 0.06)) for h in settings.drop_heights_m]
    rig = _draw(settings, surfaces, settings.cell, seed)
    cell = settings.cell
    if settings.fill is not None:
        cell = _fitting_cell(settings, rig, max(heights))
        rig = _draw(settings, surfaces, cell, seed)
    plan = [(s, c, h) for s in settings.spheres for c in surfaces for h in heights]
    plan *= settings.repeats
    order = rng.permutation(len(plan))
    shots, codes, flights = [], [], []
    for number, place in enumerate(order):
        sphere, surface, height = plan[place]
        flight, volts = _record(settings, rig, (sphere, surface, height), number, seed)
        flights.append(flight)
        row = _quantise(volts, settings.range_v, rig)
        codes.append(row)
        shots.append(_describe(settings, flight, (sphere, surface, height), row, (seed, number)))
    return {
        "campaign": _campaign(settings, surfaces, cell, shots),
        "codes": codes,
        "truth": _truth(settings, rig, flights),
    }


def write_campaign_folder(folder: Path, simulated: Mapping[str, Any]) -> Path:
    """Write a simulated campaign as a folder of the exchange format.

    Parameters
    ----------
    folder : Path
        Created if need be. The truth goes into ``truth.json`` in it.
    simulated : Mapping
        What `simulate_campaign` returned.

    Returns
    -------
    Path
        Its ``campaign.json``.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for shot, codes in zip(simulated["campaign"]["shots"], simulated["codes"], strict=True):
        np.save(folder / shot["file"], codes)
    (folder / "truth.json").write_text(json.dumps(simulated["truth"], indent=1, allow_nan=False))
    path = folder / "campaign.json"
    path.write_text(json.dumps(simulated["campaign"], indent=1, allow_nan=False))
    return path


def _random_specimen(spec: SurfaceSpec, rng: np.random.Generator) -> SurfaceSpec:
    ratio = round(float(rng.uniform(0.33, 0.42)), 2)
    return replace(spec, poissons_ratio=ratio, coupon_mass_kg=float(rng.uniform(2.5e-3, 5e-3)))


def _draw(
    settings: CampaignSettings, surfaces: Mapping[str, SurfaceSpec], cell: CellSpec, seed: int
) -> DrawnRig:
    return draw_rig(
        seed,
        settings.spheres,
        surfaces,
        cell,
        settings.effects,
        restitution_scatter=settings.restitution_scatter,
        gravity_m_per_s2=settings.gravity_m_per_s2,
        rigid_cell=settings.cell_model == "hsd",
        exact=settings.exact,
    )


def _fitting_cell(settings: CampaignSettings, rig: DrawnRig, height_m: float) -> CellSpec:
    """Return the certificate with the compliance that lets the tallest pulse fill the range."""
    bare = replace(rig, effects=())
    speed = math.sqrt(2.0 * settings.gravity_m_per_s2 * height_m)
    tallest = 0.0
    for sphere in settings.spheres:
        for surface in rig.surface_specs:
            rng = np.random.default_rng(0)
            shot = Shot(0, sphere, surface, height_m, rng)
            impact = simulate_impact(bare.mechanics(shot, speed, rng), speed, points=1)
            squeeze = impact.peak_force_n / rig.cell.crystal_stiffness_n_per_m
            tallest = max(tallest, impact.peak_compression_m, squeeze)
    compliance = tallest / ((settings.fill or 0.85) * settings.range_v)
    relative_u = settings.cell.compliance_u_m_per_v / settings.cell.compliance_m_per_v
    return replace(
        settings.cell, compliance_m_per_v=compliance, compliance_u_m_per_v=relative_u * compliance
    )


def _record(
    settings: CampaignSettings,
    rig: DrawnRig,
    drop: tuple[str, str, float],
    number: int,
    seed: int,
) -> tuple[Flight, NDArray[np.float64]]:
    """Return one flight and the voltage of its record, noise and hum included."""
    sphere, surface, height = drop
    chance = (seed, 110, number)
    rng = np.random.default_rng(chance)
    shot = Shot(number, sphere, surface, height, np.random.default_rng(0))
    flight = begin_flight(rig, shot, 0.0, settings.speed_repeatability, chance)
    start_s = flight.landing_s - (settings.touch_at + rng.random()) / settings.sample_rate_hz
    stop_s = start_s + settings.samples / settings.sample_rate_hz
    volts = noise_record(settings.noise, settings.samples, rng)
    volts += settings.baseline_scatter_v * rng.standard_normal()
    for piece in render_flight(rig, flight, start_s, settings.sample_rate_hz, until_s=stop_s):
        a, b = max(piece.first, 0), min(piece.first + piece.volts.size, settings.samples)
        volts[a:b] += piece.volts[a - piece.first : b - piece.first]
    # Minutes pass between drops: the mains has any phase.
    t = rng.uniform(0.0, 1e3) + np.arange(settings.samples) / settings.sample_rate_hz
    for effect in rig.effects:
        hum = effect.ambient(t)
        if hum is not None:
            volts += hum
    return flight, volts


def _quantise(volts: NDArray[np.float64], range_v: float, rig: DrawnRig) -> NDArray[np.int16]:
    ideal = np.clip(np.rint((volts + range_v) * (_CODES / (2.0 * range_v))), 0, _CODES - 1)
    codes = ideal.astype(np.uint16)
    for effect in rig.effects:
        conversion = effect.conversion()
        if conversion is not None:
            codes = conversion[codes]
    return (codes.astype(np.int32) - _CODES // 2).astype(np.int16)


def _describe(
    settings: CampaignSettings,
    flight: Flight,
    drop: tuple[str, str, float],
    codes: NDArray[np.int16],
    chance: tuple[int, int],
) -> dict[str, object]:
    """Return a shot's entry: what the technician knows of it."""
    sphere, surface, height = drop
    volts_per_code = 2.0 * settings.range_v / _CODES
    baseline = float(np.median(codes[: settings.touch_at // 2]))
    above = np.flatnonzero((codes - baseline) * volts_per_code > settings.trigger_v)
    above = above[above >= settings.touch_at - 5]
    touch = flight.touches[0]
    slowed = settings.gravity_m_per_s2 * settings.restitution_seen_after_s
    measured = (touch.rebound_speed_m_per_s - slowed) / touch.speed_m_per_s
    measured += settings.restitution_u * np.random.default_rng([*chance, 120]).normal()
    return {
        "sphere": sphere,
        "surface": surface,
        "drop_height_m": height,
        "file": f"shot{flight.shot.number:03d}.npy",
        "sample_rate_Hz": settings.sample_rate_hz,
        "volts_per_code": volts_per_code,
        "trigger_index": int(above[0]) if above.size else settings.touch_at,
        "restitution": {"value": round(float(measured), 4), "u": settings.restitution_u},
    }


def _quantity(value: float, u: float) -> dict[str, float]:
    return {"value": value, "u": u}


def _campaign(
    settings: CampaignSettings,
    surfaces: Mapping[str, SurfaceSpec],
    cell: CellSpec,
    shots: list[dict[str, object]],
) -> dict[str, object]:
    sensor = {
        "compliance_m_per_V": _quantity(cell.compliance_m_per_v, cell.compliance_u_m_per_v),
        "crystal_mass_kg": _quantity(cell.crystal_mass_kg, cell.crystal_mass_u_kg),
        "crystal_stiffness_N_per_m": _quantity(
            cell.crystal_stiffness_n_per_m, cell.crystal_stiffness_u_n_per_m
        ),
        "crystal_damping_N_s_per_m": _quantity(
            cell.crystal_damping_n_s_per_m, cell.crystal_damping_u_n_s_per_m
        ),
    }
    if settings.cell_model == "hsd":
        value = cell.hsd_n_per_v or cell.crystal_stiffness_n_per_m * cell.compliance_m_per_v
        sensor = {"hsd_N_per_V": _quantity(value, 0.1 * value)}
    return {
        "format": "impactd-campaign/1",
        "gravity_m_per_s2": settings.gravity_m_per_s2,
        "release": {"speed_repeatability": settings.speed_repeatability},
        "sensor": sensor,
        "spheres": {
            name: {
                "radius_m": spec.radius_m,
                "mass_kg": spec.mass_kg,
                "youngs_modulus_Pa": _quantity(spec.youngs_modulus_pa, spec.youngs_modulus_u_pa),
                "poissons_ratio": _quantity(spec.poissons_ratio, spec.poissons_ratio_u),
            }
            for name, spec in settings.spheres.items()
        },
        "surfaces": {
            name: {
                "youngs_modulus_Pa": None
                if spec.youngs_modulus_pa is None
                else _quantity(spec.youngs_modulus_pa, spec.youngs_modulus_u_pa),
                "poissons_ratio": _quantity(spec.poissons_ratio, spec.poissons_ratio_u),
                "coupon_mass_kg": spec.coupon_mass_kg,
            }
            for name, spec in surfaces.items()
        },
        "shots": shots,
    }


def _truth(
    settings: CampaignSettings, rig: DrawnRig, flights: Sequence[Flight]
) -> dict[str, object]:
    truth = rig.truth()
    if "specimen" in rig.surface_solids:
        solid = rig.surface_solids["specimen"]
        truth["specimen_youngs_modulus_Pa"] = solid.youngs_modulus_pa
    truth["noise_ar1"] = settings.noise.ar1
    truth["noise_rms_V"] = settings.noise.rms_v
    truth["shots"] = [
        {
            "true_drop_height_m": flight.shot.drop_height_m,
            "reduced_modulus_Pa": rig.reduced_modulus_pa(flight.shot.sphere, flight.shot.surface),
            **asdict(flight.touches[0]),
        }
        for flight in flights
    ]
    return truth
