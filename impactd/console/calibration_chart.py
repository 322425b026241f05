"""The history of the load cell as a table and as a drift chart."""

# ruff: noqa: PLC0415 - imported when a chart is drawn: a table must not wait for matplotlib

from __future__ import annotations

from pathlib import Path
from typing import Any

from analysis.written_numbers import measured
from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.tables import print_json, table

QUANTITIES = ("natural_frequency_Hz", "damping_ratio", "gain_N_per_V")
_MOST = 200


def history(*, chart: Path | None, url: str | None, as_json: bool) -> None:
    """Print the calibrations of the cell, oldest first, and draw them where asked to.

    Parameters
    ----------
    chart : Path or None
        Where the chart goes; its ending says in which format.
    as_json : bool
        Print the series as JSON instead of the table.

    Raises
    ------
    Failure
        If there is no calibration to draw.
    """
    with connect(url) as client:
        series = client.get("/v1/calibrations", limit=_MOST)["series"]
    if as_json:
        print_json(series)
    else:
        print(history_table(series))
    if chart is not None:
        if not series:
            raise Failure("there is no calibration with drops yet; run `impactd calibrate`.")
        draw(series, chart)


def history_table(series: list[dict[str, Any]]) -> str:
    """Return the series as the table a person reads.

    Parameters
    ----------
    series : list of dict
        Of ``GET /v1/calibrations``.

    Returns
    -------
    str
        Table, and what the last calibration says of a drift.
    """
    rows = []
    for entry in series:
        found, moved = entry["identifiable"], entry["since_previous"]
        rows.append(
            [
                entry["number"],
                (entry["finished_utc"] or "")[:16].replace("T", " "),
                *(measured(found.get(key)) for key in QUANTITIES),
                None if moved is None else moved["largest_in_u"],
                None if moved is None else moved["drifted"],
            ]
        )
    headings = ["no.", "finished (UTC)", "f0/Hz", "damping ratio", "S/(N/V)", "moved/u", "drift"]
    lines = [table(headings, rows), "+- is the expanded uncertainty (95 %)."]
    if series and series[-1]["since_previous"] is not None:
        lines += ["", f"Since the one before: {series[-1]['since_previous']['sentence']}"]
        if len(series) > 2:
            lines.append(f"Since the first: {series[-1]['since_first']['sentence']}")
    return "\n".join(lines)


def draw(series: list[dict[str, Any]], to: Path) -> None:
    """Draw the drift chart into a file.

    Parameters
    ----------
    series : list of dict
        Of ``GET /v1/calibrations``; at least one entry.
    to : Path
        Where it goes; png, svg or pdf.

    Raises
    ------
    Failure
        If the file's ending is none of these.
    """
    from analysis import plot_calibrations
    from impactd.console.plots import save

    save(plot_calibrations(series), to)
