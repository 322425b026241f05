"""The uncertainty budgets as a report: one self-contained page, or a PDF with a sheet a modulus."""

# ruff: noqa: PLC0415 - matplotlib is imported for a PDF only

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from analysis.written_numbers import counted
from impactd.aliases import Json
from impactd.reports.pdf_signature import Signatory
from impactd.reports.templating import MODULI, render


def write_budget_report(file: Path, document: Json, names: Sequence[str]) -> None:
    """Write the budgets of these materials into a new ``.html`` or ``.pdf`` file.

    The document is ``impactd-budget/1`` of a campaign or of an archive; ``names`` are its keys.
    """
    if file.suffix.lower() == ".pdf":
        with file.open("wb") as out:
            _write_sheets(out, document, [(n, key) for n in names for key in document["moduli"][n]])
    else:
        page = render("budget.html", document=document, names=names, about=about(document))
        file.write_text(page, encoding="utf-8")


def about(document: Json) -> str:
    """Return the shots and the model that a budget belongs to, in words."""
    shots = document.get("shots")
    said = f"Model {document['model']}"
    return said if shots is None else f"{said}, {counted(shots, 'shot')}"


def write_signed_sheet(
    file: Path, document: Json, name: str, measurand: str, signatory: Signatory
) -> None:
    """Write the budget of one modulus as a PDF of one page with a digital signature."""
    sheet = io.BytesIO()
    _write_sheets(sheet, document, [(name, measurand)])
    file.write_bytes(signatory.sign(sheet.getvalue()))


def _write_sheets(out: BinaryIO, document: Json, moduli: Sequence[tuple[str, str]]) -> None:
    from matplotlib.backends.backend_pdf import PdfPages

    from analysis.plots.budget import plot_budget
    from analysis.plots.style import styled

    # no date: the same budget gives the same bytes
    with styled(), PdfPages(out, metadata={"CreationDate": None}) as sheets:
        for name, key in moduli:
            title = f"{MODULI[key]} of {name}"
            one = document["moduli"][name][key]
            sheets.savefig(plot_budget(title, one, note=about(document)))
