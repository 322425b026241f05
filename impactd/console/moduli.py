"""``impactd moduli``: what all shots together say about each material."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from impactd.console.client import connect
from impactd.console.fits import moduli_table
from impactd.console.spreadsheet import write_csv
from impactd.console.tables import print_json


def show(
    filters: dict[str, Any], *, csv_out: Path | None = None, url: str | None, as_json: bool
) -> None:
    """Print the moduli.

    Parameters
    ----------
    filters : dict
        ``specimen``, ``since``, ``until``; ``None`` where not given.
    csv_out : Path or None
        Where the numbers go for a spreadsheet.
    as_json : bool
        Print the answer as JSON.
    """
    with connect(url) as client:
        answer = client.get("/v1/moduli", **filters)
    if csv_out is not None:
        write_csv(csv_out, answer)
    if as_json:
        print_json(answer)
        return
    moduli = answer.get("moduli") or {}
    if not moduli:
        print("There are no moduli: no such shot has been analysed.")
        return
    print(moduli_table(moduli))
