"""Waveforms locked to the record as discrepancies: on top of a model, or in its place.

On top, it is the mean waveform of what the model leaves, with its modes; in the model's place that
of the records themselves, so that no discrepancy loses to a mean of other hits. All they state is
of shots they were not learned on: a mean of few hits follows these, noise included.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.discrepancy.fitted import Learned
from analysis.diagnosis.discrepancy.mean_waveform import Fold, MeanWaveform, Prediction, predictions
from analysis.diagnosis.discrepancy.waveform_fit import Hit
from analysis.diagnosis.forward_selection import Step
from analysis.diagnosis.progress import BudgetSpentError
from analysis.fit.campaign_fit import heldout_fits, refit_nuisances
from analysis.fit.joint import Fitted
from analysis.fit.problem import JointProblem

ON_TOP, IN_PLACE = "waveform", "mean_waveform"
SCOPE = "pair"

Array = NDArray[np.float64]


def waveform_discrepancy(step: Step, mean: MeanWaveform) -> Learned | None:
    """Return the waveform that repairs held-out shots best, as a discrepancy of a model.

    Parameters
    ----------
    step : Step
        The present model.
    mean : MeanWaveform
        Of the same shots.

    Returns
    -------
    Learned or None
        None where no mean can be had.
    """
    most = len(mean.predictions) - 1
    if most < 0:
        return None
    found = [(IN_PLACE, one) for one in mean.predictions]
    try:
        folds = _residuals(step.problem, step.fitted)
        found += [(ON_TOP, one) for one in predictions(step.problem, folds, most)]
    except (np.linalg.LinAlgError, BudgetSpentError):
        pass  # a fold leaves the model without a solution, or the time is over
    known = [one for one in found if math.isfinite(one[1].heldout_rms)]
    family, best = min(known, key=lambda one: one[1].heldout_rms)
    return _as_discrepancy(step, family, best)


def _residuals(problem: JointProblem, fitted: Fitted) -> Iterator[Fold]:
    """Yield each fold and what the model that the others fit leaves of every shot."""
    for fold, others in heldout_fits(problem, fitted):
        rows = iter(others.nuisances)
        yield (
            fold,
            [
                Hit.of(
                    item,
                    refit_nuisances(
                        problem, i, others.theta, fitted.nuisances[i] if i in fold else next(rows)
                    ),
                )
                for i, item in enumerate(problem.shots)
            ],
        )


def _as_discrepancy(step: Step, family: str, found: Prediction) -> Learned:
    residual = [one.residual for one in found.hits]
    shots = zip(step.problem.shots, residual, strict=True)
    return Learned(
        parts=((family, SCOPE),),
        problem=step.problem,
        fitted=step.fitted,
        coefficients={},
        by_shot=_numbers(found),
        added=[s.residual - r for s, r in zip(step.linearised.shots, residual, strict=True)],
        residual=residual,
        chi2=sum(float(np.sum(np.square(item.whiten(left)))) for item, left in shots),
        rms=found.heldout_rms,
        heldout_rms=found.heldout_rms,
    )


def _numbers(found: Prediction) -> dict[str, Array]:
    """Return what every shot has for itself, a mode of 0 where few hits allow none."""
    sizes = {"size": 0} | {f"mode {k}": k for k in range(1, found.modes + 1)}
    numbers = {
        label: np.array([one.sizes[k] if k < one.sizes.size - 1 else 0.0 for one in found.hits])
        for label, k in sizes.items()
    }
    return numbers | {"stretch": np.array([one.stretch for one in found.hits])}
