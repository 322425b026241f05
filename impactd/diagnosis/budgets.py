"""Uncertainty budgets in HTML: a table for each modulus, common parts apart from the others."""

from __future__ import annotations

import html
from collections.abc import Sequence

from impactd.aliases import Json
from impactd.diagnosis.markup import table
from impactd.reports.numbers import measured

SHOWN_SHARE = 1e-3
"""Share of the variance below which rows are told in one line; all are in the JSON."""
NAMES = {"youngs_modulus_Pa": "E", "plane_strain_modulus_Pa": "E/(1-ν²)"}
GROUPS = (
    (True, "common to all shots: repetitions do not reduce it"),
    (False, "of the single shots: more of them reduce it"),
)
_HEAD = (
    "input",
    "value",
    "u",
    "distribution",
    "sensitivity",
    "contribution",
    "share",
    "degrees of freedom",
    "traceable to",
)


def section(document: Json | None, names: Sequence[str]) -> str:
    """Return the budgets of some materials, Young's modulus first, the other one folded.

    Parameters
    ----------
    document : dict or None
        ``impactd-budget/1`` of all moduli.
    names : sequence of str
        Materials, by its keys.
    """
    parts = []
    for name in names:
        budgets = ((document or {}).get("moduli") or {}).get(name) or {}
        ordered = [key for key in NAMES if key in budgets]
        for place, key in enumerate(ordered):
            shown = one(f"{NAMES[key]} of {name}", budgets[key])
            parts.append(shown if place == 0 else _folded(f"{NAMES[key]} of {name}", shown))
    return "".join(parts)


def one(title: str, budget: Json) -> str:
    """Return one modulus' budget.

    Parameters
    ----------
    title : str
        Which modulus, as text.
    budget : dict
        ``impactd-budget/1`` of one modulus.
    """
    value = measured({"value": budget["value"], "u": budget["u"]}, scale=1e-9, sign="±")
    said = html.escape(f"{title} = {value} GPa (95 %)")
    parts = [
        f'<h3 class="budget">{said}</h3>',
        f'<p class="soft">u = {_percent(budget["relative_u"])}: '
        f"{_percent(budget['relative_u_common'])} common to all shots, "
        f"{_percent(budget['relative_u_averaged'])} reduced by more shots.</p>",
        f"<p><b>{html.escape(budget['improve'])}</b></p>",
    ]
    if budget.get("conformity"):
        parts.append(decision(budget["conformity"]))
    return "".join([*parts, f'<div class="wide budget">{_rows(budget)}</div>'])


def decision(found: Json) -> str:
    """Return whether a modulus passes, in words."""
    said = html.escape(found["sentence"])
    return f'<p class="verdict {found["decision"]}"><b>{found["decision"]}</b> {said}</p>'


def _folded(title: str, shown: str) -> str:
    return f"<details><summary>The same for {html.escape(title)}</summary>{shown}</details>"


def _rows(budget: Json) -> str:
    rows: list[Sequence[str]] = []
    for common, label in GROUPS:
        mine = [row for row in budget["rows"] if row["common"] == common]
        if not mine:
            continue
        together = sum(row["share"] for row in mine)
        rows.append((f'<td class="group" colspan="{len(_HEAD)}">{html.escape(label)}</td>',))
        rows += [_row(row) for row in mine if row["share"] >= SHOWN_SHARE]
        small = [row for row in mine if row["share"] < SHOWN_SHARE]
        if small:
            left = sum(row["share"] for row in small)
            rows.append((f"{len(small)} more", *[""] * 5, _share(left), "", ""))
        rows.append(("together", *[""] * 5, f"<b>{_share(together)}</b>", "", ""))
    return table(_HEAD, rows)


def _row(row: Json) -> Sequence[str]:
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    by = "" if row["sensitivity_to"] == "logarithm" or row["unit"] == "1" else f" per{unit}"
    freedom = row["degrees_of_freedom"]
    cells = (
        "–" if row["value"] is None else f"{row['value']:.6g}{unit}",
        "–" if row["u"] is None else f"{row['u']:.2g}{unit}",
        row["distribution"],
        "–" if row["sensitivity"] is None else f"{row['sensitivity']:+.3g}{by}",
        _percent(row["contribution"]),
    )
    width = f"{max(50 * row['share'], 0.5):.1f}"
    bar = f'<span class="bar" style="width:{width}px"></span> {_share(row["share"])}'
    return (
        f'<td class="input">{html.escape(row["label"])}</td>',
        *(html.escape(cell) for cell in cells),
        bar,
        "∞" if freedom is None else f"{freedom:.0f}",
        f'<td class="words">{html.escape(_source(row))}</td>',
    )


def _source(row: Json) -> str:
    """Return what a number is traceable to; what the records tell themselves is to nothing."""
    return str(row["traceable_to"] or ("not stated" if row["common"] else "–"))


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def _share(value: float) -> str:
    return f"{100 * value:.1f} %"
