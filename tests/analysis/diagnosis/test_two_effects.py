"""Two effects at once: each name has stood against others beside the other one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.candidate import extended
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.below_one import fitted_below_one
from analysis.fit.settle import settle
from analysis.model.impact_model import NUISANCE
from drivers.simulated.effects import make_effect

from .conftest import campaign_with


@pytest.mark.slow
def test_a_name_found_beside_nothing_is_held_against_others_beside_the_rest(tmp_path: Path) -> None:
    """A low-pass looks like an echo until the bent scale beside it is known."""
    effects = (
        make_effect("amplifier_lowpass", {"cutoff_hz": 72.5e3, "filter_order": 1.0}),
        make_effect("sensor_nonlinearity", {"curvature_per_v": -1.3e-3}),
    )
    found = diagnose_campaign(campaign_with(tmp_path, effects))
    assert found.verdict in ("identified", "family")
    named = {c.effect_id for c in found.chosen}
    assert "sensor_nonlinearity" in named
    assert "amplifier_lowpass" in named | {r.effect_id for r in found.rivals.get("echo", [])}
    assert len(found.steps) == len(found.chosen) + 1


@pytest.mark.slow
def test_hum_beside_a_large_effect_does_not_pass_for_what_its_form_leaves(tmp_path):
    """A second touch is forgiven a little structure; hum is no part of that."""
    effects = (
        make_effect("recontact", {"delay_s": 4.3e-4, "speed_ratio": 0.24}),
        make_effect("mains_hum", {"amplitude_v": 3e-3, "frequency_hz": 50.0, "harmonics": 3.0}),
    )
    found = diagnose_campaign(campaign_with(tmp_path, effects))
    assert {r.effect_id for r in found.chosen} == {"recontact", "mains_hum"}
    assert found.verdict in ("identified", "family")


def test_a_ceiling_below_every_pulse_is_a_fit_that_leads_nowhere(clean):
    """A record that is all ceiling says nothing of its touch-down: an outcome, not an error."""
    first = clean.steps[0]
    low = {"clipping.ceiling_v": effect_named("clipping").parameters[0].coordinate(1e-9)}
    problem, theta, nuisances = extended(first.problem, first.fitted, effect_named("clipping"), low)
    for steps in (0, 3):
        found = joint.fit(problem, nuisances, theta=theta, max_iterations=steps)
        assert found.failed
    kept = settle(problem, theta, nuisances)
    np.testing.assert_array_equal(kept, nuisances)


@pytest.mark.parametrize("steps", [0, 3])
def test_a_touch_down_beyond_the_record_stays_and_the_others_are_fitted(clean, steps):
    """Neither its speed nor its loss leaves a trace there; its squares count, so no search wins."""
    first = clean.steps[0]
    away = first.fitted.nuisances.copy()
    away[2, NUISANCE.index("t0_us")] += 1e4
    found = joint.fit(first.problem, away, theta=first.fitted.theta, max_iterations=steps)
    assert not found.failed
    assert found.nuisances[2, NUISANCE.index("t0_us")] == away[2, NUISANCE.index("t0_us")]
    assert found.cost > 10.0 * first.fitted.cost


def test_a_shot_that_gains_energy_begins_again_and_finds_its_loss(clean):
    """Whatever a fit was bent by, no sphere leaves faster than it came."""
    first = clean.steps[0]
    loss = first.problem.model.nuisances.index("ln_e")
    bent = first.fitted.nuisances.copy()
    bent[::2, loss] = 0.2
    cost = joint.total_cost(first.problem, first.fitted.theta, bent)
    lost = dataclasses.replace(first.fitted, nuisances=bent, cost=cost)
    found = fitted_below_one(first.problem, lost, joint.fit)
    assert np.all(found.nuisances[:, loss] < 0.0)
    assert abs(found.cost - first.fitted.cost) < 0.1
    assert fitted_below_one(first.problem, first.fitted, joint.fit) is first.fitted
