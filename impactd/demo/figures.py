"""The pictures of the demo: one trace with both models, and every modulus against the truth."""

from __future__ import annotations

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
from impactd.demo.outcome import Estimate, Outcome, Row

MEASURED, HSD, KV, TRUTH = "#8a8f98", "#d9822b", "#1c6dd0", "#202124"
"""Colours that stay apart in grey and for the colour-blind."""

_BEFORE_US, _AFTER_US = 60.0, 560.0
"""What of a shot is drawn: the pulse and most of the ring. [us]"""

_LOOK = {"HSD": (HSD, "s", -0.16), "KV": (KV, "o", 0.16)}
"""Colour, marker and shift of each model's whiskers."""

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


def draw_trace(file: Path, campaign: Campaign, title: str) -> None:
    """Draw one shot with both fitted models and what they leave over.

    Parameters
    ----------
    file : Path
        PNG to write.
    campaign : Campaign
        With exactly one shot.
    title : str
        Over the picture.
    """
    (shot,) = campaign.shots
    fits = {model.upper(): fit_campaign(campaign, model).shots for model in ("hsd", "kv")}
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 5.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1.35])
        for name, fitted in fits.items():
            for fit in fitted:  # none where the model cannot be evaluated on this shot
                colour, label = _LOOK[name][0], f"{name}, residual {fit.rms * 1e3:.1f} mV rms"
                upper.plot(
                    _time_us(fit), fit.prediction, color=colour, lw=1.3, label=label, zorder=3
                )
                lower.plot(_time_us(fit), fit.residual * 1e3, color=colour, lw=1.0)
        touch = _touch_down(shot, fits["KV"])
        measured_us = (np.arange(shot.signal.size) - touch) / shot.sample_rate_hz * 1e6
        near = (measured_us > -_BEFORE_US) & (measured_us < _AFTER_US)
        upper.plot(
            measured_us[near], shot.signal[near], ".", color=MEASURED, ms=5, label="measured"
        )
        upper.set_ylabel("signal / V")
        upper.set_title(title, loc="left", fontsize=11)
        upper.legend(loc="upper right")
        lower.set_ylabel("residual / mV")
        lower.set_xlabel("time since touch-down / µs")
        lower.set_xlim(-_BEFORE_US, _AFTER_US)
        figure.savefig(file)


def _touch_down(shot: Shot, fitted: Sequence[ShotFit]) -> float:
    """Return where the sphere touched, in samples: as fitted, or the trigger."""
    for fit in fitted:
        return float(fit.to_json()["touch_down_s"]["value"]) * shot.sample_rate_hz
    return float(shot.trigger_index)


def _time_us(fit: ShotFit) -> NDArray[np.float64]:
    """Return each fitted sample's time since touch-down. [us]"""
    samples = fit.item.window.first + np.arange(fit.item.window.signal.size)
    touch = _touch_down(fit.item.shot, [fit])
    return np.asarray((samples - touch) / fit.item.shot.sample_rate_hz * 1e6, dtype=np.float64)


def draw_moduli(file: Path, outcome: Outcome) -> None:
    """Draw every modulus as its deviation from the truth, with its 95 % interval.

    Parameters
    ----------
    file : Path
        PNG to write.
    outcome : Outcome
        Pairs and materials.
    """
    groups = [("reduced modulus E* of each pair", outcome.pairs)]
    if outcome.materials:
        groups.append(("Young's modulus of each material", outcome.materials))
    heights = [len(rows) + 1.2 for _, rows in groups]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.6, 0.4 * sum(heights) + 0.6), layout="constrained")
        grid = figure.subplots(
            len(groups), 2, height_ratios=heights, width_ratios=[1.7, 1], squeeze=False
        )
        for (both, alone), (title, rows) in zip(grid, groups, strict=True):
            for axes in (both, alone):
                axes.axvline(0, color=TRUTH, lw=1.2)
                axes.set_ylim(len(rows) - 0.4, -0.6)
                axes.grid(visible=False, axis="y")
            for place, row in enumerate(rows):
                _whisker(both, place, row, "HSD", row.hsd)
                _whisker(both, place, row, "KV", row.kv)
                _whisker(alone, place, row, "KV", row.kv)
            both.set_yticks(range(len(rows)), [row.name for row in rows])
            both.set_title(title, loc="left", fontsize=11)
            alone.set_yticks([])
            alone.set_title("KV, enlarged", loc="left", fontsize=11, color=KV)
            reach = 1.15 * max(abs(limit) for limit in alone.get_xlim())
            alone.set_xlim(-reach, reach)
        grid[0, 0].legend(loc="center right")
        grid[-1, 0].set_xlabel("deviation from the simulated rig's truth / %   (bars: 95 %)")
        grid[-1, 1].set_xlabel("the same / %")
        figure.savefig(file)


def _whisker(axes: Axes, place: int, row: Row, model: str, estimate: Estimate | None) -> None:
    """Draw one estimate relative to its truth."""
    colour, marker, shift = _LOOK[model]
    if estimate is None:
        axes.text(0, place + shift, "  withheld", va="center", color=colour, fontsize=8)
        return
    low, high = (100 * (limit / row.truth_pa - 1) for limit in estimate.interval95_pa)
    middle = 100 * (estimate.value_pa / row.truth_pa - 1)
    height = place + shift
    axes.plot([low, high], [height, height], color=colour, lw=2, solid_capstyle="butt")
    label = model if place == 0 else None
    axes.plot(middle, height, marker, color=colour, ms=6, mec="white", label=label)
