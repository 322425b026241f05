"""The held-out check: the error on shots left out, and a model as the result of any other fit."""

from __future__ import annotations

import dataclasses

import numpy as np

from analysis.diagnosis.basis.form_error import discrepancy
from analysis.diagnosis.progress import BudgetSpentError, unwatched
from analysis.fit.campaign_fit import heldout_rms, solve
from analysis.fit.freed_inputs import widened_by
from analysis.fit.joint import MAX_ITERATIONS, Fitted
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult, outcome_of
from analysis.fit.shot_fit import collect


def heldout_or_none(problem: JointProblem, fitted: Fitted) -> float | None:
    """Return the rms error on held-out shots. [unit of the signal]

    None where a fold leaves the model without a solution, as at the edge of what can be evaluated,
    and where the time is over.
    """
    if fitted.failed:
        return None
    try:
        return heldout_rms(problem, fitted)
    except (np.linalg.LinAlgError, BudgetSpentError):
        return None


def as_fit_result(
    problem: JointProblem, fitted: Fitted, *, heldout: bool = True, steps: int = MAX_ITERATIONS
) -> FitResult:
    """Return a model at its best as the fit result that `fit_campaign` would have made of it.

    What its effects' laws may be wrong by is among its globals; the covariance is widened where the
    residual exceeds the noise all the same.
    """
    name = problem.model.name
    if fitted.failed:
        return FitResult(name, outcome_of(problem, fitted), problem, fitted, (), 1.0, None)
    # a document rests on these numbers, whatever the time; held-out shots can be spared
    own = unwatched(dataclasses.replace(problem, start=fitted.theta, shots=list(problem.shots)))
    inexact = discrepancy(own, fitted)
    if inexact is not None:
        own = widened_by(own, inexact.as_inputs(own.shots), own.prior_precision)
    found, scale = solve(own, fitted.nuisances, steps=steps)
    held = None
    if heldout and inexact is None:
        timed = dataclasses.replace(own, checkpoint=problem.checkpoint)
        held = heldout_or_none(timed, found)
    elif heldout:  # the law as it is written: what it is wrong by was learned from these shots
        held = heldout_or_none(problem, fitted)
    shots = collect(own, found, scale=scale)
    return FitResult(name, outcome_of(own, found), own, found, shots, scale, held)
