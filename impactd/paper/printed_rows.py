"""Tables 4 and 5 as printed, row by row: could such rows come from the materials of Tables 1-2?"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from impactd.paper.claim import FAILS, HOLDS
from impactd.paper.pair_traces import PairTraces, all_pair_traces
from impactd.paper.rigs import Pair, PairFigures, RigFigures
from impactd.paper.source import PaperPair, reduced, rows, tables

Interval = tuple[float, float]

TABLES = {"table4_hsd": "HSD", "table5_kv": "KV"}
WAYS_OF = {"table4_hsd": ("hsd_onset", "hsd_aligned"), "table5_kv": ("kv_aligned",)}
"""How we fit as the paper may have: it does not say how it laid HSD's curves over its records."""
BATCH = 0.02
"""Relative standard deviation of a modulus that Tables 1-2 print as one number: that of
``config/materials.toml``, which says why."""
_HEADINGS = ("sphere / surface", "E surface", "(Tables 1-2)", "E sphere", "(Tables 1-2)")
ROW_HEADINGS = (*_HEADINGS, "E*, printed", "E*, ours", "", "remark")


@dataclass(frozen=True)
class PrintedRow:
    """One row of Table 4 or 5 beside what the same model reads on the simulated rigs.

    Attributes
    ----------
    table : str
        ``table4_hsd`` or ``table5_kv``.
    printed : PaperPair
        The four numbers of the row.
    surface_range_pa, sphere_range_pa : tuple of float
        Young's moduli of Tables 1-2. [Pa]
    printed_pa, printed_range_pa : float, tuple of float
        E* of the row, and with both moduli two of their standard deviations lower and higher. [Pa]
    ours_range_pa : tuple of float
        E* of Tables 1-2 as the model reads it on the rigs: from the lowest material and reading to
        the highest, two standard deviations further. [Pa]
    verdict, remark : str
        Whether the two ranges overlap, and why not.
    """

    table: str
    pair: Pair
    printed: PaperPair
    surface_range_pa: Interval
    sphere_range_pa: Interval
    printed_pa: float
    printed_range_pa: Interval
    ours_range_pa: Interval
    verdict: str
    remark: str

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return asdict(self)


def printed_rows(rigs: RigFigures) -> list[PrintedRow]:
    """Return every readable row of Tables 4 and 5."""
    traces = all_pair_traces()
    return [
        _row(table, pair, printed, rigs.pairs[pair], traces[pair])
        for table in TABLES
        for pair, printed in rows(table).items()
    ]


def literature_range(side: str, name: str) -> Interval:
    """Return the lowest and highest Young's modulus that Tables 1-2 allow for a material. [Pa]"""
    low, high = tables()[side][name]["youngs_modulus_Pa"]
    if low == high:
        low, high = low * (1 - 2 * BATCH), high * (1 + 2 * BATCH)
    return low, high


def _row(
    table: str, pair: Pair, printed: PaperPair, figures: PairFigures, traces: PairTraces
) -> PrintedRow:
    stated, ours = _ranges(table, pair, figures)
    off = _off(stated, ours)
    remark = ""
    if printed.sphere_std_pa == printed.surface_std_pa == 0.0:
        remark = "both standard deviations are 0.00: the fit did not leave its start"
    elif off and table == "table4_hsd":
        off_kv = _off(*_ranges("table5_kv", pair, figures))
        remark = f"{_words(off)}, {_cell_or_material(off, off_kv)}"
    elif off:
        remark = f"{_words(off)}, {_closed_rig(stated, ours, traces)}"
    return PrintedRow(
        table=table,
        pair=pair,
        printed=printed,
        surface_range_pa=literature_range("surface", pair[1]),
        sphere_range_pa=literature_range("sphere", pair[0]),
        printed_pa=reduced(pair, printed.sphere_pa, printed.surface_pa),
        printed_range_pa=stated,
        ours_range_pa=ours,
        verdict=FAILS if off else HOLDS,
        remark=remark,
    )


def _ranges(table: str, pair: Pair, figures: PairFigures) -> tuple[Interval, Interval]:
    """Return the row's range of E*, and ours. [Pa]"""
    printed = rows(table)[pair]
    stated = _both(
        pair,
        [printed.sphere_pa + sign * 2 * printed.sphere_std_pa for sign in (-1, 1)],
        [printed.surface_pa + sign * 2 * printed.surface_std_pa for sign in (-1, 1)],
    )
    low, high = _reading(figures.ratio, WAYS_OF[table])
    material = _both(
        pair, literature_range("sphere", pair[0]), literature_range("surface", pair[1])
    )
    return stated, (material[0] * low, material[1] * high)


def _both(pair: Pair, sphere_pa: Sequence[float], surface_pa: Sequence[float]) -> Interval:
    low, high = (reduced(pair, a, b) for a, b in zip(sphere_pa, surface_pa, strict=True))
    return low, high


def _reading(ratio: Mapping[str, Sequence[float]], ways: Sequence[str]) -> Interval:
    """Return what these ways of fitting read of a true modulus, two standard deviations wide."""
    found = [(statistics.fmean(ratio[way]), statistics.stdev(ratio[way])) for way in ways]
    return min(m - 2 * s for m, s in found), max(m + 2 * s for m, s in found)


def _off(stated: Interval, ours: Interval) -> float:
    """Return how far a range lies above (or, negative, below) another; 0 where they overlap. [1]"""
    if stated[0] > ours[1]:
        return stated[0] / ours[1] - 1
    if stated[1] < ours[0]:
        return stated[1] / ours[0] - 1
    return 0.0


def _words(off: float) -> str:
    return f"{100 * abs(off):.0f} % {'above' if off > 0 else 'below'}"


def _cell_or_material(hsd_off: float, kv_off: float) -> str:
    if hsd_off * kv_off > 0:
        return "and so is KV's row: not the crystal's doing"
    return "more than a rigid cell makes of the crystal"


def _closed_rig(stated: Interval, ours: Interval, traces: PairTraces) -> str:
    """Return whether a rig that is closed, read with KV, could give such a row."""
    low, high = traces.closed_readings
    found = f"KV reads {low:.2f}-{high:.2f} of E* on a closed rig"
    if not _off(stated, (ours[0] * min(low, 1.0), ours[1] * max(high, 1.0))):
        return f"but {found}, which would do"
    return f"and {found}, too little: the moduli are not Tables 1-2's, or more is missing"


def row_texts(found: Sequence[PrintedRow], table: str) -> list[list[str]]:
    """Return one table's rows as text, in GPa, under `ROW_HEADINGS`."""
    return [
        [
            " / ".join(row.pair),
            f"{row.printed.surface_pa / 1e9:.2f} ± {row.printed.surface_std_pa / 1e9:.2f}",
            _span(row.surface_range_pa),
            f"{row.printed.sphere_pa / 1e9:.2f} ± {row.printed.sphere_std_pa / 1e9:.2f}",
            _span(row.sphere_range_pa),
            f"{row.printed_pa / 1e9:.3g} ({_span(row.printed_range_pa)})",
            _span(row.ours_range_pa),
            row.verdict,
            row.remark,
        ]
        for row in found
        if row.table == table
    ]


def _span(interval_pa: Interval) -> str:
    low, high = (f"{x / 1e9:.3g}" for x in interval_pa)
    return low if low == high else f"{low}-{high}"
