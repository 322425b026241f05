"""One modulus' uncertainty budget as a sheet: contributions as bars, and the table below."""

from __future__ import annotations

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.aliases import Json
from analysis.plots.style import AFTER, BEFORE, INK, SOFT, styled

SHOWN = 14
"""Rows on a sheet; the others are told together."""
_SHEET = (11.69, 8.27)
"""A4, lying. [inch]"""
_COLUMNS = (
    ("input", 0.0, "left"),
    ("value", 0.40, "right"),
    ("u", 0.50, "right"),
    ("distribution", 0.52, "left"),
    ("sensitivity", 0.67, "right"),
    ("contribution", 0.76, "right"),
    ("share", 0.82, "right"),
    ("dof", 0.87, "right"),
    ("traceable to", 0.885, "left"),
)


def plot_budget(title: str, budget: Json, note: str = "") -> Figure:
    """Draw the budget of one modulus, ``impactd-budget/1``, on a sheet of A4.

    The note stands at the foot. The figure is neither shown nor saved.
    """
    rows = sorted(budget["rows"], key=lambda row: (not row["common"], -row["share"]))
    kept = sorted(rows, key=lambda row: -row["share"])[:SHOWN]
    rows = [row for row in rows if row in kept]
    with styled():
        figure = Figure(figsize=_SHEET)
        value, u = budget["value"] * 1e-9, budget["u"] * 1e-9
        figure.text(0.05, 0.94, f"{title} = {value:.6g} GPa, u = {u:.2g} GPa", size=14, color=INK)
        figure.text(0.05, 0.87, "\n".join(_sentences(budget)), size=9, color=INK, va="center")
        _bars(figure.add_axes((0.33, 0.48, 0.62, 0.33)), rows)
        table = figure.add_axes((0.05, 0.065, 0.9, 0.345))
        _table(table, rows)
        left = len(budget["rows"]) - len(rows)
        foot = f"{note}. " if note else ""
        foot += f"{left} smaller inputs are not shown. " if left else ""
        foot += "Squares of contributions add up to u squared (JCGM 100)."
        figure.text(0.05, 0.03, foot, size=7.5, color=SOFT)
    return figure


def _sentences(budget: Json) -> list[str]:
    said = [
        f"u = {100 * budget['relative_u']:.2g} %: {100 * budget['relative_u_common']:.2g} % "
        f"common to all shots, {100 * budget['relative_u_averaged']:.2g} % reduced by more shots.",
        budget["improve"],
    ]
    if budget.get("conformity"):
        said.append(budget["conformity"]["sentence"])
    return [line for one in said for line in textwrap.wrap(one, 165)]


def _bars(axes: Axes, rows: list[Json]) -> None:
    for common, colour, hatch, label in (
        (True, AFTER, "", "common to all shots"),
        (False, BEFORE, "///", "reduced by more shots"),
    ):
        at = [i for i, row in enumerate(rows) if row["common"] == common]
        if at:
            widths = [100 * rows[i]["contribution"] for i in at]
            axes.barh(at, widths, color=colour, hatch=hatch, edgecolor="white", label=label)
    axes.set_yticks(range(len(rows)), [row["label"] for row in rows])
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("contribution to u / %")
    axes.legend(loc="lower right")


def _table(axes: Axes, rows: list[Json]) -> None:
    axes.set_axis_off()
    step = 1.0 / (SHOWN + 1)
    for name, x, side in _COLUMNS:
        axes.text(x, 1.0, name, ha=side, va="top", size=7.5, color=SOFT)
    for place, row in enumerate(rows, start=1):
        y = 1.0 - place * step
        for (_, x, side), cell in zip(_COLUMNS, _cells(row), strict=True):
            axes.text(x, y, cell, ha=side, va="top", size=7.5, color=INK)


def _cells(row: Json) -> tuple[str, ...]:
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    freedom = row["degrees_of_freedom"]
    source = row["traceable_to"] or ("not stated" if row["common"] else "–")
    return (
        textwrap.shorten(row["label"], 62, placeholder=" …"),
        "–" if row["value"] is None else f"{row['value']:.6g}{unit}",
        "–" if row["u"] is None else f"{row['u']:.2g}{unit}",
        row["distribution"],
        "–" if row["sensitivity"] is None else f"{row['sensitivity']:+.3g}",
        f"{100 * row['contribution']:.2g} %",
        f"{100 * row['share']:.1f} %",
        "∞" if freedom is None else f"{freedom:.0f}",
        textwrap.shorten(source, 26, placeholder=" …"),
    )
