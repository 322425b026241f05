"""The settings of a simulated campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drivers.simulated.effects import Effect
from drivers.simulated.label_spread import EXACT, LabelSpread
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.rig_model import DEFAULT_RIG
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec, SphereSpec, SurfaceSpec


@dataclass(frozen=True)
class CampaignSettings:
    """What a campaign consists of."""

    spheres: Mapping[str, SphereSpec] = field(
        default_factory=lambda: {n: SPHERES[n] for n in ("acetal", "hdpe", "acetal_small")}
    )
    surfaces: Mapping[str, SurfaceSpec] = field(
        default_factory=lambda: {n: SURFACES[n] for n in ("aluminium", "polycarbonate", "specimen")}
    )
    """Labels by name; the surface ``specimen`` gets a random coupon mass and Poisson's ratio."""
    drop_heights_m: tuple[float, ...] = (0.0115, 0.030, 0.0465)
    """Each campaign shifts each of them by up to 6 %."""
    repeats: int = 2
    """Drops per sphere, surface and height."""
    samples: int = 4096
    """Length of a record."""
    touch_at: int = 1500
    """Sample near which the sphere touches."""
    sample_rate_hz: float = 1e6
    range_v: float = 10.0
    """Half the converter's range, which is +/- this."""
    cell: CellSpec = field(default_factory=CellSpec)
    """Certificate of the cell; its compliance is replaced when ``fill`` is given."""
    fill: float | None = 0.85
    """Part of the range that the tallest pulse of the base model reaches: the compliance on the
    certificate is chosen for it, as one sets a gain in the laboratory; ``None`` keeps it. [1]"""
    cell_model: str = "kv"
    """``"kv"``, or ``"hsd"`` for a rigid cell."""
    effects: Sequence[Effect] | str = ()
    """What acts; ``"random"`` draws one."""
    noise: NoiseSettings = field(
        default_factory=lambda: NoiseSettings(rms_v=1.5e-3, ar1=0.6, pink_corner_hz=0.0)
    )
    restitution_scatter: float = 0.008
    """Of eps, from shot to shot."""
    restitution_u: float = 0.01
    """Standard uncertainty of the measured rebound."""
    restitution_seen_after_s: float = 0.0
    """How long after lift-off the rebound speed is read; gravity has slowed the sphere by then, as
    in recordings whose camera looks once, at the end. [s]"""
    baseline_scatter_v: float = 2e-3
    """Standard deviation of the baseline from shot to shot."""
    speed_repeatability: float = 0.003
    """Relative standard deviation of the impact speed. [1]"""
    gravity_m_per_s2: float = 9.80665
    trigger_v: float = 0.1
    """A record's trigger index is the first sample beyond this level, above the baseline. [V]"""
    exact: bool = False
    """Labels and certificate are the truth."""
    rig: str = DEFAULT_RIG
    """Which physics the rig obeys: ``"paper"``, ``"closed"`` or ``"drawn"``."""
    spread: LabelSpread = EXACT
    """How far radii, masses, heights, time base, gravity and temperature are from what is
    stated."""
    states_u: bool = True
    """The campaign states these as standard uncertainties; if not, its numbers pass for exact."""
    bits: int = 16
    """Resolution of the converter, 8 to 16. [1]"""
