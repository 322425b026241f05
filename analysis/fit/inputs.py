"""Measured inputs of a campaign: masses, radii, heights, time base, with their uncertainty.

Every such number with a stated uncertainty is a global of its own, known beforehand as a Gaussian
about what was stated. The records hardly move it; its uncertainty reaches every modulus through the
joint covariance, which is generalised least squares with the common errors as parameters.

=========================  ===================================================================
``input.mass.<sphere>``    ln of a sphere's mass [kg]
``input.radius.<sphere>``  ln of a sphere's radius [m]
``input.coupon_mass.<s>``  ln of a coupon's mass [kg]
``input.coupon_ratio.<s>`` ln of a coupon's Poisson's ratio, where a contact law asks for it [1]
``input.height.<height>``  ln of the height of a series, where it may be written down wrong [m]
``input.height_offset``    offset that all drop heights share [mm]
``input.time_base``        ln of true over stated sample rate, of all shots [1]
``input.gravity``          ln of the acceleration of fall [m/s^2]
``input.air_resistance``   drag of the air over that of the law [1]
``input.converter_gain``   ln of true over stated volts per code, of all shots [1]
``input.law.<column>``     how far an effect's law is wrong along a column [1]
``input.stated.<input>``   distance of one of the above from where it is stated, to first order
=========================  ===================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from analysis.aliases import Array
from analysis.campaign import UNKNOWN_POISSONS_RATIO, Campaign, Uncertainty
from analysis.fit.fit_shot import FitShot, log_speed_in_air
from analysis.fit.priors import Prior
from analysis.model.free_fall import AIR_RESISTANCE_U
from analysis.model.impact_model import ShotFrame
from analysis.parameters import ParameterName, of_input

AIR_RESISTANCE = "air_resistance"
LAW, STATED = "law", "stated"
"""Kinds of inputs that act to first order: the error of a law, and of a stated number."""
LINEAR = {"height_offset": 1e3, AIR_RESISTANCE: 1.0}
"""Coordinate over value of the inputs whose coordinate is no logarithm."""
LOG_STEP = 1e-6
LINEAR_STEP = 1e-4
"""mm of height, or a share of the drag. Derived: a difference over it errs by 5e-6 of the slope of
ln v0 for a height of 10 mm, and by the rounding of ln v0 over its change of 1e-7 by the drag, 1e-9.
"""
LARGEST_LOG = 300.0
"""No stated number is wrong by e^300; more than twice that, and a double cannot hold it."""


@dataclass(frozen=True)
class Input:
    """One stated number with an uncertainty, and how it moves a shot."""

    kind: str
    """Behind ``input.`` in the table above; its name's quantity."""
    owner: str | None
    """Sphere or surface; None for what all shots share."""
    value: float
    unit: str
    uncertainty: Uncertainty
    path: str
    """Where a campaign states it."""
    cell: Mapping[str, float] = field(default_factory=dict)
    """Change of the cell's local parameters by the coordinate: what an error of this number has
    done to the calibration of the cell."""

    @property
    def name(self) -> ParameterName:
        """Return the global's name."""
        return of_input(self.kind, self.owner)

    @property
    def scale(self) -> float:
        """Return the coordinate's change per unit of ``value``."""
        return LINEAR.get(self.kind) or 1.0 / self.value

    @property
    def stated(self) -> float:
        """Return the coordinate of the stated value."""
        return self.value * self.scale if self.kind in LINEAR else math.log(self.value)

    @property
    def u(self) -> float:
        """Return the standard uncertainty of the coordinate."""
        return self.uncertainty.u * self.scale

    @property
    def step(self) -> float:
        """Return how far the coordinate is moved for a derivative."""
        return LINEAR_STEP if self.kind in LINEAR else LOG_STEP

    def value_at(self, coordinate: float) -> float:
        """Return the value in ``unit`` that a coordinate stands for."""
        return coordinate / self.scale if self.kind in LINEAR else math.exp(coordinate)

    def is_thinkable(self, coordinate: float) -> bool:
        """Tell whether the coordinate stands for a finite number."""
        return self.kind in LINEAR or abs(coordinate - self.stated) < LARGEST_LOG

    def acts_on(self, item: FitShot) -> bool:
        """Tell whether a shot depends on it, directly or through the cell's calibration."""
        return bool(self.cell) or self.belongs_to(item)

    def belongs_to(self, item: FitShot) -> bool:
        """Tell whether it is a number of this shot."""
        if self.kind in ("mass", "radius"):
            return item.shot.sphere == self.owner
        if self.kind in ("coupon_mass", "coupon_ratio"):
            return item.shot.surface == self.owner
        if self.kind == "height_offset":
            return _fell(item)
        if self.kind == AIR_RESISTANCE:
            return item.in_air
        if self.kind == "height":
            return _fell(item) and item.shot.drop_height_m == self.value
        return True

    def moved(self, item: FitShot, by: float) -> FitShot:
        """Return a shot with this input's coordinate changed by ``by``."""
        change = _MOVES.get(self.kind)
        if change is None or by == 0.0 or not self.belongs_to(item):
            return item
        return change(item, by)

    def signal(self, item: FitShot) -> Array | None:
        """Return what it adds to a shot's record per unit of its coordinate; mostly None."""
        return None

    def faster_by(self, item: FitShot) -> float:
        """Return what an input that adds a signal adds to the promised ln v0 of a shot per unit."""
        raise NotImplementedError

    def local_slopes(
        self, item: FitShot, names: Sequence[str], *, by_moduli: bool
    ) -> list[tuple[int, float]]:
        """Return which shared local parameters follow it, and by how much.

        ``by_moduli`` says whether the stiffness is made of moduli and the radius.
        """
        if not self.belongs_to(item):
            return []
        if self.kind == "radius":
            return [(0, 0.5)] if by_moduli else []
        if self.kind == "converter_gain":
            return [(names.index("ln_S"), 1.0)]
        found = []
        if self.kind == "mass":
            if item.fixed_gain is not None and item.shot.quantity == "acceleration_m_per_s2":
                found.append((names.index("ln_S"), 1.0))
            if item.heavy_crystal is not None:
                found.append((names.index("ln_M"), 1.0))
        return found

    def cell_slopes(self, item: FitShot, names: Sequence[str]) -> list[tuple[int, float]]:
        """Return which of a shot's parameters of the cell follow it, and by how much.

        Each is a place in ``names`` (the shared local parameters) and a derivative; there is none
        for a parameter that the shot fixes.
        """
        fixed = {"ln_S": item.fixed_gain, "ln_M": item.heavy_crystal}
        return [(names.index(n), slope) for n, slope in self.cell.items() if fixed.get(n) is None]


