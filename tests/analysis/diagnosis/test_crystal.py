"""From a rigid cell, the base with a cell that rings is found that the rig obeys."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.diagnosis.procedure import diagnose_campaign

from .conftest import small_campaign


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
def test_the_base_that_a_rig_obeys_is_found_from_hsd(tmp_path: Path, rig: str, base: str) -> None:
    """Nothing but the crystal is named, and the model that stands is the rig's own."""
    found = diagnose_campaign(small_campaign(tmp_path, rig=rig), "hsd")
    assert (found.verdict, found.effect_ids) == ("identified", ["crystal_dynamics"])
    assert found.steps[-1].problem.model.base == base
