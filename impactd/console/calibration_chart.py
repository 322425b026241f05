"""The history of the load cell as a table and as a drift chart."""

# ruff: noqa: PLC0415 - imported when a chart is drawn: a table must not wait for matplotlib

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Any

from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.tables import measured, print_json, table

QUANTITIES = (
    ("natural_frequency_Hz", "frequency f0", "Hz"),
    ("damping_ratio", "damping ratio", ""),
    ("gain_N_per_V", "gain S", "N/V"),
)
_MOST = 200


def history(*, chart: Path | None, url: str | None, as_json: bool) -> None:
    """Print the calibrations of the cell, oldest first, and draw them where asked to.

    Parameters
    ----------
    chart : Path or None
        Where the chart goes; its ending says in which format.
    url : str or None
        The daemon.
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
                *(measured(found.get(key)) for key, _, _ in QUANTITIES),
                None if moved is None else moved["largest_in_u"],
                None if moved is None else moved["drifted"],
            ]
        )
    headings = ["no.", "finished (UTC)", "f0/Hz", "damping ratio", "S/(N/V)", "moved/u", "drift"]
    lines = [table(headings, rows)]
    if series and series[-1]["since_previous"] is not None:
        lines += ["", f"Since the one before: {series[-1]['since_previous']['sentence']}"]
        if len(series) > 2:
            lines.append(f"Since the first: {series[-1]['since_first']['sentence']}")
    return "\n".join(lines)


def draw(series: list[dict[str, Any]], to: Path) -> None:
    """Draw the drift chart.

    Parameters
    ----------
    series : list of dict
        Of ``GET /v1/calibrations``; at least one entry.
    to : Path
        Where it goes.

    Notes
    -----
    Relative change since the first calibration. The thin bar with caps is the whole standard
    uncertainty (times two), of which all calibrations share a part; the thick one is that of the
    change since the first, in which the shared part has cancelled: only that one tells a drift.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    axes = figure.subplots(len(QUANTITIES), 1, sharex=True)
    moments = [datetime.fromisoformat(e["finished_utc"].replace("Z", "+00:00")) for e in series]
    # runs of one afternoon would fall on one spot of a time axis
    spread = (moments[-1] - moments[0]).total_seconds() > 86400 * len(series) / 4
    at = moments if spread else list(range(len(series)))
    for axis, (key, name, unit) in zip(axes, QUANTITIES, strict=True):
        _panel(axis, at, series, key)
        first = series[0]["identifiable"].get(key)
        start = "" if first is None else f", first: {measured(first)} {unit}".rstrip()
        axis.set_title(f"{name}{start}", loc="left", fontsize=10)
        axis.set_ylabel("change / %")
        axis.axhline(0.0, color="0.6", linewidth=0.8)
        axis.margins(x=0.05)
    if not spread:
        axes[-1].set_xticks(range(len(series)), [str(e["number"]) for e in series])
    axes[-1].set_xlabel("time" if spread else "calibration")
    axes[0].legend(loc="upper left", bbox_to_anchor=(0.0, 1.4), ncols=3, frameon=False, fontsize=9)
    figure.savefig(to, dpi=150)


def _panel(axis: Any, at: list[Any], series: list[dict[str, Any]], key: str) -> None:
    rows = [(x, e) for x, e in zip(at, series, strict=True) if e["identifiable"].get(key)]
    if not rows:
        return
    origin = rows[0][1]["identifiable"][key]["value"]
    places, change, whole, own, moved = [], [], [], [], []
    for x, entry in rows:
        found = entry["identifiable"][key]
        since = ((entry["since_first"] or {}).get("combinations") or {}).get(key)
        places.append(x)
        change.append(100 * (found["value"] / origin - 1))
        whole.append(200 * found["u"] / found["value"])
        own.append(200 * since["u"] if since else math.nan)
        previous = ((entry["since_previous"] or {}).get("combinations") or {}).get(key)
        moved.append(previous is not None and abs(previous["in_u"]) > _LIMIT)
    axis.errorbar(
        places, change, whole, fmt="none", ecolor="0.45", capsize=5, zorder=3, label="2 u in all"
    )
    axis.errorbar(
        places, change, own, fmt="o", color="#1b5e9a", elinewidth=3, markersize=5,
        label="2 u of the change since the first",
    )  # fmt: skip
    called = [i for i, is_drift in enumerate(moved) if is_drift]
    axis.plot(
        [places[i] for i in called],
        [change[i] for i in called],
        "o",
        color="#c0392b",
        markersize=10,
        fillstyle="none",
        markeredgewidth=2,
        label="drifted since the one before",
    )


_LIMIT = 3.0
"""As `analysis.cell_drift.DRIFT_LIMIT`; a chart must not wait for the analysis to load."""
