"""The learned closure as curves: what it adds to a typical shot, and its force where it has one.

A closure is a set of columns with coefficients. Beside it the model's own parameters find new
places, all to first order: what is left of a shot's residual is what neither takes up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.columns import CONTACT_POWERS
from analysis.discovery.evidence import Explained, family_columns, scale_of
from analysis.discovery.stack import Grid, binned, grid_for
from analysis.discovery.trail import Step
from analysis.fit.measurand import Json
from analysis.fit.result import FitResult
from analysis.fit.shot_fit import ShotFit

Array = NDArray[np.float64]

MOST_CURVES = 6
DEPTHS = np.linspace(0.05, 1.5, 30)
RATES = (1.0, 0.0, -1.0)
DIGITS = 4


def closure_curves(step: Step, result: FitResult, closure: Explained) -> Json:
    """Return the curves of a learned closure.

    Parameters
    ----------
    step : Step
        The turn whose residual it was learned from.
    result : FitResult
        That turn's fit.
    closure : Explained
        With coefficients.

    Returns
    -------
    dict
        ``shots``: for one shot of each owner the pulse, the residual, what the closure adds and
        what is left after the model's own parameters gave way to it [unit of the signal], over
        ``time_us``; ``force``: for a contact closure the added share of
        the elastic force over indentation [1], loading, at rest and unloading; else null.
    """
    if not closure.coefficients or not result.shots:
        return {"shots": [], "force": None}
    grid = grid_for(result.shots)
    owners = step.evidence.owners(closure.scope)
    shown: dict[str, int] = {}
    for place, own in enumerate(owners):
        key = "+".join(owner for owner, _ in own)
        best = shown.get(key)
        if best is None or _peak(result, place) > _peak(result, best):
            shown[key] = place
    sizes = [_coefficients(step, closure, own) for own in owners]
    moved = _moved_globals(step, closure, sizes)
    curves = [
        {
            "owner": "+".join(owner for owner, _ in owners[place]),
            **_on_shot(step, place, closure.family, sizes[place], moved),
        }
        for place in sorted(shown.values())[:MOST_CURVES]
    ]
    for curve, place in zip(curves, sorted(shown.values()), strict=False):
        for name in ("pulse", "residual", "added", "left"):
            curve[name] = _binned(grid, result.shots[place], curve[name])
        curve["time_us"] = _rounded(grid.centres_us)
    force = None
    if closure.family in ("contact", "loss"):
        names = sorted({owner for own in owners for owner, _ in own})
        force = {
            "indentation": _rounded(DEPTHS),
            "curves": [_force(step, closure, name) for name in names],
        }
    return {"shots": curves, "force": force}


def _peak(result: FitResult, place: int) -> float:
    return result.shots[place].item.window.peak


def _coefficients(
    step: Step, closure: Explained, own: list[tuple[str, float]] | list[str]
) -> Array:
    """Return one shot's coefficients, in the order of the family's columns."""
    _, labels = step.evidence.families[closure.family]
    weighted = [(o, 1.0) if isinstance(o, str) else o for o in own]
    return np.array(
        [
            sum(
                weight * closure.coefficients.get(f"{label} [{owner}]" if owner else label, 0.0)
                for owner, weight in weighted
            )
            for label in labels
        ]
    )


def _moved_globals(step: Step, closure: Explained, sizes: list[Array]) -> Array:
    """Return where the shared parameters go when the closure is there, to first order."""
    at, _ = step.evidence.families[closure.family]
    problem, fitted = step.problem, step.fitted
    matrix = problem.prior_precision.copy()
    load: Array = -problem.prior_precision @ (fitted.theta - problem.prior_mean)
    for shot, own in zip(step.evidence.shots, sizes, strict=True):
        s = shot.chain.shape[0]
        matrix += shot.chain.T @ shot.matrix[:s, :s] @ shot.chain
        load += shot.chain.T @ (shot.vector[:s] - shot.matrix[:s][:, at] @ own)
    return np.asarray(np.linalg.solve(matrix, load))


def _on_shot(step: Step, place: int, family: str, own: Array, moved: Array) -> Json:
    """Return one shot's pulse, residual, addition and rest as arrays over its window."""
    problem, fitted = step.problem, step.fitted
    item = problem.shots[place]
    shared, chain = problem.shared_local(item, fitted.theta)
    local = np.concatenate([shared, fitted.nuisances[place]])
    found, jacobian, _ = problem.model.linearise(local, item.frame)
    s = len(problem.model.shared)
    clean = found.signal - local[s + 3]
    parts = family_columns(
        problem, item, local=local, clean=clean, jacobian=jacobian, scale=scale_of(problem, fitted)
    )
    added = next(p[2] for p in parts if p[0] == family) @ own
    residual = step.evidence.shots[place].residual
    left = residual - added - jacobian[:, :s] @ (chain @ moved)
    # the shot's own parameters take what they can of the rest
    design, white = item.noise.whiten(jacobian[:, s:]), item.noise.whiten(left)
    left = left - jacobian[:, s:] @ np.linalg.lstsq(design, white)[0]
    return {
        "shot": item.shot.name,
        "pair": item.pair,
        "drop_height_m": item.shot.drop_height_m,
        "pulse": clean,
        "residual": residual,
        "added": added,
        "left": left,
    }


def _binned(grid: Grid, shot: ShotFit, values: Array) -> list[float | None]:
    sums, counts = binned(grid, shot, values)
    return _rounded(np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan))


def _force(step: Step, closure: Explained, owner: str) -> Json:
    """Return the added share of the elastic force over indentation, one list per rate."""
    coefficients = _coefficients(step, closure, [owner])
    return {
        "owner": owner,
        "rate": list(RATES),
        "share": [
            _rounded(
                sum(
                    (
                        c * DEPTHS**i * rate**j
                        for c, (i, j) in zip(coefficients, CONTACT_POWERS, strict=True)
                    ),
                    np.zeros(DEPTHS.size),
                )
            )
            for rate in RATES
        ],
    }


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]
