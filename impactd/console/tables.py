"""Numbers and tables as people read them: plain text that also survives a pipe."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Sequence
from typing import Any

import typer

K_95 = 1.96
"""Coverage factor of 95 %, for a quantity whose JSON tells none."""


def table(headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return rows under headings, in aligned columns.

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
    lines = [
        "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in (list(headings), ["-" * width for width in widths], *cells)
    ]
    return "\n".join([paint(lines[0]), *lines[1:]])


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)


def measured(quantity: Any, *, scale: float = 1.0) -> str:
    """Return a value with its expanded uncertainty U (95 %), to two digits of U.

    Parameters
    ----------
    quantity : dict or None
        ``value`` and ``u``, as JSON carries them; U is ``expanded`` where it is there, else 1.96 u.
    scale : float, optional
        Factor on both, for another unit. [1]

    Returns
    -------
    str
        For example ``3.15 +- 0.24``; ``-`` for ``None``. Where shots have a value each, their
        median and range, and what they go with: ``0.31 (0.02 to 0.6 over 54 shots; falls from drop
        to drop, rank correlation -0.90)``. Where +- U would reach a sign that the quantity
        cannot have, its 95 % interval: ``89 (95 %: 12 .. 650)``.
    """
    if not isinstance(quantity, dict) or quantity.get("value") is None:
        return "-"
    value = quantity["value"] * scale
    if quantity.get("shots"):
        least, most = quantity["least"] * scale, quantity["most"] * scale
        over = "; ".join([f"over {quantity['shots']} shots", *(quantity.get("goes_with") or [])])
        return f"{value:.3g} ({least:.3g} to {most:.3g} {over})"
    stated = (quantity.get("expanded") or {}).get("U")
    expanded = (K_95 * (quantity.get("u") or 0.0) if stated is None else stated) * scale
    if not (math.isfinite(expanded) and expanded > 0):
        return f"{value:.5g}"
    low, high = quantity.get("interval95") or (None, None)
    if low is not None and value - expanded < 0.0 <= low * scale:
        upper = "any" if high is None else f"{high * scale:.2g}"
        return f"{value:.2g} (95 %: {low * scale:.2g} .. {upper})"
    digits = max(0, 1 - math.floor(math.log10(expanded)))
    if digits > 6 or abs(value) >= 1e7:
        return f"{value:.6g} +- {expanded:.2g}"
    return f"{value:.{digits}f} +- {expanded:.{digits}f}"


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
