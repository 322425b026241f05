"""The sizes a campaign's columns are measured in, and what is looked for along its residuals."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from analysis.diagnosis.basis.contact_force import crystal_of
from analysis.diagnosis.basis.dynamic_curve import SLEW, steepest
from analysis.diagnosis.basis.event import LATE_IMPACT, late_impact_width
from analysis.diagnosis.basis.families import BASELINE, TOUCH_DOWN, hertz_time_s, sample_at
from analysis.diagnosis.basis.oscillation import DAMPED, TUNED, best_damped, best_frequency
from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.static_curve import RIPPLE, best_ripple
from analysis.fit.joint import Fitted
from analysis.fit.problem import JointProblem

TUNED_BY = 3
"""Every so manieth shot is asked for a frequency, or a width."""


def scale_of(problem: JointProblem, fitted: Fitted) -> Scale:
    """Return the sizes that the generic columns of a fitted campaign are measured in."""
    depths, speeds, contacts = [], [], []
    for item, nuisance in zip(problem.shots, fitted.nuisances, strict=True):
        shared, _ = problem.shared_local(item, fitted.theta)
        speed = math.exp(nuisance[0])
        depths.append((1.25 * item.frame.mass_kg * speed**2 / math.exp(shared[0])) ** 0.4)
        speeds.append(speed)
        contacts.append(hertz_time_s(item, np.array([*shared, *nuisance]), len(shared)))
    return Scale(
        top=max(s.window.peak for s in problem.shots),
        indentation_m=float(np.median(depths)),
        speed_m_per_s=float(np.median(speeds)),
        pulse_s=float(np.median([s.window.width_s for s in problem.shots])),
        contact_s=float(np.median(contacts)),
        window_s=max(s.frame.samples / s.frame.sample_rate_hz for s in problem.shots),
    )


def tuned(problem: JointProblem, fitted: Fitted, scale: Scale, wanted: Sequence[str]) -> Scale:
    """Return the scale with what some families need that is looked for in the records.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        The present model, along whose residual they are looked for.
    scale : Scale
        From `scale_of`.
    wanted : sequence of str
        Families.

    Returns
    -------
    Scale
        What it already has is kept.
    """
    if SLEW in wanted and not scale.steepest_per_s:
        records = [s.window.signal for s in problem.shots]
        rates = [s.frame.sample_rate_hz for s in problem.shots]
        scale = dataclasses.replace(scale, steepest_per_s=steepest(records, rates))
    families = [f for f in wanted if f in (*TUNED, DAMPED) and f not in scale.tuned_hz]
    ripple = RIPPLE in wanted and not scale.ripples
    late_impact = LATE_IMPACT in wanted and not scale.late_impact_us
    if not families and not ripple and not late_impact:
        return scale
    signals, residuals, rates, crystals, firsts = [], [], [], [], []
    for item, nuisance in list(zip(problem.shots, fitted.nuisances, strict=True))[::TUNED_BY]:
        shared, _ = problem.shared_local(item, fitted.theta)
        local = np.concatenate([shared, nuisance])
        found = problem.model.predict(local, item.frame)
        rate = item.frame.sample_rate_hz
        signals.append(found.signal - nuisance[BASELINE])
        residuals.append(item.window.signal - found.signal)
        rates.append(rate)
        crystals.append(crystal_of(problem.model, local))
        lifted_us = nuisance[TOUCH_DOWN] + 1e6 * hertz_time_s(item, local, shared.size)
        firsts.append(sample_at(lifted_us, rate, found.signal.size))
    best = {f: best_frequency(f, signals, residuals, rates) for f in families if f != DAMPED}
    zeta = scale.tuned_zeta
    if DAMPED in families:
        best[DAMPED], zeta = best_damped(signals, residuals, rates)
    ripples = best_ripple(signals, residuals, scale.top) if ripple else scale.ripples
    width = (
        late_impact_width(residuals, firsts, rates, crystals)
        if late_impact
        else scale.late_impact_us
    )
    return dataclasses.replace(
        scale,
        tuned_hz=scale.tuned_hz | best,
        tuned_zeta=zeta,
        ripples=ripples,
        late_impact_us=width,
    )
