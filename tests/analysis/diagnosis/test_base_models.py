"""Which base model a diagnosis starts from, and goes on with."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.diagnosing import diagnose
from analysis.diagnosis.procedure import diagnose_campaign

from .conftest import campaign_with, small_campaign


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
def test_the_base_that_a_rig_obeys_is_found_from_hsd(tmp_path: Path, rig: str, base: str) -> None:
    """Nothing but the crystal is named, and the model that stands is the rig's own."""
    found = diagnose_campaign(small_campaign(tmp_path, rig=rig), "hsd")
    assert (found.verdict, found.effect_ids) == ("identified", ["crystal_dynamics"])
    assert found.steps[-1].problem.model.base == base


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
def test_without_a_base_the_one_is_taken_that_a_rig_obeys(
    tmp_path: Path, rig: str, base: str
) -> None:
    """A clean rig is adequate under its own base, which is named where it is not the default."""
    document = diagnose(small_campaign(tmp_path, rig=rig))
    assert (document["verdict"], document["before"]["model"]) == ("adequate", base)
    assert ("obey kv rather than" in document["sentence"]) == (base == "kv")


@pytest.mark.parametrize(
    ("seed", "base"),
    [(12, "kv2-coupon-force_end"), (42, "kv2-reaction"), (76, "kv2-reaction-force_end")],
)
def test_the_laws_that_a_drawn_rig_leaves_out_are_found(
    tmp_path: Path, seed: int, base: str
) -> None:
    """A clean rig is adequate under a base between the paper's and the closed one, and says so."""
    document = diagnose(campaign_with(tmp_path, (), "drawn", seed))
    assert (document["verdict"], document["before"]["model"]) == ("adequate", base)
    assert f"obey {base} rather than" in document["sentence"]
