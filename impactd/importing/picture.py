"""A picture of the shots that were cut out of recordings, on one page."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.plots.style import AFTER, BEFORE, INK, SOFT, WIDE, styled
from impactd.importing.cutting import Cut
from impactd.storage.publish import publish

_MOST_RECORDS, _MOST_SHOTS, _COLUMNS = 6, 24, 4
_POINTS = 2000
"""Of a drawn record: more lie closer than the dots of a screen."""
_SIGNALS = {
    "voltage": ("signal", "V"),
    "force_N": ("force", "N"),
    "acceleration_m_per_s2": ("acceleration", "m/s²"),
}
_BEFORE, _AFTER = 3, 8
"""Contacts that a hit is drawn with."""


def save_picture(cuts: Sequence[Cut], path: Path) -> None:
    """Write the picture as a new ``.png``: whole recordings above, each hit below."""
    with styled():
        buffer = io.BytesIO()
        draw(cuts).savefig(buffer, format="png")
    publish(path, buffer.getvalue())


def draw(cuts: Sequence[Cut]) -> Figure:
    """Return the figure of `save_picture`."""
    records: dict[int, list[Cut]] = {}
    for one in cuts:
        records.setdefault(id(one.record), []).append(one)
    groups = list(records.values())[:_MOST_RECORDS]
    shown = cuts[:_MOST_SHOTS]
    rows = math.ceil(len(shown) / _COLUMNS)
    heights = [1.15] * len(groups) + [1.35] * rows
    figure = Figure(figsize=(WIDE, sum(heights) + 0.9), layout="constrained")
    grid = figure.add_gridspec(len(heights), _COLUMNS, height_ratios=heights)
    for row, group in enumerate(groups):
        _draw_record(figure.add_subplot(grid[row, :]), group, cuts)
    for at, one in enumerate(shown):
        row, column = divmod(at, _COLUMNS)
        _draw_hit(figure.add_subplot(grid[len(groups) + row, column]), one, cuts.index(one))
    left = [
        f"{len(records) - len(groups)} more recordings" if len(records) > len(groups) else "",
        f"{len(cuts) - len(shown)} more hits" if len(cuts) > len(shown) else "",
    ]
    more = " and ".join(one for one in left if one)
    not_drawn = f" Not drawn: {more}." if more else ""
    figure.suptitle(
        "Above: the recordings; each grey band becomes a shot.\n"
        f"Below: each hit; the dashed line is trigger_index.{not_drawn}",
        fontsize=8,
        color=INK,
    )
    return figure


def _draw_record(axes: Axes, group: Sequence[Cut], cuts: Sequence[Cut]) -> None:
    first = group[0]
    name, unit = _SIGNALS[first.unit.quantity]
    times, low, high = _envelope(first.record, first.rate_hz)
    factor, prefix = _seconds(float(times[-1]))
    axes.fill_between(times * factor, low, high, color=AFTER, lw=0.6, step=None)
    for one in group:
        hit = one.hit
        span = (hit.first / one.rate_hz * factor, hit.stop / one.rate_hz * factor)
        axes.axvspan(*span, color=SOFT, alpha=0.25, lw=0)
        axes.annotate(
            str(cuts.index(one)), (one.begins_s * factor, 1.0), xycoords=("data", "axes fraction"),
            ha="center", va="bottom", fontsize=7, color=INK,
        )  # fmt: skip
    axes.set_ylabel(f"{name} / {unit}")
    axes.set_xlabel(f"time / {prefix}", labelpad=0)
    axes.set_title(first.file, loc="left", pad=9)
    axes.margins(x=0)


def _draw_hit(axes: Axes, one: Cut, number: int) -> None:
    contact = one.hit.contact
    first = max(0, one.trigger_index - max(16, _BEFORE * contact))
    last = one.trigger_index + max(32, _AFTER * contact)
    if one.hit.impacts > 1:
        last = one.samples.size
    part = one.samples[first:last]
    times = (np.arange(part.size) + first - one.trigger_index) / one.rate_hz
    factor, prefix = _seconds(float(np.ptp(times)))
    few = "." if part.size < 200 else ""
    axes.plot(times * factor, part, color=AFTER, lw=0.9, marker=few, ms=2.5)
    axes.axvline(0.0, color=BEFORE, lw=0.9, ls="--")
    impacts = f", {one.hit.impacts} impacts" if one.hit.impacts > 1 else ""
    axes.set_title(f"{number}: {one.name}{impacts}", fontsize=7, pad=3)
    axes.tick_params(labelsize=6)
    axes.set_xlabel(prefix, fontsize=6.5, labelpad=0)
    axes.margins(x=0)


def _envelope(
    record: NDArray[np.float64], rate_hz: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times, and the lowest and highest value around each: no peak is lost in drawing."""
    length = max(1, record.size // _POINTS)
    count = record.size // length
    blocks = record[: count * length].reshape(count, length)
    low, high = blocks.min(axis=1), blocks.max(axis=1)
    # neighbours overlap by a sample, so that a steep edge is one line
    low[1:] = np.minimum(low[1:], blocks[:-1, -1])
    high[1:] = np.maximum(high[1:], blocks[:-1, -1])
    return np.arange(count) * length / rate_hz, low, high


def _seconds(span_s: float) -> tuple[float, str]:
    """Return the factor and the name of the unit that a span of time is drawn in."""
    for least, factor, name in ((1.0, 1.0, "s"), (1e-3, 1e3, "ms")):
        if span_s >= least:
            return factor, name
    return 1e6, "µs"
