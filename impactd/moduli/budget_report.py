"""The uncertainty budgets as a report: one self-contained page, or a PDF with a sheet a modulus."""

# ruff: noqa: PLC0415 - matplotlib is imported for a PDF only

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from string import Template

from impactd.aliases import Json
from impactd.diagnosis import budgets
from impactd.diagnosis.markup import bullets
from impactd.diagnosis.style import STYLE

_PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>impactd uncertainty budget</title>
<style>$style</style>
</head>
<body>
<h1>Uncertainty budget of each modulus</h1>
<p class="soft">$about</p>
$budgets
<h2>How to read it</h2>
<p class="soft">u is a standard uncertainty; ± is the expanded one, U = 1.96 u
(95 %). A contribution is the relative uncertainty of
the modulus that the input alone would leave; the squares of all contributions add up to u squared,
and a share is that square over the whole (JCGM 100, 5.1). The sensitivity is the change of ln E for
a change of the input's logarithm, or of the input if a unit follows it.</p>
$conditions
<p class="soft">$software. This page was made from the budget's JSON alone.</p>
</body>
</html>
""")


def write_budget_report(file: Path, document: Json, names: Sequence[str]) -> None:
    """Write a report.

    Parameters
    ----------
    file : Path
        Ends in ``.html`` or ``.pdf``.
    document : dict
        ``impactd-budget/1`` of a campaign or of an archive.
    """
    if file.suffix.lower() == ".pdf":
        _write_pdf(file, document, names)
    else:
        file.write_text(page(document, names), encoding="utf-8")


def page(document: Json, names: Sequence[str]) -> str:
    """Return the page.

    Parameters
    ----------
    document : dict
        ``impactd-budget/1``.
    """
    notes = [*(document.get("assumptions") or []), *(document.get("warnings") or [])]
    return _PAGE.substitute(
        style=STYLE,
        about=html.escape(about(document)),
        budgets=budgets.section(document, names),
        conditions=bullets(notes),
        software=html.escape(document["software"]),
    )


def about(document: Json) -> str:
    """Return which shots and which model a budget is of."""
    shots = document.get("shots")
    said = f"Model {document['model']}"
    return said if shots is None else f"{said}, {shots} shots"


def _write_pdf(file: Path, document: Json, names: Sequence[str]) -> None:
    from matplotlib.backends.backend_pdf import PdfPages

    from analysis.plots.budget import plot_budget
    from analysis.plots.style import styled

    # no date: the same budget gives the same bytes
    with styled(), PdfPages(file, metadata={"CreationDate": None}) as sheets:
        for name in names:
            for key, one in document["moduli"][name].items():
                title = f"{budgets.NAMES[key]} of {name}"
                sheets.savefig(plot_budget(title, one, note=about(document)))