def _fell(item: FitShot) -> bool:
    """Tell whether the speed follows from a height."""
    return item.shot.impact_speed_m_per_s is None and item.shot.drop_height_m is not None


def _refallen(item: FitShot, frame: ShotFrame, by: float) -> FitShot:
    """Return a shot of another frame with its speed of fall; ``by`` without air. [ln m/s]"""
    prior = item.speed_prior
    if prior is not None and _fell(item):
        in_air = item.in_air
        mean = log_speed_in_air(frame, item.air_resistance) if in_air else prior.mean + by
        prior = Prior(mean, prior.u)
    return replace(item, frame=frame, speed_prior=prior)


def _mass(item: FitShot, by: float) -> FitShot:
    frame = replace(item.frame, mass_kg=item.frame.mass_kg * math.exp(by))
    gain, heavy = item.fixed_gain, item.heavy_crystal
    if gain is not None and item.shot.quantity == "acceleration_m_per_s2":
        gain += by
    heavy = None if heavy is None else heavy + by
    return replace(_refallen(item, frame, 0.0), fixed_gain=gain, heavy_crystal=heavy)


def _radius(item: FitShot, by: float) -> FitShot:
    radius = None if item.radius_m is None else item.radius_m * math.exp(by)
    known = item.frame.radius_m
    frame = replace(item.frame, radius_m=None if known is None else known * math.exp(by))
    return replace(_refallen(item, frame, 0.0), radius_m=radius)


def _coupon_mass(item: FitShot, by: float) -> FitShot:
    known = item.frame.coupon_mass_kg
    mass = None if known is None else known * math.exp(by)
    riding = item.frame.coupon_on_crystal_kg * math.exp(by)
    frame = replace(item.frame, coupon_mass_kg=mass, coupon_on_crystal_kg=riding)
    return replace(item, frame=frame)


def _coupon_ratio(item: FitShot, by: float) -> FitShot:
    ratio = item.frame.coupon_poissons_ratio * math.exp(by)
    return replace(item, frame=replace(item.frame, coupon_poissons_ratio=ratio))


def _height_offset(item: FitShot, by_mm: float) -> FitShot:
    stated = item.frame.drop_height_m
    assert stated is not None
    height = stated + by_mm * 1e-3
    # an offset that leaves no height has no speed, and a fit steps back from it
    faster = 0.5 * math.log(height / stated) if height > 0 else -math.inf
    return _refallen(item, replace(item.frame, drop_height_m=height), faster)


def _height(item: FitShot, by: float) -> FitShot:
    known = item.frame.drop_height_m
    assert known is not None
    return _refallen(item, replace(item.frame, drop_height_m=known * math.exp(by)), 0.5 * by)


def _time_base(item: FitShot, by: float) -> FitShot:
    frame = replace(
        item.frame,
        sample_rate_hz=item.frame.sample_rate_hz * math.exp(by),
        window_start_s=item.frame.window_start_s * math.exp(-by),
    )
    return replace(item, frame=frame)


def _gravity(item: FitShot, by: float) -> FitShot:
    frame = replace(item.frame, gravity_m_per_s2=item.frame.gravity_m_per_s2 * math.exp(by))
    return _refallen(item, frame, 0.5 * by)


