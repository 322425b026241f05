"""Whatever a verdict can point at has words."""

from __future__ import annotations

import pytest

from analysis.discovery.closure_choice import ALSO, FORCES, LAST, LEARNABLE, PECULIAR, REFINED
from analysis.discovery.family_words import FAMILIES
from analysis.discovery.omnibus import ASKED
from analysis.discovery.slot_physics import PECULIAR_SHARES, SHARES, peculiar_odds
from analysis.discovery.slots import BANK

LEARNED = {
    *(ALSO.get(family, family) for family, _ in (*LEARNABLE, *PECULIAR, *LAST)),
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


def test_every_peculiar_closure_says_where_it_lives():
    """And leaves no slot out for certain."""
    assert {family for family, _ in PECULIAR} == set(PECULIAR_SHARES)
    for family in PECULIAR_SHARES:
        odds = peculiar_odds(family)
        assert odds.sum() == pytest.approx(1.0)
        assert odds.min() > 0.0
    assert peculiar_odds("response") is None
