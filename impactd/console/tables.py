"""Numbers and tables as people read them: plain text that also survives a pipe."""

from __future__ import annotations

import json
import os
import sys
import textwrap
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import typer

WIDTH = 100
"""Of a table, in columns: two windows beside each other on a usual screen."""
_NARROWEST = 16
"""Of a column that is wrapped: less would be a ladder of words."""


def table(headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return rows under headings, in aligned columns; the widest are wrapped to fit `WIDTH`.

    Parameters
    ----------
    headings : sequence of str
        One per column.
    rows : sequence of sequences
        Cells; numbers stand to the right.

    Returns
    -------
    str
        Lines without a trailing newline.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    right = [
        bool(rows) and all(isinstance(row[i], (int, float, type(None))) for row in rows)
        for i in range(len(headings))
    ]
    columns = list(zip(headings, *cells, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    words = [[len(word) for cell in column for word in cell.split()] for column in columns]
    least = [max(_NARROWEST, *lengths, 0) for lengths in words]
    while sum(widths) + 2 * (len(widths) - 1) > WIDTH:
        spare = [max(width - floor, 0) * width for width, floor in zip(widths, least, strict=True)]
        if not any(spare):
            break
        widths[spare.index(max(spare))] -= 1
    cells = [line for row in cells for line in _wrapped(row, widths)]
    lines = [
        "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in (list(headings), ["-" * width for width in widths], *cells)
    ]
    return "\n".join([paint(lines[0]), *lines[1:]])


def wrapped(text: str, begin: str = "") -> str:
    """Return a text in lines that fit a terminal, all but the first as far in as ``begin``."""
    return textwrap.fill(
        text,
        WIDTH,
        initial_indent=begin,
        subsequent_indent=" " * len(begin),
        break_on_hyphens=False,
    )


def _wrapped(row: list[str], widths: list[int]) -> list[list[str]]:
    """Return a row, and below it rows with what its cells have no room for."""
    parts = [
        textwrap.wrap(cell, max(width, 1), break_long_words=False, break_on_hyphens=False) or [""]
        for cell, width in zip(row, widths, strict=True)
    ]
    return [list(line) for line in zip_longest(*parts, fillvalue="")]


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)


def print_json(value: Any) -> None:
    """Print a value as JSON, indented on a terminal and in one line in a pipe."""
    indent = 2 if sys.stdout.isatty() else None
    print(json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False))


def paint(text: str, colour: str | None = None) -> str:
    """Return a text bold and in a colour on a terminal, and as it is everywhere else.

    Parameters
    ----------
    text : str
        What to print on standard output.
    colour : str, optional
        As `typer.style` names them; the terminal's own without it.

    Returns
    -------
    str
        With escape codes only where standard output is a terminal that shows colours and
        ``NO_COLOR`` (https://no-color.org) is not set.
    """
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return typer.style(text, fg=colour, bold=True)


LIGHTS = {"use": "green", "check": "yellow", "repeat": "red"}
"""Colours of what to do with a shot."""
