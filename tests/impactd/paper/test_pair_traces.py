"""Traces of the paper's pairs: the simulator's records, and each model's reading of them."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.paper.contact import TABLE3_CELL
from impactd.paper.pair_traces import (
    FIGURE_PAIRS,
    TIMES_S,
    PairTraces,
    all_pair_traces,
    drop_for,
    hsd_model,
    kv_model,
    printed_trace,
    record,
)
from impactd.paper.source import literature_reduced, rows
from impactd.paper.trace_page import CLOSED_HEADINGS, closed_model, closed_rows

PAIR = ("polypropylene", "ptfe")


@pytest.fixture(scope="module")
def traces() -> dict[tuple[str, str], PairTraces]:
    """Return every pair of Table 5."""
    return all_pair_traces()


@pytest.mark.parametrize("coupon_kg", [None, 0.0065])
def test_the_simulators_record_is_the_models_trace(coupon_kg: float | None) -> None:
    """Two integrators, one set of equations: kv and kv2 agree with the simulator to 1e-6."""
    model = kv_model(TABLE3_CELL, coupon_kg)(drop_for(PAIR, literature_reduced(PAIR)), TIMES_S)
    found = record(PAIR, coupon_kg=coupon_kg)
    assert np.abs(found - model).max() < 1e-6 * found.max()


def test_each_model_reads_its_own_rig_truly(traces: dict[tuple[str, str], PairTraces]) -> None:
    """KV finds E* of the paper's rig and kv2 that of a closed one, to 1e-3, for every pair."""
    assert len(traces) == 19
    for one in traces.values():
        assert one.kv.modulus_ratio == pytest.approx(1.0, abs=1e-3), one.pair
        assert one.kv2.modulus_ratio == pytest.approx(1.0, abs=1e-3), one.pair
        assert min(one.kv.r2, one.kv2.r2) > 1 - 1e-8


def test_hsd_errs_with_the_crystal(traces: dict[tuple[str, str], PairTraces]) -> None:
    """HSD reads 1.4-1.8 times E* of short contacts of polymers, less than E* of the longest."""
    for pair in FIGURE_PAIRS["figure-6"][:3]:
        assert 1.4 < traces[pair].hsd.modulus_ratio < 1.8
    assert traces["ptfe", "ptfe"].hsd.modulus_ratio == pytest.approx(0.75, abs=0.01)


def test_kv_on_a_closed_rig(traces: dict[tuple[str, str], PairTraces]) -> None:
    """With the coupon in M: within 2 % where touch-down may move, 8-23 % high where not."""
    for one in traces.values():
        assert one.loaded.modulus_ratio == pytest.approx(1.0, abs=0.02), one.pair
        assert 1.07 < one.loaded_onset.modulus_ratio < 1.24, one.pair
        assert one.bare.r2 < one.loaded.r2 or "ptfe" in one.pair, one.pair
        low, high = one.closed_readings
        assert low <= one.loaded.modulus_ratio <= high


def test_the_printed_rows_make_traces() -> None:
    """A row of Table 4 gives HSD's pulse, the same row of Table 5 a pulse with a ring."""
    hsd, kv = (printed_trace(PAIR, table) for table in ("table4_hsd", "table5_kv"))
    late = TIMES_S > 200e-6
    assert hsd[late].max() == 0.0
    assert kv[late].max() > 0.02 * kv.max()
    literature = hsd_model(drop_for(PAIR, literature_reduced(PAIR)), TIMES_S)
    assert hsd.max() > literature.max()


def test_the_figures_pairs_are_in_both_tables() -> None:
    """Eight pairs, from stiff coupons to soft ones, each a row of Tables 4 and 5."""
    pairs = [pair for one in FIGURE_PAIRS.values() for pair in one]
    assert len(pairs) == 8
    assert set(pairs) <= set(rows("table4_hsd"))
    for column in FIGURE_PAIRS.values():
        moduli = [literature_reduced(pair) for pair in column]
        assert moduli == sorted(moduli, reverse=True)


def test_the_closed_model_has_a_row_per_pair() -> None:
    """Coupon, ring and moduli stand in the table as in the JSON."""
    found = closed_model()
    texts = closed_rows(found)
    assert len(found) == len(texts) == 19
    assert all(len(row) == len(CLOSED_HEADINGS) for row in texts)
    steel = found[0]
    assert (steel["sphere"], steel["surface"]) == ("steel", "aluminium")
    assert steel["natural_frequency_Hz"] == pytest.approx(15564.0, abs=1.0)
