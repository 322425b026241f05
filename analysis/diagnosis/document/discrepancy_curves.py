"""The learned discrepancy as curves: what it adds to a typical shot, and its force if it has one.

What it adds and leaves are those of the repaired prediction: model and discrepancy fitted to
each other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.discrepancy.fit import Learned
from analysis.diagnosis.document.stack import Grid, binned, grid_for
from analysis.diagnosis.stepwise.forward import Step
from analysis.effects.contact_closure import ELASTIC_POWERS, RATE_POWERS
from analysis.fit.measurand import Json
from analysis.fit.shot_fit import ShotFit, collect

Array = NDArray[np.float64]

MOST_CURVES = 6
"""More curves than this nobody reads."""
DEPTHS = np.linspace(0.05, 1.5, 30)
RATES = (1.0, 0.0, -1.0)
DIGITS = 4
"""Of a number that is only drawn."""


def discrepancy_curves(step: Step, learned: Learned) -> Json:
    """Return the curves of a learned discrepancy.

    Parameters
    ----------
    step : Step
        The turn whose residual it was learned from.
    learned : Learned
        The discrepancy.

    Returns
    -------
    dict
        ``shots``: for at most `MOST_CURVES` groups, the shot to which it adds most: the pulse, the
        residual, what the discrepancy adds and what is left [unit of the signal], over ``time_us``;
        ``force``: of a contact discrepancy the added share of the elastic force over indentation,
        loading, at rest and unloading; else null.
    """
    shots = collect(step.problem, step.fitted, scale=1.0)
    grid = grid_for(shots)
    scope = learned.parts[0][1]
    groups = ["+".join(o for o, _ in own) for own in step.linearised.groups(scope)]
    added = [float(np.sqrt(np.mean(np.square(a)))) for a in learned.added]
    # where every shot has its own numbers, one of each pair
    keys = [s.pair for s in step.problem.shots] if scope == "shot" else groups
    shown: dict[str, int] = {}
    for place, key in enumerate(keys):
        if key not in shown or added[place] > added[shown[key]]:
            shown[key] = place
    most = sorted(shown.values(), key=lambda place: -added[place])[:MOST_CURVES]
    curves = [
        {"owner": groups[place], **_on_shot(step, learned, place, grid, shots[place])}
        for place in sorted(most)
    ]
    return {"shots": curves, "force": _forces(learned)}


def _on_shot(step: Step, learned: Learned, place: int, grid: Grid, shot: ShotFit) -> Json:
    """Return one shot's pulse, residual, addition and rest, over the grid's time."""
    item = step.problem.shots[place]
    residual = step.linearised.shots[place].residual
    return {
        "shot": item.shot.name,
        "pair": item.pair,
        "drop_height_m": item.shot.drop_height_m,
        "time_us": _rounded(grid.centres_us),
        "pulse": _binned(grid, shot, item.window.signal - residual),
        "residual": _binned(grid, shot, residual),
        "added": _binned(grid, shot, learned.added[place]),
        "left": _binned(grid, shot, learned.residual[place]),
    }


def _binned(grid: Grid, shot: ShotFit, values: Array) -> list[float | None]:
    sums, counts = binned(grid, shot, values)
    return _rounded(np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan))


def _forces(learned: Learned) -> Json | None:
    """Return the added share of the elastic force over indentation, one list per rate."""
    forms = [f.removeprefix("force_") for f, _ in learned.parts if f.startswith("force_")]
    if not forms:
        return None
    groups = sorted({label.rpartition("[")[2] for label in learned.coefficients if "[" in label})
    return {
        "indentation": _rounded(DEPTHS),
        "curves": [
            _force(learned, forms, f"[{group}" if group else "") for group in groups or [""]
        ],
    }


def _force(learned: Learned, forms: list[str], group: str) -> Json:
    share = {rate: np.zeros(DEPTHS.size) for rate in RATES}
    for form in forms:
        powers = ELASTIC_POWERS if form == "elastic" else RATE_POWERS
        for power in powers:
            size = learned.coefficients.get(f"{form}.u^{power:g}{group}", 0.0)
            for rate in RATES:
                share[rate] += size * DEPTHS**power * (1.0 if form == "elastic" else rate)
    return {
        "owner": group.strip("[]"),
        "rate": list(RATES),
        "share": [_rounded(share[rate]) for rate in RATES],
    }


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]
