"""The pictures of a learned closure, each as one inline SVG."""

from __future__ import annotations

import math
import re
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from analysis.plots.style import height_words, named_pair
from impactd.aliases import Json
from impactd.diagnosis.figures import (
    AFTER,
    BEFORE,
    HEIGHTS,
    INK,
    LOOK,
    WIDE,
    svg,
)
from impactd.diagnosis.unit import Unit

SHALLOW = 0.25
"""Indentation from which the force is drawn to scale. [median largest indentation]"""
_MOMENT = re.compile(
    r"(?:lag (?P<lag>-?[\d.]+) us|(?P<at>-?[\d.]+) us after touch-down)(?: \[(?P<owner>.*)\])?$"
)


def course(coefficients: dict[str, float]) -> str | None:
    """Draw a closure whose coefficients belong to moments, over those moments.

    Parameters
    ----------
    coefficients : dict
        By label: ``150 us after touch-down [owner]`` or ``lag 20 us``.

    Returns
    -------
    str or None
        Data URI of an SVG; None where they belong to no moments.
    """
    lines: dict[str, list[tuple[float, float]]] = {}
    names = {}
    for label, value in coefficients.items():
        found = _MOMENT.match(label)
        if found:
            owner = found["owner"] or ""
            lines.setdefault(owner, []).append((float(found["at"] or found["lag"]), value))
            names[owner] = "time after touch-down" if found["at"] else "lag after the signal"
    if not lines or max(len(points) for points in lines.values()) < 4:
        return None
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 2.9), layout="constrained")
        axes = figure.subplots()
        axes.axhline(0, color=INK, lw=0.8)
        colours = mpl.colormaps[HEIGHTS](np.linspace(0.1, 0.85, len(lines)))
        for colour, (owner, points) in zip(colours, sorted(lines.items()), strict=True):
            t, y = zip(*sorted(points), strict=True)
            axes.plot(t, y, "o-", ms=3, color=colour, lw=1.2, label=_owner_words(owner))
        axes.set_xscale("symlog", linthresh=50)
        axes.set_xlim(left=0)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(f"{names[next(iter(lines))]} / µs")
        axes.set_ylabel("coefficient")
        if len(lines) > 1:
            axes.legend(fontsize=7, ncols=2)
        return svg(figure)


def _owner_words(owner: str) -> str:
    return named_pair(owner) if owner else ""


def closure(curves: Json, unit: Unit) -> str | None:
    """Draw what a learned closure leaves of one shot's residual, for each owner.

    Parameters
    ----------
    curves : dict
        ``closure.curves`` of a diagnosis.

    Returns
    -------
    str or None
        Data URI of an SVG; None where the closure has no curves.
    """
    shots = curves["shots"]
    if not shots:
        return None
    columns = min(3, len(shots))
    rows = math.ceil(len(shots) / columns)
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 2.1 * rows + 0.6), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, shot in zip(grid.flat, shots, strict=False):
            t, pulse, residual, added, left = (
                np.array([np.nan if v is None else v for v in shot[key]])
                for key in ("time_us", "pulse", "residual", "added", "left")
            )
            strong = t[np.nan_to_num(pulse) > 0.05 * np.nanmax(pulse)]
            near = (t > -0.7 * strong[-1]) & (t < max(7 * strong[-1], _until(t, added)))
            axes.plot(t[near], unit.factor * residual[near], color=BEFORE, lw=1.2, label="residual")
            rest = unit.factor * left[near]
            axes.plot(t[near], rest, color=AFTER, lw=1.2, label="with the closure")
            where = f"{named_pair(shot['pair'])} {height_words(shot['drop_height_m'])}"
            axes.set_title(where, loc="left", fontsize=8)
        for axes in list(grid.flat)[len(shots) :]:
            axes.set_visible(False)
        for axes in grid[:, 0]:
            axes.set_ylabel(unit.label)
        for axes in grid[-1]:
            axes.set_xlabel("time after touch-down / µs")
        grid.flat[0].legend(fontsize=7)
        return svg(figure)


def _until(t: Any, added: Any) -> float:
    """Return when what a closure adds to a shot is over, a tenth of its most being nothing."""
    size = np.abs(np.nan_to_num(added))
    return 1.1 * float(t[size >= 0.1 * size.max()][-1])


def force(curves: Json) -> str | None:
    """Draw a contact closure's force over indentation, loading and unloading.

    Parameters
    ----------
    curves : dict
        ``closure.curves`` of a diagnosis.

    Returns
    -------
    str or None
        Data URI of an SVG; None where the closure is no contact force.
    """
    law = curves["force"]
    if law is None:
        return None
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 3.2), layout="constrained")
        axes = figure.subplots()
        colours = mpl.colormaps[HEIGHTS](np.linspace(0.1, 0.85, len(law["curves"])))
        deep = np.array(law["indentation"]) > SHALLOW
        reach = 0.0
        for colour, curve in zip(colours, law["curves"], strict=True):
            for share, line, when in zip(
                curve["share"], ("-", ":", "--"), ("loading", "at rest", "unloading"), strict=True
            ):
                label = f"{_owner_words(curve['owner'])} {when}".strip()
                values = 100 * np.array([np.nan if v is None else v for v in share])
                reach = max(reach, float(np.nanmax(np.abs(values[deep]))))
                axes.plot(law["indentation"], values, line, color=colour, lw=1.2, label=label)
        if reach > 0:  # near touch-down the elastic force vanishes, and any share of it diverges
            axes.set_ylim(-1.3 * reach, 1.3 * reach)
        axes.axhline(0, color=INK, lw=0.8)
        axes.set_xlabel("indentation / median largest indentation")
        axes.set_ylabel("added to the elastic force / %")
        axes.legend(fontsize=7)
        return svg(figure)
