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
    """What a simulated rig is made of.

    Attributes
    ----------
    seed : int
        Same seed and same commands at the same rig times give the same codes.
    clock_speed : float
        1 real time, 20 accelerated, ``math.inf`` as fast as the host reads. [1]
    rate_error : float
        True sample rate over the one asked for. [1]
    spheres, surfaces : Mapping
        What lies in the drawers, as labelled; a surface without modulus is drawn anywhere.
    cell : CellSpec
        The load cell's certificate.
    cell_model : str
        ``"kv"``, or ``"hsd"`` for a rigid cell.
    exact : bool
        Labels and certificate are the truth; nothing about them is drawn.
    effects : sequence of Effect or str
        What the base model lacks; ``"random"`` draws one from the seed and keeps it to itself.
    restitution : Mapping
        eps of Eq. 6 by (sphere, surface); pairs left out are drawn from 0.65 to 0.85. [1]
    restitution_scatter : float
        Standard deviation of eps from impact to impact. [1]
    noise : NoiseSettings
        What the input shows when nothing happens.
    offset_v : float
        Baseline. [V]
    gravity_m_per_s2 : float
        [m/s^2]
    speed_repeatability : float
        Relative standard deviation of the impact speed. [1]
    release_latency_s, release_jitter_s : float
        From the valve's command to the sphere leaving the tube: mean and standard deviation. [s]
    vacuum_held_v, vacuum_open_v, no_vacuum_v : float
        Gauge with a sphere on the tube, with an open tube, and with the pump shut off. [V]
    rig : str
        Which physics the rig obeys: ``"paper"``, ``"closed"`` or ``"drawn"``.
    spread : LabelSpread
        How far radii, masses, heights, time base, gravity and temperature are from what is stated.
    recording : Recording or None
        Played at every release in place of a simulated impact.
    """

    seed: int = 1
    clock_speed: float = 1.0
    rate_error: float = 1.0
    spheres: Mapping[str, SphereSpec] = field(default_factory=lambda: dict(SPHERES))
    surfaces: Mapping[str, SurfaceSpec] = field(default_factory=lambda: dict(SURFACES))
    cell: CellSpec = field(default_factory=CellSpec)
    cell_model: str = "kv"
    exact: bool = False
    effects: Sequence[Effect] | str = ()
    restitution: Mapping[tuple[str, str], float] = field(default_factory=dict)
    restitution_scatter: float = 0.008
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    offset_v: float = 0.0
    gravity_m_per_s2: float = 9.80665
    speed_repeatability: float = 0.003
    release_latency_s: float = 0.012
    release_jitter_s: float = 0.001
    vacuum_held_v: float = 3.2
    vacuum_open_v: float = 1.4
    no_vacuum_v: float = 0.3
    rig: str = DEFAULT_RIG
    spread: LabelSpread = EXACT
    recording: Recording | None = None
