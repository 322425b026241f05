"""The drift of the load cell over its calibrations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.aliases import Json
from analysis.cell_drift import DRIFT_LIMIT
from analysis.errors import AnalysisError
from analysis.plots.style import AFTER, BEFORE, INK, SOFT, WIDE, styled

QUANTITIES = (
    ("natural_frequency_Hz", "frequency f0", "Hz"),
    ("damping_ratio", "damping ratio", ""),
    ("gain_N_per_V", "gain S", "N/V"),
)


def plot_calibrations(series: Sequence[Json]) -> Figure:
    """Draw the drift chart of the load cell.

    Parameters
    ----------
    series : sequence of dict
        Of ``GET /v1/calibrations``, or `analysis.cell_drift.drift_series` with ``number`` and
        ``finished_utc``; oldest first.

    Returns
    -------
    matplotlib.figure.Figure
        Relative change since the first calibration. The thin bar with caps is the whole standard
        uncertainty (times two), of which all calibrations share a part; the thick one is that of
        the change since the first, in which the shared part has cancelled: only that one tells a
        drift.

    Raises
    ------
    AnalysisError
        If there is no calibration in it.
    """
    if not series:
        raise AnalysisError("There is no calibration with drops yet; run `impactd calibrate`.")
    moments = [np.datetime64(e["finished_utc"].removesuffix("Z").split("+")[0]) for e in series]
    # runs of one afternoon would fall on one spot of a time axis
    spread = (moments[-1] - moments[0]) / np.timedelta64(1, "D") > len(series) / 4
    at: list[Any] = list(moments) if spread else list(range(len(series)))
    with styled():
        figure = Figure(figsize=(WIDE, 6.0), layout="constrained")
        panels = figure.subplots(len(QUANTITIES), 1, sharex=True)
        for axes, (key, name, unit) in zip(panels, QUANTITIES, strict=True):
            _panel(axes, at, series, key)
            axes.set_title(name + _first(series[0]["identifiable"].get(key), unit), loc="left")
            axes.set_ylabel("change / %")
            axes.axhline(0.0, color=INK, lw=0.5)
            axes.margins(x=0.05)
        if spread:
            for label in panels[-1].get_xticklabels():
                label.set(rotation=20, horizontalalignment="right")
        else:
            panels[-1].set_xticks(range(len(series)), [str(e["number"]) for e in series])
        panels[-1].set_xlabel("time (UTC)" if spread else "number of the calibration")
        figure.align_ylabels()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
        return figure


def _first(quantity: Json | None, unit: str) -> str:
    if quantity is None:
        return ""
    value, u = quantity["value"], quantity["u"]
    digits = max(0, 1 - math.floor(math.log10(u))) if u > 0 else 4
    return f", first: {value:.{digits}f} ± {u:.{digits}f} {unit}".rstrip()


def _panel(axes: Axes, at: Sequence[Any], series: Sequence[Json], key: str) -> None:
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
        moved.append(previous is not None and abs(previous["in_u"]) > DRIFT_LIMIT)
    axes.errorbar(
        places, change, whole, fmt="none", ecolor=SOFT, capsize=5, zorder=3, label="2 u in all"
    )
    axes.errorbar(
        places, change, own, fmt="o", color=AFTER, elinewidth=3, markersize=4,
        label="2 u of the change since the first",
    )  # fmt: skip
    called = [i for i, is_drift in enumerate(moved) if is_drift]
    axes.plot(
        [places[i] for i in called], [change[i] for i in called], "o", color=BEFORE,
        markersize=10, fillstyle="none", markeredgewidth=1.6, label="drifted since the one before",
    )  # fmt: skip
