"""Lists, tables and p values in HTML."""

from __future__ import annotations

import html
from collections.abc import Sequence


def bullets(lines: list[str]) -> str:
    """Return lines as a list."""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; a cell that is already a ``<td>`` stays as it is.

    Parameters
    ----------
    head : sequence of str
        One per column.
    rows : sequence of sequences
        Cells, escaped by the caller.
    """
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join(
        f"<tr>{''.join(c if c.startswith('<td') else f'<td>{c}</td>' for c in row)}</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def p_words(value: float) -> str:
    """Return a p value in words."""
    return f"p = {value:.2g}" if value > 1e-99 else "p < 1e-99"
