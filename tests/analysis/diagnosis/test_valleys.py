"""A fit that ended in a valley beside the deepest one begins again in the others."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis.diagnosis.basis.proposals import proposals
from analysis.diagnosis.candidate import Refit, extended
from analysis.diagnosis.forms import best_form
from analysis.diagnosis.multistart import where_it_rings
from analysis.diagnosis.selection import Step
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.settle import settle
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

from .conftest import small_campaign

DELAY_S, SPEED_RATIO = 5.2e-4, 0.0137


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_slow_second_touch_is_found_from_another_of_its_hops(tmp_path, times):
    """The speed of a sphere that hops on says when it is back, and that repeats."""
    effect = effect_named("recontact")
    values = {"delay_s": DELAY_S, "speed_ratio": SPEED_RATIO}
    campaign = small_campaign(tmp_path, "recontact", rig="paper", **values)
    problem, nuisances = with_start(build(campaign, model_named("kv")))
    base = joint.fit(problem, nuisances)
    begin = {
        "recontact.speed_ratio": math.log(times * SPEED_RATIO),
        "recontact.delay_s": math.log(DELAY_S),
    }
    larger, theta, nuisances = extended(problem, base, effect, begin)
    astray = joint.fit(larger, settle(larger, theta, nuisances), theta=theta)
    gain = base.cost - astray.cost
    found = Refit(effect, "recontact", "rig", larger, astray, gain, 2, False, gain)
    best = best_form(problem, base, found)
    at = next(j for j, n in enumerate(best.problem.names) if n.endswith("speed_ratio"))
    assert math.exp(best.fitted.theta[at]) == pytest.approx(SPEED_RATIO, rel=0.02)
    assert best.fitted.cost < astray.cost - 100.0
    assert not Step(best.problem, best.fitted).score_test.structured


@pytest.mark.parametrize(("frequency_hz", "damping_ratio"), [(25.1e3, 0.011), (41e3, 0.02)])
def test_a_sharp_resonance_begins_where_the_residual_rings(tmp_path, frequency_hz, damping_ratio):
    """Its valley lies between two of the usual frequencies, 12 % apart."""
    problem, nuisances = with_start(build(small_campaign(tmp_path), model_named("kv2")))
    base = joint.fit(problem, nuisances)
    shots = []
    for item in problem.shots:
        t = (
            np.arange(item.window.signal.size) - item.window.rise_index
        ) / item.frame.sample_rate_hz
        omega = 2.0 * math.pi * frequency_hz
        ring = np.where(t > 0.0, np.exp(-damping_ratio * omega * t) * np.sin(omega * t), 0.0)
        signal = item.window.signal + 0.01 * item.window.peak * ring
        window = dataclasses.replace(item.window, signal=signal)
        shots.append(dataclasses.replace(item, window=window))
    modes = [p for p in proposals(problem)[0] if p.effect_id == "second_mode"]
    (found,) = where_it_rings(dataclasses.replace(problem, shots=shots), base, modes)
    told = {
        one.name: one.value(at)
        for one, at in zip(found.effect.parameters, found.coordinates, strict=True)
    }
    assert told["frequency_hz"] == pytest.approx(frequency_hz, rel=0.03)
    assert told["damping_ratio"] == pytest.approx(damping_ratio, rel=0.5)
