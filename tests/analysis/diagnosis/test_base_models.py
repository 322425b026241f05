"""Which base model a diagnosis starts from, and goes on with."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.diagnosing import diagnose
from analysis.diagnosis.procedure import diagnose_campaign

from .conftest import small_campaign


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
