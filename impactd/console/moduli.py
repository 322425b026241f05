"""``impactd moduli``: what all shots together say about each material."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from analysis.written_numbers import counted
from impactd.console.client import connect
from impactd.console.fits import known_moduli, moduli_table
from impactd.console.spreadsheet import write_csv
from impactd.console.tables import print_json, wrapped


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
        of = f" of {filters['specimen']}" if filters.get("specimen") else ""
        print(f"There are no moduli{of}: no such shot has been analysed; see `impactd shots`.")
        return
    print(moduli_table(moduli))
    print()
    print(wrapped(_together(answer)))


def _together(answer: dict[str, Any]) -> str:
    """Return which shots the moduli rest on, as a fit of a campaign has others."""
    cells = [f"calibration {one}" if one.isdigit() else one for one in answer["calibrations"]]
    return (
        f"These moduli are from the E* of {counted(len(answer['shots']), 'stored shot')}, "
        f"each shot fitted by itself with {answer['model']} ({', '.join(cells)}), adjusted "
        f"together{known_moduli(answer['moduli'])}. `impactd fit CAMPAIGN` fits the records of one "
        "campaign at once instead: the last digits may differ."
    )
