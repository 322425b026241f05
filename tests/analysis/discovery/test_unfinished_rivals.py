"""A rival whose fit creeps along a valley is not out of the race."""

from __future__ import annotations

import pytest

from analysis.discovery.diagnosis import diagnose_campaign
from drivers.simulated.campaign import simulate_campaign
from impactd.bench.blind.plan import draw_plan
from impactd.bench.simulated_campaign import through_a_folder


@pytest.mark.slow
def test_a_faint_relaxation_is_not_called_a_second_mode_alone() -> None:
    """Of 430 squares a mode takes up 387, and the right fit 350 after all its steps, and rising."""
    plan = draw_plan("library", 10_000_019)
    campaign = through_a_folder(simulate_campaign(plan.settings, plan.campaign_seed))
    found = diagnose_campaign(campaign)
    assert found.verdict == "family"
    assert "stress_relaxation" in found.confusable
