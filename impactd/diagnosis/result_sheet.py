"""A campaign's result on one page of A4, for the file: a PDF."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

from matplotlib.figure import Figure

from analysis.plots.residuals import draw_largest_residual
from analysis.plots.style import INK, SOFT, styled
from analysis.written_numbers import K_95, counted, measured
from impactd.aliases import Json
from impactd.diagnosis.report import campaign
from impactd.reports.templating import MODULI
from impactd.storage.campaign_digest import digest_of

_WIDE, _TALL = 8.27, 11.69
"""A4, upright. [inch]"""
_LEFT, _RIGHT, _TOP = 0.8, 0.6, 0.8
"""Margins. [inch]"""
_TEXT_END = 5.6
"""Lower edge of what stands above the picture. [inch]"""
_PICTURE = (1.9, 3.1)
"""Lower edge and height of the picture. [inch]"""
_FOOT = 1.2
"""Upper edge of the foot. [inch]"""
_COLUMNS = (0.0, 1.9, 2.8, 4.1, 5.6)
"""Left edges of the table's columns. [inch]"""
_WIDTH_PT = 860
"""Characters of a line times their size; letters are about 0.56 of it wide."""


@dataclass(frozen=True)
class Source:
    """What a result was made from.

    Attributes
    ----------
    name : str
        Of the campaign.
    files : mapping of str
        SHA-256 of each file by its name.
    """

    name: str
    files: Mapping[str, str]


def write_result_sheet(file: Path, document: Json, source: Source, made: datetime) -> None:
    """Write the sheet; the same arguments give the same bytes.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    made : datetime
        The sheet's date, with its time zone.
    """
    with styled():
        figure = Figure(figsize=(_WIDE, _TALL))
        _write(figure, _lines(document, source, made))
        _draw_residual(figure, document)
        _write_foot(figure, document, source)
        metadata = {"Title": source.name, "Creator": document["software"], "CreationDate": made}
        figure.savefig(file, format="pdf", metadata=metadata)


@dataclass(frozen=True)
class _Line:
    """A line of text: its cells stand at `_COLUMNS`; without cells it is empty."""

    cells: tuple[str, ...]
    size: float = 9.0
    colour: str = INK

    @property
    def height(self) -> float:
        """Return what it takes. [inch]"""
        return 1.55 * self.size / 72


def _lines(document: Json, source: Source, made: datetime) -> list[_Line]:
    """Return everything above the picture."""
    head, rows = _moduli(document)
    return [
        *_paragraph(source.name, 17),
        *_paragraph(campaign(document), 9, SOFT),
        *_paragraph(f"Result of {made:%Y-%m-%d %H:%M %Z}", 9, SOFT),
        _Line(()),
        *_paragraph(document["verdict"].upper().replace("_", " "), 13),
        *_paragraph(document["sentence"], 9.5),
        *(line for said in _effects(document) for line in _paragraph(said, 9.5)),
        _Line(()),
        _Line(head, colour=SOFT),
        *(_Line(row) for row in rows),
    ]


def _paragraph(said: str, size: float, colour: str = INK) -> list[_Line]:
    return [_Line((line,), size, colour) for line in textwrap.wrap(said, int(_WIDTH_PT / size))]


def _write(figure: Figure, lines: list[_Line]) -> None:
    """Write lines from the top; smaller, if there are more than have room."""
    y = _TALL - _TOP
    shrunk = min(1.0, (y - _TEXT_END) / sum(line.height for line in lines))
    for line in lines:
        for at, cell in zip(_COLUMNS, line.cells, strict=False):
            _text(figure, _LEFT + at, y, cell, size=shrunk * line.size, colour=line.colour)
        y -= shrunk * line.height


def _text(figure: Figure, x: float, y: float, said: str, *, size: float, colour: str) -> None:
    """Write at a place in inches; a dollar in a name begins no formula."""
    figure.text(x / _WIDE, y / _TALL, said, size=size, color=colour, va="top", parse_math=False)


def _effects(document: Json) -> list[str]:
    return [
        f"{effect['id']}: {name} = {measured(value, sign='±')} {value['unit']}"
        for effect in document["effects"]
        for name, value in effect["parameters"].items()
    ]


def _moduli(document: Json) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heading and rows of the moduli, those that were to be found first."""
    moduli = document["after"].get("moduli", {})
    factors = {
        one["expanded"]["k"]
        for entry in moduli.values()
        for one in (entry.get(key) for key in MODULI)
        if one and one.get("expanded")
    }
    k = ", ".join(f"{one:.3g}" for one in sorted(factors or {K_95}))
    ordered = sorted(moduli.items(), key=lambda item: item[1]["status"] == "reference")
    rows = [
        (
            name,
            entry["status"],
            *(
                measured(entry.get(key), scale=1e-9, sign="±")
                for key in (*MODULI, "stated_youngs_modulus_Pa")
            ),
        )
        for name, entry in ordered
    ]
    symbols = (f"{symbol} ± U / GPa" for symbol in MODULI.values())
    return (f"U = k u, k = {k} (95 %)", "", *symbols, "E stated ± U / GPa"), rows


def _draw_residual(figure: Figure, document: Json) -> None:
    low, tall = _PICTURE
    if document["residual"]["before"].get("stacks"):
        left = _LEFT + 0.5
        wide = _WIDE - left - _RIGHT
        axes = figure.add_axes((left / _WIDE, low / _TALL, wide / _WIDE, tall / _TALL))
        draw_largest_residual(axes, document)


def _write_foot(figure: Figure, document: Json, source: Source) -> None:
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    names = sorted(source.files)
    lines = (
        f"Model {document['after']['model']}. Made by {document['software']} ({versions}).",
        f"SHA-256 {digest_of(source.files)}",
        f"of the list that sha256sum prints for {counted(len(names), 'file')}, sorted by name: "
        f"{names[0]} to {names[-1]}.",
    )
    for place, line in enumerate(lines):
        _text(figure, _LEFT, _FOOT - 0.18 * place, line, size=7.5, colour=SOFT)
