r"""The drop that would best distinguish two fitted models.

Of a drop not yet made, each rival predicts a record. What of their difference d the other rival
could not take up again, by the shot's own speed, loss, touch-down and baseline and by what the
campaign leaves open in its globals, is what n such drops add to the difference of their costs:

.. math:: D_n^2 = n q - n^2 v^T (P + n H)^{-1} v

with q, v and H the square of d, its projection on the globals' columns and those columns' squares,
all whitened and with the nuisances eliminated, and P the globals' information so far. To first
order; noise scatters the sum of whitened squares by about 2 D.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array, Json
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.fit import joint
from analysis.fit.blocks import prior_rows
from analysis.fit.fit_shot import ASSUMED_REPEATABILITY, poissons_ratio
from analysis.fit.priors import Prior
from analysis.fit.problem import FitShot, JointProblem
from analysis.model.impact_model import NUISANCE, SHARED

BELOW, ABOVE = 1.5, 2.0
"""How far beyond the heights already tried a drop may be. A choice: what most rigs still reach."""
HEIGHTS = 7
"""Asked for, evenly over the logarithm of their range. A choice: over a range of twelve, fourfold
what was tried, neighbours are a factor 1.5 apart, 1.2 in speed, and little changes in between."""
MOST_REPEATS = 20
"""Of one drop: who would make more?"""
LARGEST_CODE = 32767
"""Of a converter of 16 bits."""


@dataclass(frozen=True)
class NextDrop:
    """A drop worth making."""

    sphere: str
    surface: str
    drop_height_m: float
    """[m]"""
    separates: tuple[str, str]
    """Ids of the two effects."""
    expected_distance: float
    """How far one such drop moves the two apart, as the root of whitened squares. [1]"""
    repeats: int
    """Drops after which the distance reaches ``CRITERIA.deviations``."""

    def to_json(self) -> Json:
        """Return it as the ``next_drop`` of a diagnosis."""
        return {**dataclasses.asdict(self), "separates": list(self.separates)}


@dataclass(frozen=True)
class _Drop:
    """A drop that could be made, as a shot with the window and the instrument of one that was."""

    sphere: str
    surface: str
    height_m: float
    template: int


def propose(
    rivals: Sequence[Refit], *, heights_m: Sequence[float] | None = None
) -> NextDrop | None:
    """Return the drop that would separate the first rival from the next best one best.

    Rivals are fitted to the same shots, best first; heights [m] are by default a range about those
    tried. None where the rig is in reduced units, where heights are not known, or where
    `MOST_REPEATS` of no drop would be enough. Only drops whose record stays within the converter's
    range, or else within the largest record so far, are considered. Validation: the costs of two
    rivals after the drop was simulated and both were fitted again, in
    ``tests/analysis/diagnosis/test_next_drop.py``.
    """
    able = [rival for rival in rivals if not rival.fitted.failed]
    if not able:
        return None
    drops = list(_possible_drops(able[0].problem, heights_m))
    known = [joint.normal_equations(rival.problem, rival.fitted)[0] for rival in able]
    for other, information in zip(able[1:], known[1:], strict=True):
        sides = [(able[0], known[0]), (other, information)]
        best: tuple[float, int, _Drop] | None = None
        for drop in drops:
            able[0].problem.checkpoint()
            found = _separation(sides, drop)
            if found is not None and (best is None or found[0] > best[0]):
                best = (*found, drop)
        if best is not None:
            distance, repeats, drop = best
            ids = (able[0].effect_id, other.effect_id)
            return NextDrop(drop.sphere, drop.surface, drop.height_m, ids, distance, repeats)
    return None


def _possible_drops(problem: JointProblem, heights_m: Sequence[float] | None) -> Iterator[_Drop]:
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
                yield from (_Drop(sphere, surface, h, place) for h in heights_m)


def _template(problem: JointProblem, sphere: str, surface: str) -> int | None:
    """Return the longest window among the shots most like a pair, None where it is unknown."""
    shots = problem.shots
    own = [i for i, s in enumerate(shots) if (s.shot.sphere, s.shot.surface) == (sphere, surface)]
    if not own and (problem.by_pair or any(s.radius_m is None for s in shots)):
        return None
    alike = own or [i for i, s in enumerate(shots) if sphere == s.shot.sphere]
    return max(alike, key=lambda i: shots[i].frame.samples)


def _as_shot(problem: JointProblem, drop: _Drop) -> FitShot:
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


@dataclass(frozen=True)
class _Prediction:
    """What one rival says of a drop: its record, and how it would give way."""

    signal: Array  # [unit of the signal]
    white: Array  # the same, whitened. [1]
    columns: Array  # whitened derivatives by shared and own parameters
    rows: Array  # gradients of what is known of the own parameters
    chain: Array  # shared parameters by the globals

    def parts(self, difference: Array) -> tuple[float, Array, Array]:
        """Return q, v and H where this rival gives way to a difference."""
        s = self.chain.shape[0]
        matrix = self.columns.T @ self.columns + self.rows.T @ self.rows
        vector = self.columns.T @ difference
        back = np.linalg.solve(matrix[s:, s:], np.column_stack([matrix[s:, :s], vector[s:]]))
        cross = matrix[:s, s:]
        inner = self.chain.T @ (matrix[:s, :s] - cross @ back[:, :-1]) @ self.chain
        load = self.chain.T @ (vector[:s] - cross @ back[:, -1])
        return float(difference @ difference - vector[s:] @ back[:, -1]), load, inner


def _predict(rival: Refit, drop: _Drop) -> _Prediction | None:
    """Return what a rival says of a drop, None where it says nothing."""
    problem, fitted = rival.problem, rival.fitted
    item, model = _as_shot(problem, drop), problem.model
    rows = range(len(SHARED[model.kind]), len(model.shared))
    keys = [problem.effect_key(row, item) for row in rows]
    if any(key is not None and key not in problem.names for key in keys):
        return None
    shared, chain = problem.shared_local(item, fitted.theta)
    assert item.speed_prior is not None
    local = np.concatenate([shared, fitted.nuisances[drop.template]])
    at = len(model.shared)
    local[at : at + 2] = item.speed_prior.mean, _loss(rival, drop)
    local[at] += model.speed_shift(local, item.frame)
    found, jacobian, gradient = model.linearise(local, item.frame)
    if not (math.isfinite(found.rebound_ratio) and np.isfinite(jacobian).all()):
        return None
    _, known = prior_rows(model, item, local, found.rebound_ratio, gradient)
    white = item.whiten(found.signal)
    return _Prediction(found.signal, white, item.whiten(jacobian), np.array(known), chain)


def _loss(rival: Refit, drop: _Drop) -> float:
    """Return ln e as a rival's shots of the pair have it, else as those of either material do.

    Rivals share a sphere's loss between dashpot and effect differently, and often with the speed.
    """
    shots = rival.problem.shots
    same = [(s.shot.sphere == drop.sphere) + (s.shot.surface == drop.surface) for s in shots]
    rows = [i for i, n in enumerate(same) if n == max(same)]
    return float(np.median(rival.fitted.nuisances[rows, NUISANCE.index("ln_e")]))


def _separation(sides: Sequence[tuple[Refit, Array]], drop: _Drop) -> tuple[float, int] | None:
    """Return how far a drop separates two rivals, whichever is right, and how often to repeat it.

    Each with what the campaign has told of its globals. None where the drop would clip, where a
    rival says nothing of it, or where no number of repeats is enough.
    """
    first, second = (_predict(rival, drop) for rival, _ in sides)
    if first is None or second is None:
        return None
    top = max(float(np.abs(p.signal).max()) for p in (first, second))
    if top > _largest_signal(sides[0][0].problem.shots):
        return None
    difference = first.white - second.white

    both = zip((first, second), sides, strict=True)
    try:
        parts = [(*p.parts(difference), known) for p, (_, known) in both]
        for repeats in range(1, MOST_REPEATS + 1):
            if _squared(parts, repeats) >= CRITERIA.deviations**2:
                return math.sqrt(max(_squared(parts, 1), 0.0)), repeats
    except np.linalg.LinAlgError:  # a number that nothing fixes: such a fit foretells nothing
        return None
    return None


def _squared(parts: Sequence[tuple[float, Array, Array, Array]], n: int) -> float:
    """Return D^2 after n repeats, of the rival that gives way more."""
    return min(
        float(n * q - n**2 * v @ np.linalg.solve(known + n * h, v)) for q, v, h, known in parts
    )


def _largest_signal(shots: Sequence[FitShot]) -> float:
    """Return up to where a record is certainly whole. [unit of the signal]"""
    clipped = [s.window.peak for s in shots if s.shot.clipped]
    steps = [s.shot.quantum for s in shots if s.shot.quantum is not None]
    if clipped:
        return CRITERIA.nearly_all * min(clipped)
    if len(steps) == len(shots):
        return CRITERIA.nearly_all * LARGEST_CODE * min(steps)
    return max(s.window.peak for s in shots)
