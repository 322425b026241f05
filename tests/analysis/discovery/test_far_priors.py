"""What a fit gone astray pays for contradicting what is known is not explained by anything."""

from __future__ import annotations

import pytest

from analysis.discovery.diagnosis import diagnose_campaign
from drivers.simulated.campaign import simulate_campaign
from impactd.bench.blind.plan import draw_plan
from impactd.bench.simulated_campaign import through_a_folder


@pytest.mark.slow
def test_a_stiff_layer_is_tried_although_a_mode_takes_up_nearly_all() -> None:
    """A mode on each coupon brings back the prior's price as well, and leaves twice the noise."""
    plan = draw_plan("library", 9_000_086)
    campaign = through_a_folder(simulate_campaign(plan.settings, plan.campaign_seed))
    found = diagnose_campaign(campaign)
    assert found.verdict == "identified"
    assert [r.effect.id for r in found.chosen] == ["adhesive_layer"]
