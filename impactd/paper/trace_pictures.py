"""Figs 5 and 6: records under HSD and KV; and what the closed model changes in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.aliases import Array
from analysis.paper.contact import TABLE3_CELL
from analysis.plots.style import AFTER, BEFORE, INK
from impactd.paper.pair_traces import (
    FIGURE_PAIRS,
    RESTITUTION,
    TIMES_S,
    PairTraces,
    Reading,
    all_pair_traces,
    drop_for,
    kv_model,
    printed_trace,
)
from impactd.paper.trace_claims import SECOND_PEAK_PAIR, ring_after

_WIDE = 9.0
_SHOWN_US = 300.0
_DOTS: Any = {"marker": "o", "ls": "none", "ms": 3.6, "mew": 0, "color": "#b4b8be", "markevery": 4}
_PRINTED: Any = {"color": INK, "ls": (0, (1.2, 1.2)), "lw": 1.0}
_LINES: dict[str, Any] = {
    "HSD": {"color": BEFORE, "ls": (0, (4, 1.6)), "lw": 1.2},
    "KV": {"color": AFTER, "ls": "-", "lw": 1.2},
}
_TABLE_OF = {"HSD": "table4_hsd", "KV": "table5_kv"}


def figure_of(name: str) -> Figure:
    """Draw Fig. 5 or 6: one sphere on four coupons, HSD beside KV, and what they leave.

    Parameters
    ----------
    name : str
        One of `FIGURE_PAIRS`.

    Returns
    -------
    matplotlib.figure.Figure
        A column per coupon, from stiff to soft; rows: HSD, KV, residuals.
    """
    found = [all_pair_traces()[pair] for pair in FIGURE_PAIRS[name]]
    figure = Figure(figsize=(_WIDE, 5.6), layout="constrained")
    panels = figure.subplots(3, len(found), sharex=True, sharey="row", height_ratios=(1, 1, 0.7))
    for column, one in zip(panels.T, found, strict=True):
        column[0].set_title(" / ".join(one.pair), loc="left", fontsize=8.5)
        for axes, model, reading in ((column[0], "HSD", one.hsd), (column[1], "KV", one.kv)):
            _over_record(axes, one.paper_rig_v, reading, model)
            axes.plot(_us(), printed_trace(one.pair, _TABLE_OF[model]), **_PRINTED,
                      label="moduli as printed")  # fmt: skip
            column[2].plot(_us(), one.paper_rig_v - reading.signal, **_LINES[model], label=model)
        column[2].set_xlabel("time after touch-down / µs")
        if one.pair == SECOND_PEAK_PAIR:
            _mark_second_peak(column[1], one)
    for axes, words in zip(panels[:, 0], ("HSD / V", "KV / V", "record − model / V"), strict=True):
        axes.set_ylabel(words)
    _legends(panels[:, -1])
    return figure


def closed_figure() -> Figure:
    """Draw the eight traces by KV and by the closed model, and what KV leaves of a closed rig.

    Returns
    -------
    matplotlib.figure.Figure
        A column per coupon; for each sphere a row of traces and one of residuals.
    """
    figure = Figure(figsize=(_WIDE, 7.0), layout="constrained")
    panels = figure.subplots(4, 4, sharex=True, sharey="row", height_ratios=(1, 0.7, 1, 0.7))
    for block, pairs in zip((panels[:2], panels[2:]), FIGURE_PAIRS.values(), strict=True):
        for (traces, rest), pair in zip(block.T, pairs, strict=True):
            one = all_pair_traces()[pair]
            traces.set_title(f"{' / '.join(pair)}, {1e3 * one.coupon_kg:.1f} g", loc="left",
                             fontsize=8)  # fmt: skip
            drop = drop_for(pair, one.reduced_modulus_pa)
            traces.plot(_us(), one.closed_rig_v, **_DOTS, label="record, closed rig")
            for words, coupon, look in (
                ("KV", None, _LINES["HSD"] | {"color": INK}),
                ("kv2", one.coupon_kg, _LINES["KV"]),
            ):
                model = kv_model(TABLE3_CELL, coupon)
                traces.plot(_us(), model(drop, TIMES_S), **look, label=f"{words}, same E*")
            _left_by_kv(rest, one)
        block[0, 0].set_ylabel("signal / V")
        block[1, 0].set_ylabel("record − KV / V")
        _legends(block[:, -1])
    for axes in panels[-1]:
        axes.set_xlabel("time after touch-down / µs")
    return figure


def _us() -> Array:
    return TIMES_S * 1e6


def _over_record(axes: Axes, record_v: Array, reading: Reading, model: str) -> None:
    axes.plot(_us(), record_v, **_DOTS, label="record")
    axes.plot(_us(), reading.signal, **_LINES[model], label=f"{model}, E* free")
    axes.set_xlim(0, _SHOWN_US)
    axes.annotate(f"R² {reading.r2:.2f}, E* × {reading.modulus_ratio:.2f}", (0.98, 0.05),
                  xycoords="axes fraction", ha="right", fontsize=7.5)  # fmt: skip


def _mark_second_peak(axes: Axes, one: PairTraces) -> None:
    at_s, share = ring_after(one.pair, one.reduced_modulus_pa, RESTITUTION)
    axes.annotate(f"{at_s * 1e6:.0f} µs", (at_s * 1e6, share * one.kv.signal.max()), (4, 14),
                  textcoords="offset points", fontsize=7.5,
                  arrowprops={"arrowstyle": "-|>", "lw": 0.8})  # fmt: skip


def _left_by_kv(axes: Axes, one: PairTraces) -> None:
    for words, reading, look in (
        ("M with coupon", one.loaded, _LINES["KV"]),
        ("M without", one.bare, _LINES["HSD"]),
    ):
        axes.plot(_us(), one.closed_rig_v - reading.signal, **look, label=words)
    axes.set_xlim(0, _SHOWN_US)
    ratios = one.loaded.modulus_ratio, one.bare.modulus_ratio
    axes.set_title("E* × {:.2f} with, × {:.2f} without".format(*ratios), loc="left", fontsize=7.5)


def _legends(panels: Sequence[Axes]) -> None:
    for axes in panels:
        axes.legend(loc="upper right", fontsize=7)
