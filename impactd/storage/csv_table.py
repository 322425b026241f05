"""Lines of CSV that a spreadsheet takes for numbers and text, never for a formula.

A spreadsheet runs a cell that begins with ``=``, ``+``, ``-`` or ``@``, whoever wrote it. Such a
text gets an apostrophe in front, as the OWASP page on CSV injection advises; numbers stay
numbers. All CSV of this program is written here.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable
from numbers import Number

# Blanks and quotes may stand before the sign, and a spreadsheet set to semicolons or tabs splits a
# text there. The full-width forms of the four signs count in East Asian spreadsheets.
_FORMULA = re.compile("(^|[;\\t\\r\\n])([\\s\"'\\ufeff]*[=+\\-@\uff1d\uff0b\uff0d\uff20])")


def csv_line(cells: Iterable[object]) -> str:
    """Return one line of CSV, ending with ``\r\n`` (RFC 4180); ``None`` is an empty cell."""
    buffer = io.StringIO()
    csv.writer(buffer).writerow([_inert(one) for one in cells])
    return buffer.getvalue()


def _inert(cell: object) -> object:
    if cell is None or isinstance(cell, Number):
        return cell
    text = _FORMULA.sub(r"\1'\2", str(cell))
    return f"'{text}" if text[:1] in ("\t", "\r", "\n") else text
