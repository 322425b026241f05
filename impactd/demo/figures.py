"""The pictures of the demo: one shot with its residuals, and every modulus against the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis import Campaign, Shot, fit_campaign
from analysis.fit.shot_fit import ShotFit
from analysis.plots.span import span_us
from impactd.demo.outcome import Outcome, Row, Rung

MEASURED, HSD, KV, CLOSED_KV, AFTER, TRUTH = (
    "#8a8f98",
    "#d9822b",
    "#a05cc4",
    "#1c6dd0",
    "#1b8a5a",
    "#202124",
)
"""Colours that stay apart in grey and for the colour-blind."""

_SPAN_US = -60.0, 560.0
"""What of a shot is drawn at least: the pulse and most of the ring."""

_LOOK = {
    "hsd": (HSD, "s", -0.3),
    "kv": (KV, "^", -0.1),
    "kv2": (CLOSED_KV, "o", 0.1),
    "after": (AFTER, "D", 0.3),
}
"""Colour, marker and shift of each rung's whiskers."""

# Any: matplotlib's own type names each of its hundreds of keys
_STYLE: Any = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e6ea",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "savefig.dpi": 130,
}


def draw_trace(file: Path, campaign: Campaign, outcome: Outcome, title: str) -> None:
    """Draw one shot with HSD and the closed KV, and below it what rungs leave of its like.

    Parameters
    ----------
    outcome : Outcome
        Of the demo: its diagnosis holds the residuals of all drops, stacked.
    """
    (shot,) = campaign.shots
    fits = {key: fit_campaign(campaign, key).shots for key in ("hsd", "kv2")}
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 6.6), layout="constrained")
        upper, rigid, fine = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1.2, 1.4])
        names = {rung.key: rung.name for rung in outcome.rungs}
        # One zero for all: a model drawn from its own touch-down seems to miss what it does not.
        touch = _touch_down(shot, fits["kv2"])
        for key, fitted in fits.items():
            for fit in fitted:  # none where the model cannot be evaluated on this shot
                colour = _LOOK[key][0]
                t = _time_us(fit, touch)
                upper.plot(t, fit.prediction, color=colour, lw=1.3, label=names[key], zorder=3)
                if key == "hsd":
                    rigid.plot(t, fit.residual * 1e3, color=colour, lw=1.0)
        measured_us = (np.arange(shot.signal.size) - touch) / shot.sample_rate_hz * 1e6
        first, last = _span_us(outcome)
        near = (measured_us > first) & (measured_us < last)
        upper.plot(
            measured_us[near], shot.signal[near], ".", color=MEASURED, ms=5, label="measured"
        )
        upper.set_ylabel("signal / V")
        upper.set_title(title, loc="left", fontsize=11)
        upper.legend(loc="upper right")
        rigid.set_ylabel("residual of HSD / mV")
        _draw_stacks(fine, outcome, shot)
        fine.set_ylabel("residual / mV")
        fine.set_xlabel("time since touch-down / µs")
        fine.set_xlim(first, last)
        figure.savefig(file)


def _span_us(outcome: Outcome) -> tuple[float, float]:
    """Return what is drawn: further than usual where the residual says something later."""
    stacks = outcome.diagnosis["residual"]["before"].get("stacks")
    return _SPAN_US[0], max(_SPAN_US[1], span_us(stacks)[1] if stacks else 0.0)


