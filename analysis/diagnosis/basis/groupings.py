r"""The groupings of a coefficient, and the sets of materials on which an effect acts.

An effect's size on each material, to first order, leaves few candidates. Let :math:`c_m` be the
size that material m asks for and S the information about all of them, the rest of the model
eliminated. One size for the materials of a set A, and none for the others, takes up
:math:`(1_A^T S c)^2 / (1_A^T S 1_A)` squares. Where S is diagonal the best A of all are the first
or the last so many in the order of c: two groups, one with its centre at zero, are best parted at a
threshold. So the sets that begin this order, and those that end it, which are their complements,
are the candidates; nobody counts through all :math:`2^n`. The order of what each material alone
takes up would not do: one with few shots comes late in it whatever it asks for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from analysis.aliases import Array
from analysis.effects.acts_on import ActsOn
from analysis.fit.problem import FitShot, JointProblem

Weights = list[tuple[str, float]]
"""The groups whose coefficients a shot has, each with a weight."""

SETTLED_SHOTS = 8.0
"""Shots after which a drift of the first ones has fallen to 1/e. A choice: of the usual 54 shots,
in three rounds of 18, it is over after the first round (exp(-18/8) is a tenth)."""
BY_SPEED = " speed"
"""Ending of a scope whose coefficients also change with the impact speed."""
LEAST_INFORMATION = 1e-10
"""Least eigenvalue, of a matrix with ones along its diagonal, that is no rounding: sums over all
shots are good to 1e-12."""


def groups(problem: JointProblem, scope: str) -> list[Weights]:
    """Return for each shot, in order of time, the groups whose coefficients it has.

    Scopes are rig, surface, sphere, pair, height, order, drift, ``sphere drift`` and ``surface
    drift``; rig, surface, sphere and pair also with `BY_SPEED` behind them.
    """
    if scope.endswith(BY_SPEED):
        return _with_speed(problem, scope.removesuffix(BY_SPEED))
    last = max(len(problem.shots) - 1, 1)
    return [
        _in_time(item, scope, place, last)
        if scope.endswith(("order", "drift"))
        else [(_group(item, scope), 1.0)]
        for place, item in enumerate(problem.shots)
    ]


def _group(item: FitShot, scope: str) -> str:
    if scope in ("surface", "sphere"):
        return str(getattr(item.shot, scope))
    if scope == "pair":
        return item.pair
    if scope == "height":
        height = item.shot.drop_height_m
        return "?" if height is None else f"{height * 1e3:.1f} mm"
    return ""


def _in_time(item: FitShot, scope: str, place: int, last: int) -> Weights:
    """Return a trend and a bow over the campaign, and what settles at its start."""
    t = 2.0 * place / last - 1.0
    found = [("trend", t), ("bow", 1.5 * t * t - 0.5)]
    if scope == "drift":
        return [*found, ("start", math.exp(-place / SETTLED_SHOTS))]
    if scope == "order":
        return found
    material = item.shot.sphere if scope == "sphere drift" else item.shot.surface
    return [(f"{material} {part}", weight) for part, weight in found]


def _with_speed(problem: JointProblem, scope: str) -> list[Weights]:
    """Return groups, each once more with the logarithm of the speed over the usual one."""
    heights = [item.shot.drop_height_m for item in problem.shots]
    speeds = [0.5 * math.log(h) if h is not None and h > 0.0 else None for h in heights]
    known = sorted(v for v in speeds if v is not None)
    usual = known[len(known) // 2] if known else 0.0
    found = []
    for item, speed in zip(problem.shots, speeds, strict=True):
        group = _group(item, scope)
        away = 0.0 if speed is None else speed - usual
        found.append([(group, 1.0), (f"{group} by speed".strip(), away)])
    return found


@dataclass(frozen=True)
class Sizes:
    """An effect's size on each material of a kind, to first order."""

    kind: str
    """``surface`` or ``sphere``."""
    names: tuple[str, ...]
    values: Array
    """The size that each material asks for; 0 where it says nothing. [amplitude's coordinate]"""
    information: Array
    """Inverse covariance of the sizes, everything else eliminated, shape (n, n)."""

    @classmethod
    def from_score(cls, kind: str, names: Sequence[str], score: Array, information: Array) -> Sizes:
        """Return the sizes that a score asks for, the smallest where the data leave them open."""
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        seen = values > LEAST_INFORMATION
        asked = vectors[:, seen] @ ((vectors[:, seen].T @ (score / scale)) / values[seen])
        return cls(kind, tuple(names), asked / scale, information)

    @property
    def gain(self) -> float:
        """Return the squares that a size for each material explains."""
        return float(self.values @ self.information @ self.values)

    def common(self, names: Sequence[str]) -> tuple[float, float]:
        """Return the common size of some materials, and the squares that it explains."""
        inside = np.isin(self.names, names).astype(float)
        score = float(inside @ self.information @ self.values)
        known = float(inside @ self.information @ inside)
        return (score / known, score**2 / known) if known > 0.0 else (0.0, 0.0)

    def candidates(self, *, either_sign: bool = True) -> list[ActsOn]:
        """Return the sets of materials worth a fit, the most promising first.

        The first and the last so many in the order of the sizes, at least one and never all; those
        whose size is above the neutral value where it may not have either sign.
        """
        order = [self.names[j] for j in np.argsort(self.values, kind="stable")]
        cuts = range(1, len(order))
        sets = {tuple(sorted(part)) for k in cuts for part in (order[:k], order[k:])}
        found = [
            ActsOn(self.kind, names)
            for names in sorted(sets)
            if either_sign or self.common(names)[0] > 0.0
        ]
        return sorted(found, key=lambda only: -self.promise(only))

    def each_of(self, names: Sequence[str]) -> float:
        """Return the squares that a size for each of some materials explains."""
        inside = np.isin(self.names, names)
        score = (self.information @ self.values)[inside]
        known = self.information[np.ix_(inside, inside)]
        return float(score @ np.linalg.lstsq(known, score, rcond=LEAST_INFORMATION)[0])

    def needing_own_size(self, price: float) -> tuple[ActsOn | None, float]:
        """Return the materials that need a size, each its own, and what this is worth in squares.

        One material after the other is left out, that which costs least, each size at a price. None
        where all need one, or only one does.
        """
        left, best, most = self.names, None, self.gain - price * len(self.names)
        while len(left) > 2:
            _, left = max((self.each_of(some), some) for some in combinations(left, len(left) - 1))
            worth = self.each_of(left) - price * len(left)
            worth -= price_of_choice(len(left), len(self.names))
            if worth > most:
                best, most = ActsOn(self.kind, left), worth
        return best, most

    def promise(self, only: ActsOn) -> float:
        """Return the squares that a set's common size explains, less the price of its choice."""
        return self.common(only.names)[1] - price_of_choice(len(only.names), len(self.names))


def price_of_choice(chosen: int, present: int) -> float:
    r"""Return what it costs, in squares, that so many of the materials of a kind were chosen.

    Minus twice the logarithm of the prior, :math:`2 \ln ((n - 1) \binom{n}{k})`: before the data
    each number from 1 to n - 1 is as likely, and each set of that number. All are no choice.
    """
    if not 0 < chosen < present:
        return 0.0
    return 2.0 * math.log((present - 1) * math.comb(present, chosen))


def price_of_grouping(only: ActsOn | None, shots: Sequence[FitShot]) -> float:
    """Return the price of the choice in a campaign; 0 of an effect that acts on everything."""
    if only is None:
        return 0.0
    present = {getattr(item.shot, only.kind) for item in shots}
    return price_of_choice(len(present.intersection(only.names)), len(present))