def _air_resistance(item: FitShot, by: float) -> FitShot:
    return _refallen(replace(item, air_resistance=item.air_resistance + by), item.frame, 0.0)


_MOVES = {
    "mass": _mass,
    "radius": _radius,
    "coupon_mass": _coupon_mass,
    "coupon_ratio": _coupon_ratio,
    "height_offset": _height_offset,
    "height": _height,
    "time_base": _time_base,
    "gravity": _gravity,
    AIR_RESISTANCE: _air_resistance,
}
"""The converter's gain is no part of a shot: it moves the local parameter ``ln_S``."""


@dataclass(frozen=True)
class _Stated:
    """A number that a campaign states, with its uncertainty or without."""

    kind: str
    owner: str | None
    value: float
    unit: str
    uncertainty: Uncertainty | None
    path: str


def _of_materials(
    campaign: Campaign, items: Sequence[FitShot], *, by_ratio: bool
) -> Iterator[_Stated]:
    for name in sorted({i.shot.sphere for i in items if i.shot.sphere is not None}):
        ball = campaign.spheres[name]
        at = f"spheres.{name}"
        if ball.radius_m is not None:
            yield _Stated("radius", name, ball.radius_m, "m", ball.u_radius_m, f"{at}.radius_m")
        if ball.mass_kg is not None:
            yield _Stated("mass", name, ball.mass_kg, "kg", ball.u_mass_kg, f"{at}.mass_kg")
    for name in sorted({i.shot.surface for i in items if i.shot.surface is not None}):
        mass, u = campaign.surfaces[name].coupon_mass_kg, campaign.surfaces[name].u_coupon_mass_kg
        if mass is not None:
            path = f"surfaces.{name}.coupon_mass_kg"
            yield _Stated("coupon_mass", name, mass, "kg", u, path)
        ratio = campaign.surfaces[name].poissons_ratio or UNKNOWN_POISSONS_RATIO
        if by_ratio and ratio.value > 0:
            path, u = f"surfaces.{name}.poissons_ratio", Uncertainty(ratio.u)
            yield _Stated("coupon_ratio", name, ratio.value, "1", u, path)


def _of_the_rig(campaign: Campaign, items: Sequence[FitShot]) -> Iterator[_Stated]:
    if any(_fell(i) for i in items):
        u = campaign.u_height_offset_m
        yield _Stated("height_offset", None, 0.0, "m", u, "release.height_offset_u_m")
        g = campaign.gravity_m_per_s2
        yield _Stated("gravity", None, g, "m/s^2", campaign.u_gravity_m_per_s2, "gravity_m_per_s2")
    if any(i.in_air for i in items):
        air = Uncertainty(AIR_RESISTANCE_U)
        yield _Stated(AIR_RESISTANCE, None, 1.0, "1", air, AIR_RESISTANCE)
    u = _time_base_u(campaign, items)
    yield _Stated("time_base", None, 1.0, "1", u, "sample_rate_u_relative")
    gain = max(i.shot.u_gain_relative for i in items)
    if gain > 0:
        yield _Stated("converter_gain", None, 1.0, "1", Uncertainty(gain), "volts_per_code")


def _time_base_u(campaign: Campaign, items: Sequence[FitShot]) -> Uncertainty | None:
    """Return the time base's relative uncertainty: the campaign's, else the widest of its shots."""
    if campaign.u_sample_rate_relative is not None:
        return campaign.u_sample_rate_relative
    own = [(i.shot.u_sample_rate_hz, i.shot.sample_rate_hz) for i in items]
    known = [replace(u, u=u.u / rate) for u, rate in own if u is not None]
    return max(known, key=lambda u: u.u, default=None)


def stated_numbers(
    campaign: Campaign, items: Sequence[FitShot], *, by_ratio: bool
) -> tuple[tuple[Input, ...], tuple[str, ...]]:
    """Return a campaign's numbers that have an uncertainty, and the paths of those that have none.

    The inputs are in the order of spheres, surfaces, rig. What none of ``items`` depends on is left
    out. ``by_ratio`` says whether a contact law asks for the coupons' Poisson's ratios; their part
    in E = E'(1 - nu^2) is taken as independent of this one.
    """
    known = (
        *_of_materials(campaign, items, by_ratio=by_ratio),
        *_of_the_rig(campaign, items),
    )
    inputs = tuple(
        Input(s.kind, s.owner, s.value, s.unit, s.uncertainty, s.path)
        for s in known
        if s.uncertainty is not None and s.uncertainty.u > 0
    )
    uncertain = {i.path for i in inputs}
    return inputs, tuple(s.path for s in known if s.path not in uncertain)


def exact_sentence(paths: Sequence[str]) -> str:
    """Return what a result says of the numbers that were taken as exact."""
    return f"Taken as exact, because no uncertainty is stated: {', '.join(paths)}."
