"""Drops of a campaign's materials that were not made yet."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.fit.fit_shot import ASSUMED_REPEATABILITY, poissons_ratio
from analysis.fit.priors import Prior
from analysis.fit.problem import FitShot, JointProblem

HEIGHTS = 7
"""Asked for, evenly over the logarithm of their range."""
BELOW, ABOVE = 1.5, 2.0
"""How far beyond the heights already tried a drop may be."""


@dataclass(frozen=True)
class PossibleDrop:
    """A drop that could be made.

    Attributes
    ----------
    sphere, surface : str
        The pair.
    height_m : float
        [m]
    template : int
        Place of the shot whose window and instrument it would have.
    """

    sphere: str
    surface: str
    height_m: float
    template: int


def possible_drops(
    problem: JointProblem, heights_m: Sequence[float] | None
) -> Iterator[PossibleDrop]:
    """Yield every drop of materials that the fit knows, over a range of heights."""
    tried = [s.shot.drop_height_m for s in problem.shots if s.shot.drop_height_m is not None]
    if not tried:
        return
    if heights_m is None:
        grid = np.geomspace(min(tried) / BELOW, max(tried) * ABOVE, HEIGHTS)
        heights_m = [round(float(h), 4) for h in grid]
    spheres = sorted({s.shot.sphere for s in problem.shots if s.shot.sphere})
    surfaces = sorted({s.shot.surface for s in problem.shots if s.shot.surface})
    for sphere in spheres:
        for surface in surfaces:
            place = _template(problem, sphere, surface)
            if place is not None:
                yield from (PossibleDrop(sphere, surface, h, place) for h in heights_m)


def _template(problem: JointProblem, sphere: str, surface: str) -> int | None:
    """Return the longest window among the shots most like a pair, None where it is unknown."""
    shots = problem.shots
    own = [i for i, s in enumerate(shots) if (s.shot.sphere, s.shot.surface) == (sphere, surface)]
    if not own and (problem.by_pair or any(s.radius_m is None for s in shots)):
        return None
    alike = own or [i for i, s in enumerate(shots) if sphere == s.shot.sphere]
    return max(alike, key=lambda i: shots[i].frame.samples)


def as_shot(problem: JointProblem, drop: PossibleDrop) -> FitShot:
    """Return a drop as a shot of the problem, without a record of its own."""
    template = problem.shots[drop.template]
    campaign = problem.campaign
    surface = campaign.surfaces.get(drop.surface)
    sphere = campaign.spheres.get(drop.sphere)
    prior = template.speed_prior
    frame = dataclasses.replace(
        template.frame,
        drop_height_m=drop.height_m,
        radius_m=sphere.radius_m if sphere else None,
        mass_kg=(sphere.mass_kg if sphere else None) or template.frame.mass_kg,
        coupon_mass_kg=surface.coupon_mass_kg if surface else None,
        sphere=drop.sphere,
        surface=drop.surface,
        coupon_poissons_ratio=poissons_ratio(surface),
    )
    shot = dataclasses.replace(
        template.shot,
        sphere=drop.sphere,
        surface=drop.surface,
        drop_height_m=drop.height_m,
        restitution=None,
        impact_speed_m_per_s=None,
    )
    speed = 0.5 * math.log(2.0 * campaign.gravity_m_per_s2 * drop.height_m)
    repeatability = campaign.speed_repeatability or (prior.u if prior else ASSUMED_REPEATABILITY)
    return dataclasses.replace(
        template,
        shot=shot,
        frame=frame,
        radius_m=None if template.radius_m is None else frame.radius_m,
        speed_prior=Prior(speed, repeatability),
    )
