"""The settings of a simulated rig, each with its meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drivers.simulated.effects import Effect
from drivers.simulated.label_spread import EXACT, LabelSpread
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.replay import Recording
from drivers.simulated.rig_model import DEFAULT_RIG
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec, SphereSpec, SurfaceSpec


@dataclass(frozen=True)
class WorldSettings:
    """What a simulated rig is made of."""

    seed: int = 1
    """Same seed and same commands at the same rig times give the same codes."""
    clock_speed: float = 1.0
    """1 real time, 20 accelerated, ``math.inf`` as fast as the host reads."""
    rate_error: float = 1.0
    """True sample rate over the one asked for."""
    spheres: Mapping[str, SphereSpec] = field(default_factory=lambda: dict(SPHERES))
    surfaces: Mapping[str, SurfaceSpec] = field(default_factory=lambda: dict(SURFACES))
    """What lies in the drawers, as labelled; a surface without modulus is drawn anywhere."""
    cell: CellSpec = field(default_factory=CellSpec)
    """The load cell's certificate."""
    cell_model: str = "kv"
    """``"kv"``, or ``"hsd"`` for a rigid cell."""
    exact: bool = False
    """Labels and certificate are the truth; nothing about them is drawn."""
    effects: Sequence[Effect] | str = ()
    """What the base model lacks; ``"random"`` draws one from the seed and keeps it to itself."""
    restitution: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """eps of Eq. 6 by (sphere, surface); pairs left out are drawn from 0.65 to 0.85."""
    restitution_scatter: float = 0.008
    """Standard deviation of eps from impact to impact."""
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    offset_v: float = 0.0
    """Baseline."""
    gravity_m_per_s2: float = 9.80665
    speed_repeatability: float = 0.003
    """Relative standard deviation of the impact speed."""
    release_latency_s: float = 0.012
    """From the valve's command to the sphere leaving the tube: the mean."""
    release_jitter_s: float = 0.001
    """The standard deviation of the same."""
    vacuum_held_v: float = 3.2
    """Gauge with a sphere on the tube."""
    vacuum_open_v: float = 1.4
    """Gauge with an open tube."""
    no_vacuum_v: float = 0.3
    """Gauge with the pump shut off."""
    rig: str = DEFAULT_RIG
    """Which physics the rig obeys: ``"paper"``, ``"closed"`` or ``"drawn"``."""
    spread: LabelSpread = EXACT
    """How far radii, masses, heights, time base, gravity and temperature are from what is
    stated."""
    recording: Recording | None = None
    """Played at every release in place of a simulated impact."""
