"""What do numbers that every shot has for itself go with: a material, the order, the height?

Ranks only, so that neither a wild shot nor the law of the dependence matters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kruskal, spearmanr

from analysis.diagnosis.criteria import CRITERIA
from analysis.fit.problem import FitShot

Array = NDArray[np.float64]


def dependence(values: Sequence[float], shots: Sequence[FitShot]) -> list[str]:
    """Return what a number of every shot goes with, in words.

    Parameters
    ----------
    values : sequence of float
        One a shot.
    shots : sequence of FitShot
        The shots, in order of time.

    Returns
    -------
    list of str
        Nothing where chance could have ordered them so.

    Notes
    -----
    Kruskal-Wallis between materials, with a p-value below ``CRITERIA.words.dependence_p_value``;
    Spearman's rank correlation with order and height, over all shots and over each coupon's, of
    which the smallest p-value times their number is.
    """
    found = np.asarray(values, dtype=np.float64)
    if found.size < CRITERIA.words.dependence_least_shots or np.ptp(found) == 0.0:
        return []
    coupons = np.array([s.shot.surface for s in shots])
    spheres = np.array([s.shot.sphere for s in shots])
    said = [*_between("coupon", found, coupons), *_between("sphere", found, spheres)]
    groups = {"": np.full(found.size, fill_value=True)}
    groups |= {f" on {name}": coupons == name for name in sorted(set(coupons.tolist()))}
    heights = [s.shot.drop_height_m for s in shots]
    said += _along("from drop to drop", found, np.arange(found.size, dtype=np.float64), groups)
    if all(height is not None for height in heights):
        said += _along("with the drop height", found, np.array(heights, dtype=np.float64), groups)
    return said


def _between(what: str, values: Array, names: NDArray[np.str_]) -> list[str]:
    """Return how a number differs between materials, by their medians."""
    distinct = sorted(set(names.tolist()))
    if (
        len(distinct) < 2
        or kruskal(*(values[names == n] for n in distinct)).pvalue
        > CRITERIA.words.dependence_p_value
    ):
        return []
    medians = ", ".join(f"{name} {np.median(values[names == name]):.3g}" for name in distinct)
    return [f"goes with the {what}: {medians}"]


def _along(
    what: str, values: Array, place: Array, groups: dict[str, NDArray[np.bool_]]
) -> list[str]:
    """Return whether a number rises or falls along something, where it does so most clearly."""
    best: tuple[float, float, str] | None = None
    for where, group in groups.items():
        one, other = values[group], place[group]
        if (
            one.size < CRITERIA.words.dependence_least_shots
            or np.ptp(one) == 0.0
            or np.ptp(other) == 0.0
        ):
            continue
        correlation, p = map(float, spearmanr(one, other))
        if best is None or p < best[0]:
            best = p, correlation, where
    if best is None or best[0] * len(groups) > CRITERIA.words.dependence_p_value:
        return []
    _, correlation, where = best
    turn = "rises" if correlation > 0.0 else "falls"
    return [f"{turn} {what}{where}, rank correlation {correlation:.2f}"]
