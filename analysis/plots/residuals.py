"""The residuals of a campaign: one panel per pair, repetitions stacked, heights apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.aliases import Json
from analysis.diagnosis.document.residual import stacks_json
from analysis.errors import AnalysisError
from analysis.fit.result import FitResult
from analysis.plots.span import span_us
from analysis.plots.style import (
    AFTER,
    BEFORE,
    INK,
    PALE,
    SOFT,
    WIDE,
    Shown,
    height_words,
    named_pair,
    shown,
    styled,
)

MOST_COLUMNS = 3
_STYLES = ("-", (0, (4, 1.4)), (0, (1.2, 1.2)), (0, (6, 1.2, 1.2, 1.2)))
_BEFORE_AND_AFTER: tuple[dict[str, Any], ...] = (
    {"color": BEFORE, "ls": (0, (4, 1.4)), "lw": 1.0},
    {"color": AFTER, "ls": "-", "lw": 1.0},
)
"""How the residuals before and after a repair are drawn."""
_GREYS = ("#202124", "#5a7fb0", "#b3491f", "#8a8f98")


def plot_residuals(fit: FitResult) -> Figure:
    """Draw the stacked residual of a fitted campaign.

    Parameters
    ----------
    fit : FitResult
        With at least one shot.

    Returns
    -------
    matplotlib.figure.Figure
        One panel per pair, one line per drop height: the mean over repetitions.

    Raises
    ------
    AnalysisError
        If no shot could be fitted.
    """
    if not fit.shots:
        raise AnalysisError(f"There is no residual to draw: {fit.outcome.message}")
    unit = shown({one.item.shot.quantity for one in fit.shots})
    title = f"Residual of {fit.model.upper()}, mean over repetitions"
    return plot_stack(stacks_json(fit.shots), fit.noise_rms, title=title, unit=unit)


def plot_stack(
    stacks: Json,
    noise_rms: float,
    *,
    title: str,
    unit: Shown,
    wide: float = WIDE,
    span: tuple[float, float] | None = None,
) -> Figure:
    """Draw residuals that were stacked over repetitions, one panel per pair, one line per height.

    ``stacks`` is ``residual.*.stacks`` of ``impactd-diagnosis/1``; ``noise_rms`` is of one sample,
    as recorded, and hatched. The figure is ``wide`` inches; ``span`` says from when to when [us],
    by default what `span_us` finds.
    """
    span = span or span_us(stacks)
    with styled():
        curves = stacks["by_pair_and_height"]
        pairs = sorted({curve["pair"] for curve in curves})
        heights = sorted({curve["drop_height_m"] or 0.0 for curve in curves})
        columns, rows = _grid(len(pairs))
        figure = Figure(figsize=(wide, 1.5 * rows + 1.1), layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        looks = [_look(place) for place in range(len(heights))]
        for axes, pair in zip(panels.flat, pairs, strict=False):
            _frame(axes, stacks, noise_rms, unit, span)
            axes.set_title(named_pair(pair), loc="left", fontsize=7.5)
            for curve in (c for c in curves if c["pair"] == pair):
                look = looks[heights.index(curve["drop_height_m"] or 0.0)]
                axes.plot(*_line(stacks, curve, unit, span), **look)
        _finish(panels, len(pairs), unit)
        handles = [Line2D([], [], label=height_words(h), **look)
                   for h, look in zip(heights, looks, strict=True) if h]  # fmt: skip
        if handles:
            figure.legend(
                handles=handles, loc="outside lower center", ncols=min(5, len(handles)),
                title="drop height",
            )  # fmt: skip
        figure.suptitle(title + "   (hatched: noise of one sample)", x=0.01, ha="left", fontsize=9)
        return figure


def plot_diagnosis(document: Json) -> Figure:
    """Draw the residuals of the base model and of the found one.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.

    Returns
    -------
    matplotlib.figure.Figure
        One panel per pair, drawn from the drop height with the largest residual: dashed before,
        solid after. Below: the power density of both beside the noise.

    Raises
    ------
    AnalysisError
        If the diagnosis holds no residual.
    """
    before, after = document["residual"]["before"], document["residual"]["after"] or {}
    if not before.get("stacks"):
        raise AnalysisError(f"There is no residual to draw: {document['sentence']}")
    unit = shown(set(document["campaign"].get("quantities") or ["voltage"]))
    first, then = document["before"]["model"], document["after"]["model"]
    names = (first, then) if after.get("stacks") else (first,)
    span = span_us(before["stacks"])
    with styled():
        pairs = sorted({curve["pair"] for curve in before["stacks"]["by_pair_and_height"]})
        columns, rows = _grid(len(pairs))
        figure = Figure(figsize=(WIDE, 1.45 * rows + 3.0), layout="constrained")
        parts = np.asarray(figure.subfigures(2, 1, height_ratios=[1.45 * rows + 0.7, 2.3]))
        upper, lower = parts
        panels = upper.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, pair in zip(panels.flat, pairs, strict=False):
            height = _worst_height(before["stacks"], pair)
            _frame(axes, before["stacks"], document["noise_rms_V"], unit, span)
            axes.set_title(named_pair(pair), loc="left", fontsize=7.5)
            axes.annotate(height_words(height), (0.98, 0.04), xycoords="axes fraction", ha="right",
                          fontsize=7)  # fmt: skip
            for seen, look in zip((before, after), _BEFORE_AND_AFTER, strict=True):
                for curve in _curves(seen.get("stacks"), pair, height):
                    axes.plot(*_line(seen["stacks"], curve, unit, span), **look)
        _finish(panels, len(pairs), unit)
        handles = [
            Line2D([], [], label=f"{name} leaves", **look)
            for name, look in zip(names, _BEFORE_AND_AFTER, strict=False)
        ]
        upper.legend(handles=handles, loc="outside upper right", ncols=2)
        upper.suptitle(
            f"Verdict: {document['verdict']}   (hatched: noise of one sample)",
            x=0.01, ha="left", fontsize=9,
        )  # fmt: skip
        _spectra(lower.subplots(), before, after, names, unit)
        return figure


def draw_largest_residual(axes: Axes, document: Json) -> None:
    """Draw what both models leave of the pair and height that the base model misses most.

    Dashed before, solid after, mean over repetitions. The document has ``residual.before.stacks``.
    """
    before, after = document["residual"]["before"], document["residual"]["after"] or {}
    unit = shown(set(document["campaign"].get("quantities") or ["voltage"]))
    span = span_us(before["stacks"])
    worst = max(before["stacks"]["by_pair_and_height"], key=_mean_square)
    pair, height = worst["pair"], worst["drop_height_m"]
    _frame(axes, before["stacks"], document["noise_rms_V"], unit, span)
    for side, found, look in zip(
        ("before", "after"), (before, after), _BEFORE_AND_AFTER, strict=True
    ):
        for curve in _curves(found.get("stacks"), pair, height):
            label = f"{document[side]['model']} leaves"
            axes.plot(*_line(found["stacks"], curve, unit, span), label=label, **look)
    where = ", ".join(part for part in (named_pair(pair), height_words(height)) if part)
    axes.set_title(f"{where}   (grey: contact; hatched: noise of one sample)", loc="left")
    axes.set_xlabel("time after touch-down / µs")
    axes.set_ylabel(f"residual / {unit.residual}")
    axes.legend(loc="upper right")


def _grid(count: int) -> tuple[int, int]:
    columns = min(MOST_COLUMNS, count)
    return columns, math.ceil(count / columns)


def _look(place: int) -> dict[str, Any]:
    styles = len(_STYLES)
    return {
        "color": _GREYS[place % len(_GREYS)],
        "ls": _STYLES[place % styles],
        "lw": 0.9 + 0.5 * (place // styles),
    }


def _frame(
    axes: Axes, stacks: Json, noise_rms: float, unit: Shown, span: tuple[float, float]
) -> None:
    noise = noise_rms * unit.factor
    axes.axvspan(0, stacks["contact_us"], color=PALE, lw=0, zorder=0)
    axes.axhspan(-noise, noise, facecolor="none", edgecolor=SOFT, hatch="////", lw=0, alpha=0.6)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set_xlim(*span)


def _finish(panels: Any, used: int, unit: Shown) -> None:
    columns = panels.shape[1]
    for axes in panels.flat[used:]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel(f"residual / {unit.residual}")
    for place in range(max(0, used - columns), used):
        axes = panels.flat[place]
        axes.set_xlabel("time after touch-down / µs")
        axes.tick_params(labelbottom=True)


def _curves(stacks: Json | None, pair: str, height: float | None) -> list[Json]:
    if not stacks:
        return []
    return [c for c in stacks["by_pair_and_height"] if c["pair"] == pair and _same(c, height)]


def _same(curve: Json, height: float | None) -> bool:
    return math.isclose(curve["drop_height_m"] or 0.0, height or 0.0)


def _values(curve: Json) -> Any:
    return np.array([np.nan if v is None else v for v in curve["mean"]])


def _mean_square(curve: Json) -> float:
    return float(np.nanmean(_values(curve) ** 2))


def _worst_height(stacks: Json, pair: str) -> float | None:
    curves = [c for c in stacks["by_pair_and_height"] if c["pair"] == pair]
    worst = max(curves, key=_mean_square)
    height: float | None = worst["drop_height_m"]
    return height


def _line(stacks: Json, curve: Json, unit: Shown, span: tuple[float, float]) -> tuple[Any, Any]:
    t = np.array(stacks["time_us"])
    near = (t >= span[0]) & (t <= span[1])
    return t[near], _values(curve)[near] * unit.factor


def _spectra(axes: Axes, before: Json, after: Json, names: tuple[str, ...], unit: Shown) -> None:
    spectrum = before["spectrum"]
    khz = np.array(spectrum["frequency_Hz"]) / 1e3
    axes.loglog(khz, spectrum["noise"], color=SOFT, lw=4, alpha=0.45, label="noise")
    look: Any = {"color": BEFORE, "ls": (0, (4, 1.4)), "lw": 1.1}
    axes.loglog(khz, spectrum["residual"], label=f"{names[0]} leaves", **look)
    if after.get("spectrum"):
        repaired = after["spectrum"]
        x = np.array(repaired["frequency_Hz"]) / 1e3
        axes.loglog(x, repaired["residual"], color=AFTER, lw=1.1, label=f"{names[-1]} leaves")
    axes.set_xlabel("frequency / kHz")
    density = f"{unit.signal}²" if unit.signal.isalpha() else f"({unit.signal})²"
    axes.set_ylabel(f"power density / ({density}/Hz)")
    axes.legend()
