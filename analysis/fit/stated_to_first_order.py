"""Masses, radii and heights that may be off as stated, to first order, while models are compared.

Each becomes an input that adds its derivative to every shot's record. The derivatives are taken
once, at the base model's best: the errors are small, and an effect changes them little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.aliases import Array
from analysis.campaign import Uncertainty
from analysis.fit.blocks import input_slopes, prior_rows
from analysis.fit.first_order_input import FirstOrderInput
from analysis.fit.fit_shot import FitShot
from analysis.fit.freed_inputs import numbers_of_shots, widened_by
from analysis.fit.inputs import STATED
from analysis.fit.joint import LEAST_DAMPING, Fitted, fit, fit_to_compare, promised_gain
from analysis.fit.problem import JointProblem


def with_stated_numbers(problem: JointProblem, fitted: Fitted) -> tuple[JointProblem, Array] | None:
    """Return a problem in which masses and the like may be off to first order, and its start.

    ``fitted`` is a model at its best with every stated number as stated. None if every number is
    exact, or if a derivative cannot be taken.
    """
    known = numbers_of_shots(problem)
    if not known or problem.inputs or fitted.failed:
        return None
    wide = widened_by(problem, known, problem.prior_precision)
    theta = np.concatenate([fitted.theta, [one.stated for one in known]])
    added: dict[str, dict[float, Array]] = {one.name: {} for one in known}
    faster: dict[str, dict[float, float]] = {one.name: {} for one in known}
    for item, nuisance in zip(wide.shots, fitted.nuisances, strict=True):
        slopes = _slopes(wide, item, theta, nuisance)
        if slopes is None:
            return None
        for (_, one), signal, speed in zip(wide.inputs_of(item), *slopes, strict=True):
            added[one.name][item.frame.place] = signal
            faster[one.name][item.frame.place] = speed
    inputs = [
        FirstOrderInput(
            STATED,
            one.kind if one.owner is None else f"{one.kind}.{one.owner}",
            0.0,
            "1",
            Uncertainty(one.u),
            one.path,
            {},
            added[one.name],
            faster[one.name],
        )
        for one in known
    ]
    start = np.concatenate([fitted.theta, np.zeros(len(inputs))])
    return widened_by(problem, tuple(inputs), problem.prior_precision), start


def fitted_with_stated_numbers(
    problem: JointProblem, fitted: Fitted, *, needless: Callable[[float], bool] | None = None
) -> tuple[JointProblem, Fitted] | None:
    """Return a fit in which masses, heights and the like may be off to first order; or None.

    Also None if ``needless``, asked about twice the squares that it promises, says that these
    change nothing.
    """
    wide = with_stated_numbers(problem, fitted)
    if wide is None:
        return None
    begin = fit(wide[0], fitted.nuisances, theta=wide[1], max_iterations=0)
    if begin.failed:
        return None
    if needless is not None and needless(2.0 * promised_gain(wide[0], begin.blocks, begin.theta)):
        return None
    found = fit_to_compare(
        wide[0], fitted.nuisances, theta=wide[1], damping=LEAST_DAMPING, blocks=begin.blocks
    )
    return None if found.failed else (wide[0], found)


def _slopes(
    problem: JointProblem, item: FitShot, theta: Array, nuisance: Array
) -> tuple[Array, list[float]] | None:
    """Return what a shot's inputs add to its record and to its promised ln v0, per coordinate."""
    model = problem.model
    shared, chain = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisance])
    found, jacobian, gradient = model.linearise(local, item.frame)
    residuals, _ = prior_rows(model, item, local, found.rebound_ratio, gradient)
    places = [j for j, _ in problem.inputs_of(item)]
    signal = np.zeros((len(places), item.frame.samples))
    held = input_slopes(
        problem, (item, item), local, (found, jacobian, gradient), residuals, signal=signal
    )
    if held is None:
        return None
    signal += chain[:, places].T @ jacobian[:, : shared.size].T
    u = 0.0 if item.speed_prior is None else item.speed_prior.u
    return signal, (-u * held[0]).tolist()


def as_stated(problem: JointProblem, theta: Array) -> tuple[JointProblem, Array]:
    """Return a problem whose stated numbers are exact, and where to start it."""
    mine = {one.name for one in problem.inputs}
    kept = [j for j, name in enumerate(problem.names) if name not in mine]
    exact = replace(
        problem,
        names=[problem.names[j] for j in kept],
        start=theta[kept],
        prior_mean=problem.prior_mean[kept],
        prior_precision=problem.prior_precision[np.ix_(kept, kept)],
        inputs=(),
    )
    return exact, theta[kept]
