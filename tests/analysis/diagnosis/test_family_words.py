"""Whatever a verdict can point at has words."""

from __future__ import annotations

import pytest

from analysis.diagnosis.discrepancy.choice import (
    ALSO,
    BEYOND_FIRST_ORDER,
    FORCES,
    LAST,
    LEARNABLE,
    REFINED,
)
from analysis.diagnosis.document.family_words import FAMILIES
from analysis.diagnosis.score_test import ASKED
from analysis.diagnosis.slots import BANK, SHARES

LEARNED = {
    *(ALSO.get(family, family) for family, _ in (*LEARNABLE, *BEYOND_FIRST_ORDER, *LAST)),
    *(finer for forms in REFINED.values() for finer in forms),
    *(f"force_{form}" for form in FORCES),
}


@pytest.mark.parametrize("family", sorted(LEARNED | {family for family, _ in ASKED}))
def test_every_family_that_is_asked_or_learned_has_words(family):
    """In the verdict, the report and the list of slots."""
    assert FAMILIES[family] != family


@pytest.mark.parametrize("family", sorted({family for family, _ in BANK} - {"locked", "static"}))
def test_every_family_that_decides_on_a_slot_has_one(family):
    """Those that say nothing about where are left out by name."""
    assert max(SHARES.get(family, (0.0,))) > 0.0
