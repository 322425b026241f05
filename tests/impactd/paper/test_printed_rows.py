"""Rows of Tables 4 and 5 beside what the same model reads of the materials of Tables 1-2."""

from __future__ import annotations

import pytest

from impactd.paper.claim import FAILS, HOLDS
from impactd.paper.printed_rows import (
    ROW_HEADINGS,
    PrintedRow,
    literature_range,
    printed_rows,
    row_texts,
)
from impactd.paper.rigs import WAYS, PairFigures, RigFigures
from impactd.paper.source import rows


@pytest.fixture(scope="module")
def found() -> dict[tuple[str, tuple[str, str]], PrintedRow]:
    """Return the rows beside rigs that every way of fitting reads truly, to 0.5 %."""
    pairs = {pair: PairFigures({way: [0.995, 1.005] for way in WAYS}) for pair in rows("table5_kv")}
    return {(row.table, row.pair): row for row in printed_rows(RigFigures(pairs=pairs))}


def test_every_readable_row_is_there(found: dict[tuple[str, tuple[str, str]], PrintedRow]) -> None:
    """14 of Table 4 and 19 of Table 5, each with its four numbers as printed."""
    tables = [table for table, _ in found]
    assert (tables.count("table4_hsd"), tables.count("table5_kv")) == (14, 19)
    for (table, pair), row in found.items():
        assert row.printed == rows(table)[pair]


def test_a_row_holds_where_the_ranges_meet(
    found: dict[tuple[str, tuple[str, str]], PrintedRow],
) -> None:
    """Acetal on PVC by KV meets Tables 1-2; polypropylene on aluminium is far below them."""
    assert found["table5_kv", ("acetal", "pvc")].verdict == HOLDS
    low = found["table5_kv", ("polypropylene", "aluminium")]
    assert low.verdict == FAILS
    assert low.printed_range_pa[1] < 0.7 * low.ours_range_pa[0]
    assert " below, " in low.remark
    for row in found.values():
        meet = (
            row.printed_range_pa[0] <= row.ours_range_pa[1]
            and row.ours_range_pa[0] <= row.printed_range_pa[1]
        )
        assert (row.verdict == HOLDS) is meet
        assert row.printed_range_pa[0] <= row.printed_pa <= row.printed_range_pa[1]


def test_a_row_that_does_not_hold_says_why(
    found: dict[tuple[str, tuple[str, str]], PrintedRow],
) -> None:
    """Each has a reason; HSD's looks at KV's row of the pair, KV's at a closed rig."""
    failing = [row for row in found.values() if row.verdict == FAILS]
    assert all(row.remark for row in failing)
    assert "and so is KV's row" in found["table4_hsd", ("acetal", "ptfe")].remark
    assert "closed rig, too little" in found["table5_kv", ("acetal", "ptfe")].remark
    assert "closed rig, which would do" in found["table5_kv", ("ptfe", "ptfe")].remark


def test_a_fit_that_stayed_at_its_start_is_named(
    found: dict[tuple[str, tuple[str, str]], PrintedRow],
) -> None:
    """Standard deviations of 0.00 for both moduli are remarked on, whatever the verdict."""
    assert "did not leave its start" in found["table4_hsd", ("steel", "aluminium")].remark


def test_a_single_number_of_the_tables_is_a_batch_wide() -> None:
    """Ranges of Tables 1-2 stand as printed, single numbers two standard deviations wide."""
    assert literature_range("surface", "pvc") == (2.5e9, 4.0e9)
    assert literature_range("sphere", "ptfe") == pytest.approx((0.48e9, 0.52e9))


def test_the_rows_as_text(found: dict[tuple[str, tuple[str, str]], PrintedRow]) -> None:
    """The table prints the paper's numbers with its digits."""
    texts = row_texts(list(found.values()), "table5_kv")
    assert len(texts) == 19
    assert all(len(row) == len(ROW_HEADINGS) for row in texts)
    assert texts[3][:5] == ["acetal / pvc", "2.60 ± 0.04", "2.5-4", "3.16 ± 0.05", "3-3.3"]
