"""What follows from the paper's tables alone."""

from __future__ import annotations

import pytest

from impactd.paper import source


def test_the_tables_have_the_papers_pairs() -> None:
    """Table 4 has 14 readable pairs, Table 5 has 19, and every one of Table 4 is in Table 5."""
    four, five = source.rows("table4_hsd"), source.rows("table5_kv")
    assert (len(four), len(five)) == (14, 19)
    assert set(four) <= set(five)
    assert five["acetal", "polycarbonate"] == source.PaperPair(2.35e9, 0.04e9, 3.25e9, 0.04e9)


def test_ptfe_as_a_surface_is_table_1s() -> None:
    """Table 2 lacks the row that Tables 4-5 use."""
    assert source.literature("surface", "ptfe") == source.literature("sphere", "ptfe")


def test_kv_is_nearer_to_the_literature() -> None:
    """Mean |ln(E / literature)| over the same pairs: 0.29 for HSD, 0.22 for KV (paper: nearer)."""
    pairs = set(source.rows("table4_hsd"))
    assert source.distance_from_literature("table4_hsd", pairs) == pytest.approx(0.294, abs=1e-3)
    assert source.distance_from_literature("table5_kv", pairs) == pytest.approx(0.215, abs=1e-3)


def test_hsd_over_kv_in_the_paper() -> None:
    """HSD's E* is 0.96 to 1.96 of KV's, by pair."""
    hsd, kv = source.over_literature("table4_hsd"), source.over_literature("table5_kv")
    ratios = [hsd[pair] / kv[pair] for pair in hsd]
    assert min(ratios) == pytest.approx(0.96, abs=0.01)
    assert max(ratios) == pytest.approx(1.96, abs=0.01)


def test_a_materials_modulus_depends_on_its_partner_in_the_paper() -> None:
    """Table 5's polycarbonate differs by 25 % between pairs where the rows state 2.3 %."""
    found = source.spread_of_materials("table5_kv")["surface polycarbonate"]
    assert found["relative_std_between_pairs"] == pytest.approx(0.2525, abs=1e-3)
    assert found["median_relative_std_stated"] == pytest.approx(0.0233, abs=1e-3)
    for row in source.spread_of_materials("table5_kv").values():
        assert row["relative_std_between_pairs"] > row["median_relative_std_stated"]
