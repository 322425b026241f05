"""One shot: the record, the models over it, and the residual of each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.errors import AnalysisError
from analysis.fit.result import FitResult
from analysis.fit.shot_fit import ShotFit
from analysis.plots.style import (
    INK,
    PALE,
    SOFT,
    WIDE,
    Shown,
    height_words,
    line_of,
    pair_words,
    shown,
    styled,
)
from analysis.written_numbers import K_95, counted

BEFORE_SHARE, AFTER_SHARE = 0.7, 7.0
"""What is drawn before and after touch-down, in contact times."""
ROOM = 0.22
"""Free height above a residual, where its rms is written. [1]"""


def plot_shot(*fits: FitResult, shot: int | str = 0) -> Figure:
    """Draw a shot with the models fitted to it, and below it one residual per model.

    Parameters
    ----------
    *fits : FitResult
        Of the same campaign, one per model; the simplest first.
    shot : int or str, optional
        Place in the campaign's order, or the shot's name.

    Returns
    -------
    matplotlib.figure.Figure
        Time is 0 at the touch-down of the last fit; the grey band is one standard deviation of the
        noise before the trigger.

    Raises
    ------
    AnalysisError
        If no fit is given, or none has such a shot.
    """
    found = [(fit, one) for fit in fits if (one := _shot_of(fit, shot)) is not None]
    if not found:
        raise AnalysisError(
            f"There is no fitted shot {shot!r} to draw. {_why(fits)} Name a shot that the fit "
            "could use."
        )
    with styled():
        figure = Figure(figsize=(WIDE, 2.6 + 1.1 * len(found)), layout="constrained")
        panels = figure.subplots(
            1 + len(found), 1, sharex=True, height_ratios=[2.6, *[1.1] * len(found)]
        )
        _draw(panels, found)
        figure.align_ylabels()
        return figure


def _why(fits: tuple[FitResult, ...]) -> str:
    if not fits:
        return "No fit was given."
    names = [one.item.shot.name for one in fits[-1].shots]
    few = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
    return (
        f"The fit has {counted(len(names), 'shot')}: {few}."
        if names
        else "No shot could be fitted."
    )


def _shot_of(fit: FitResult, wanted: int | str) -> ShotFit | None:
    if isinstance(wanted, int):
        return fit.shots[wanted] if 0 <= wanted < len(fit.shots) else None
    return next((one for one in fit.shots if one.item.shot.name == wanted), None)


def _draw(panels: Any, found: list[tuple[FitResult, ShotFit]]) -> None:
    last = found[-1][1]
    contact_us = last.contact_time_s * 1e6
    low, high = -BEFORE_SHARE * contact_us, AFTER_SHARE * contact_us
    unit = shown({last.item.shot.quantity})
    upper = panels[0]
    t = _time_us(last, last)
    upper.plot(
        t, last.item.window.signal, "o", color="#b4b8be", ms=3.2, mew=0, label="measured", zorder=2
    )
    for place, (fit, one) in enumerate(found):
        label = f"{fit.model.upper()}{_modulus(fit, one)}"
        look = line_of(fit.model, place)
        own = _time_us(one, last)
        upper.plot(own, one.prediction, label=label, zorder=3, **look)
        _residual(panels[1 + place], (fit, one, own), look, unit)
    for axes in panels:
        axes.axvspan(0, contact_us, color=PALE, lw=0, zorder=0)
        axes.set_xlim(low, min(high, float(t[-1])))
    upper.set_ylabel(f"signal / {unit.signal}")
    upper.set_title(_title(last), loc="left")
    upper.legend(loc="upper right")
    panels[-1].set_xlabel("time after touch-down / µs   (shaded: contact)")


def _time_us(one: ShotFit, last: ShotFit) -> Any:
    """Return the samples' times on the clock of the last fit: models differ in their touch-down."""
    ahead = one.item.window.first - last.item.window.first
    step_us = 1e6 / last.item.frame.sample_rate_hz
    return (ahead + np.arange(one.prediction.size)) * step_us - float(last.own[2])


def _residual(axes: Axes, drawn: tuple[FitResult, ShotFit, Any], look: Any, unit: Shown) -> None:
    fit, one, t = drawn
    noise = one.item.noise.rms * unit.factor
    axes.axhspan(-noise, noise, facecolor="none", edgecolor=SOFT, hatch="////", lw=0, alpha=0.6)
    axes.plot(t, one.residual * unit.factor, **{**look, "lw": 0.8, "ls": "-"})
    axes.axhline(0, color=INK, lw=0.5)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + ROOM * (high - low))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, min_n_ticks=3))
    axes.set_ylabel(f"{fit.model.upper()[:12]} leaves\n/ {unit.residual}")
    axes.annotate(
        f"rms {one.rms * unit.factor:.3g} {unit.residual}; noise (hatched) {noise:.3g}",
        (0.995, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=7.5,
    )  # fmt: skip


def _modulus(fit: FitResult, one: ShotFit) -> str:
    """Return the pair's modulus with its 95 % interval, where the fit gives one."""
    found = fit.pair_modulus(one.item)
    if found is None:
        return ""
    value = math.exp(found[0]) / 1e9
    reach = K_95 * value * found[1]
    if not (math.isfinite(reach) and reach > 0):
        return ""
    digits = int(np.clip(1 - math.floor(math.log10(reach)), 0, 6))
    return f": E* {value:.{digits}f} ± {reach:.{digits}f} GPa (95 %)"


def _title(one: ShotFit) -> str:
    shot = one.item.shot
    parts = [shot.name, pair_words(shot.sphere, shot.surface), height_words(shot.drop_height_m)]
    flags = ", ".join(flag.replace("_", " ") for flag in one.flags())
    return ", ".join(part for part in parts if part) + (f"   [{flags}]" if flags else "")