def _draw_stacks(axes: Axes, outcome: Outcome, shot: Shot) -> None:
    """Draw the mean residual of the shot's pair and height, from the diagnosis."""
    noise_mv = 1e3 * float(outcome.diagnosis["noise_rms_V"])
    axes.axhspan(-noise_mv, noise_mv, color="#eef0f3", lw=0, label="noise of one sample")
    seen = outcome.diagnosis["residual"]
    for rung, side in ((outcome.base, "before"), (outcome.last, "after")):
        stacks = (seen[side] or {}).get("stacks")
        if not stacks:
            continue
        t = np.array(stacks["time_us"])
        for curve in stacks["by_pair_and_height"]:
            if curve["pair"] == f"{shot.sphere}/{shot.surface}" and math.isclose(
                curve["drop_height_m"] or 0.0, shot.drop_height_m or 0.0
            ):
                mean_mv = [math.nan if v is None else 1e3 * v for v in curve["mean"]]
                axes.plot(t, mean_mv, color=_LOOK[rung.key][0], lw=1.2, label=rung.name)
    # above the curves: a second touch may stand anywhere below
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), fontsize=8, ncols=3)


def _touch_down(shot: Shot, fitted: Sequence[ShotFit]) -> float:
    """Return where the sphere touched, in samples: as fitted, or the trigger."""
    for fit in fitted:
        return float(fit.to_json()["touch_down_s"]["value"]) * shot.sample_rate_hz
    return float(shot.trigger_index)


def _time_us(fit: ShotFit, touch: float) -> NDArray[np.float64]:
    """Return each fitted sample's time since a sample, the touch-down. [us]"""
    samples = fit.item.window.first + np.arange(fit.item.window.signal.size)
    return np.asarray((samples - touch) / fit.item.shot.sample_rate_hz * 1e6, dtype=np.float64)


def draw_moduli(file: Path, outcome: Outcome) -> None:
    """Draw every modulus as its deviation from the truth, with its 95 % interval."""
    groups = [("reduced modulus E* of each pair", outcome.pairs)]
    if outcome.materials:
        groups.append(("Young's modulus of each material", outcome.materials))
    heights = [1.25 * len(rows) + 1.2 for _, rows in groups]
    fine = [rung for rung in outcome.rungs if rung.key != "hsd"]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.8, 0.36 * sum(heights) + 0.6), layout="constrained")
        grid = figure.subplots(
            len(groups), 2, height_ratios=heights, width_ratios=[1.5, 1.2], squeeze=False
        )
        for (every, enlarged), (title, rows) in zip(grid, groups, strict=True):
            for axes, rungs in ((every, outcome.rungs), (enlarged, fine)):
                _draw_rows(axes, rows, rungs)
            every.set_yticks(range(len(rows)), [row.name for row in rows])
            every.set_title(title, loc="left", fontsize=11)
            enlarged.set_yticks([])
            enlarged.set_title("without HSD, enlarged", loc="left", fontsize=11)
            reach = 1.15 * max(abs(limit) for limit in enlarged.get_xlim())
            enlarged.set_xlim(-reach, reach)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=3, fontsize=9)
        grid[-1, 0].set_xlabel("deviation from the simulated rig's truth / %   (bars: 95 %)")
        grid[-1, 1].set_xlabel("the same / %")
        figure.savefig(file)


def _draw_rows(axes: Axes, rows: Sequence[Row], rungs: Sequence[Rung]) -> None:
    """Draw each row's whiskers, one for each rung."""
    axes.axvline(0, color=TRUTH, lw=1.2)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    for rung in rungs:
        axes.plot([], [], _LOOK[rung.key][1], color=_LOOK[rung.key][0], ms=6, label=rung.name)
        for place, row in enumerate(rows):
            _whisker(axes, place, row, rung.key)


def _whisker(axes: Axes, place: int, row: Row, key: str) -> None:
    """Draw one estimate relative to its truth; nothing where it was withheld."""
    colour, marker, shift = _LOOK[key]
    estimate = row.estimates[key]
    if estimate is None:
        return
    low, high = (100 * (limit / row.truth_pa - 1) for limit in estimate.interval95_pa)
    middle = 100 * (estimate.value_pa / row.truth_pa - 1)
    height = place + shift
    axes.plot([low, high], [height, height], color=colour, lw=2, solid_capstyle="butt")
    axes.plot(middle, height, marker, color=colour, ms=5, mec="white")
