"""Whose an effect's size is, and what a size costs: the rig's, one material's, each shot's own."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from analysis.diagnosis.candidate import price_of_scatter
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.procedure import diagnose_campaign

from .conftest import small_campaign


@pytest.mark.slow
def test_a_mode_hit_elsewhere_each_time_belongs_to_the_shots(tmp_path: Path) -> None:
    """A coupon's mode whose size scatters is named, with a size for every shot."""
    campaign = small_campaign(
        tmp_path,
        "coupon_mode",
        frequency_hz=9e3,
        damping_ratio=0.02,
        mass_ratio=0.02,
        hit_scatter=0.4,
    )
    found = diagnose_campaign(campaign)
    assert found.verdict == "identified"
    assert [c.effect_id for c in found.chosen] == ["coupon_mode"]
    assert found.chosen[0].scope == "shot"
    frequency = dict(zip(found.chosen[0].problem.names, found.chosen[0].fitted.theta, strict=True))
    assert math.exp(frequency["coupon_mode.frequency_hz"]) == pytest.approx(9e3, rel=0.02)


def test_sizes_of_one_scatter_cost_what_they_could_have_been() -> None:
    """Their linearisation falls with the logarithm of what they take up."""
    width = CRITERIA.price_of_number
    assert price_of_scatter(0, 500.0) == 0.0
    assert price_of_scatter(50, 500.0) == pytest.approx(width + 50 * (1 + math.log(10.0)))
    # chance alone takes up one square a number, and must not pay
    assert 54.0 - price_of_scatter(54, 54.0) < 0.0
