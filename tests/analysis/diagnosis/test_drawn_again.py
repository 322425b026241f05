"""Draws of blind trials that were missed or named wrong once, and why they no longer are."""

from __future__ import annotations

import pytest

from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from drivers.simulated.campaign import simulate_campaign
from impactd.bench.blind.plan import draw_plan
from impactd.bench.simulated_campaign import BASES, through_a_folder


def _diagnosed(seed: int) -> Diagnosis:
    """Return what the loop says of one draw of the library."""
    plan = draw_plan("library", seed, rig="paper")  # as they were drawn
    simulated = simulate_campaign(plan.settings, plan.campaign_seed)
    return diagnose_campaign(through_a_folder(simulated), BASES[plan.settings.rig])


@pytest.mark.slow
def test_a_stiff_layer_is_tried_although_a_mode_takes_up_nearly_all() -> None:
    """A mode on each coupon brings back the prior's price as well, and leaves twice the noise."""
    found = _diagnosed(9_000_086)
    assert found.verdict == "identified"
    assert [r.effect.id for r in found.chosen] == ["adhesive_layer"]


@pytest.mark.slow
def test_a_faint_relaxation_is_not_called_a_second_mode_alone() -> None:
    """Of 430 squares a mode takes up 387, and the right fit 350 after all its steps, and rising."""
    found = _diagnosed(10_000_019)
    assert found.verdict == "family"
    assert "stress_relaxation" in {*found.effect_ids, *found.confusable}
