"""Who owns a coefficient: the rig, a material, a height, a stretch of time."""

from __future__ import annotations

import math

from analysis.fit.problem import FitShot, JointProblem

SETTLED_SHOTS = 8.0
"""A drift of the first shots dies out within so many."""
BY_SPEED = " speed"
"""Ending of a scope whose coefficients also change with the impact speed."""

Own = list[tuple[str, float]]


def groups(problem: JointProblem, scope: str) -> list[Own]:
    """Return for each shot who owns its coefficients, with a weight.

    Parameters
    ----------
    problem : JointProblem
        With its shots in order of time.
    scope : str
        rig, surface, sphere, pair, height, order, drift, ``sphere drift`` or ``surface drift``;
        rig, surface, sphere and pair also with `BY_SPEED` behind them.

    Returns
    -------
    list of list of tuple
        (group, weight) for each shot.
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
    record = item.shot
    if scope == "surface":
        return str(record.surface)
    if scope == "sphere":
        return str(record.sphere)
    if scope == "pair":
        return item.pair
    if scope == "height":
        height = record.drop_height_m
        return "?" if height is None else f"{height * 1e3:.1f} mm"
    return ""


def _in_time(item: FitShot, scope: str, place: int, last: int) -> Own:
    """Return a trend and a bow over the campaign, and what settles at its start."""
    t = 2.0 * place / last - 1.0
    found = [("trend", t), ("bow", 1.5 * t * t - 0.5)]
    if scope == "drift":
        return [*found, ("start", math.exp(-place / SETTLED_SHOTS))]
    if scope == "order":
        return found
    whom = item.shot.sphere if scope == "sphere drift" else item.shot.surface
    return [(f"{whom} {part}", weight) for part, weight in found]


def _with_speed(problem: JointProblem, scope: str) -> list[Own]:
    """Return groups, each once more with the logarithm of the speed over the usual one."""
    speeds = [_ln_speed(item) for item in problem.shots]
    known = sorted(v for v in speeds if v is not None)
    usual = known[len(known) // 2] if known else 0.0
    found = []
    for item, speed in zip(problem.shots, speeds, strict=True):
        group = _group(item, scope)
        away = 0.0 if speed is None else speed - usual
        found.append([(group, 1.0), (f"{group} by speed".strip(), away)])
    return found


def _ln_speed(item: FitShot) -> float | None:
    height = item.shot.drop_height_m
    return None if height is None or height <= 0.0 else 0.5 * math.log(height)
