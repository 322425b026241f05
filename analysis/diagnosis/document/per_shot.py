"""Numbers that every shot has for itself, told as one: the middle of them and how far they go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kruskal, spearmanr

from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.effect import Effect
from analysis.fit.measurand import Json
from analysis.fit.problem import FitShot
from analysis.fit.result import FitResult

Array = NDArray[np.float64]

SIZE = "size_rms"
"""Name under which the free sizes of a shot are told: the rms of what they add to the record."""


def parameters_by_shot(effect: Effect, result: FitResult) -> Json:
    """Return the numbers of an effect that belong to single shots.

    Parameters
    ----------
    effect : Effect
        Part of the fitted model.
    result : FitResult
        The fit.

    Returns
    -------
    dict
        By parameter: ``value``, the median, with ``least``, ``most``, the number of ``shots`` and
        what they go with. ``u`` is null: the shots differ, and that is not an uncertainty. Empty
        where the effect has no such number.
    """
    model = result.problem.model
    own = next((e for e in model.effects if e.id == effect.id), None)
    if own is None or not result.shots:
        return {}
    found: Json = {}
    for parameter in own.parameters:
        if parameter.scope == "shot":
            at = model.nuisances.index(f"{own.id}.{parameter.name}")
            felt = [own.acts_on(s.shot.sphere, s.shot.surface) for s in result.problem.shots]
            values = [parameter.value(float(x)) for x in result.fitted.nuisances[felt, at]]
            shots = [s for s, own_shot in zip(result.problem.shots, felt, strict=True) if own_shot]
            found[parameter.name] = told_of_shots(values, parameter.unit, shots)
    if own.basis is not None:
        unit = "V" if result.shots[0].item.shot.quantity == "voltage" else "of the signal"
        sizes = [_size(own, result, row) for row in range(len(result.shots))]
        found[SIZE] = told_of_shots(sizes, unit, result.problem.shots)
    return found


def told_of_shots(values: Sequence[float], unit: str, shots: Sequence[FitShot]) -> Json:
    """Return one value a shot as their median and range, and what it goes with.

    Parameters
    ----------
    values : sequence of float
        One a shot.
    unit : str
        Theirs.
    shots : sequence of FitShot
        The shots.

    Returns
    -------
    dict
        ``value``, the median, with ``least``, ``most`` and the number of ``shots``; ``u`` is null.
        ``goes_with`` says in words what the values follow.
    """
    return {
        "value": float(np.median(values)),
        "u": None,
        "unit": unit,
        "least": float(np.min(values)),
        "most": float(np.max(values)),
        "shots": len(values),
        "goes_with": dependence(values, shots),
    }


def _size(effect: Effect, result: FitResult, row: int) -> float:
    """Return the rms of what an effect's free sizes add to one shot. [unit of the signal]"""
    model, item = result.problem.model, result.problem.shots[row]
    shared, _ = result.problem.shared_local(item, result.fitted.theta)
    local = np.concatenate([shared, result.fitted.nuisances[row]])
    without = local.copy()
    first = model.names.index(f"{effect.id}.basis0")
    without[first : first + effect.basis_size] = 0.0
    added = model.predict(local, item.frame).signal - model.predict(without, item.frame).signal
    return float(np.sqrt(np.mean(added**2)))


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
        Nothing where chance could have ordered them so. Ranks only, so that neither a wild shot nor
        the law of the dependence matters.

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
