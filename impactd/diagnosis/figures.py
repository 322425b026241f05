"""The pictures of a diagnosis, each as one inline SVG."""

from __future__ import annotations

import base64
import io
import math
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from impactd.diagnosis.unit import Unit

Json = dict[str, Any]

BEFORE, AFTER, NOISE, INK = "#c4572c", "#1c6dd0", "#8a8f98", "#202124"
"""Colours that stay apart in grey and for the colour-blind."""
HEIGHTS = "viridis"
WIDE = 9.9
"""Width of every picture, so that letters come out equally large. [inch]"""
SHOWN = (-0.7, 7.0)
"""What of a stack is drawn, in contact times."""

# Any: matplotlib's own type names each of its hundreds of keys
LOOK: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e6ea",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "svg.hashsalt": "impactd",
}


def stacked(stacks: Json, noise_rms: float, title: str, unit: Unit) -> str:
    """Draw the residual of each pair against time after touch-down, one curve per height.

    Parameters
    ----------
    stacks : dict
        ``residual.*.stacks`` of a diagnosis.
    noise_rms : float
        Drawn as a band. [as recorded]
    title : str
        Over the picture.
    unit : Unit
        To show the residual in.

    Returns
    -------
    str
        Data URI of an SVG.
    """
    curves = stacks["by_pair_and_height"]
    pairs = sorted({curve["pair"] for curve in curves})
    heights = sorted({curve["drop_height_m"] or 0.0 for curve in curves})
    columns = min(3, len(pairs))
    rows = math.ceil(len(pairs) / columns)
    t = np.array(stacks["time_us"])
    low, high = (share * stacks["contact_us"] for share in SHOWN)
    near = (t >= low) & (t <= high)
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 1.75 * rows + 1.1), layout="constrained")
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        colours = mpl.colormaps[HEIGHTS](np.linspace(0.85, 0.1, len(heights)))
        for axes, pair in zip(grid.flat, pairs, strict=False):
            axes.axhspan(-noise_rms * unit.factor, noise_rms * unit.factor, color="#eef0f3", lw=0)
            axes.axvspan(0, stacks["contact_us"], color="#f6efe6", lw=0)
            for curve in (c for c in curves if c["pair"] == pair):
                y = np.array([np.nan if v is None else v for v in curve["mean"]]) * unit.factor
                place = heights.index(curve["drop_height_m"] or 0.0)
                axes.plot(t[near], y[near], color=colours[place], lw=1.1)
            axes.set_title(pair_words(pair), loc="left", fontsize=9)
            axes.set_xlim(low, high)
        for axes in list(grid.flat)[len(pairs) :]:
            axes.set_visible(False)
        for axes in grid[:, 0]:
            axes.set_ylabel(f"residual / {unit.label}")
        for axes in grid[-1]:
            axes.set_xlabel("time after touch-down / µs")
        if len(heights) > 1:
            lines = [Line2D([], [], color=colour, label=height_words(height))
                     for colour, height in zip(colours, heights, strict=True)]  # fmt: skip
            figure.legend(handles=lines, loc="outside upper right", ncols=7, fontsize=8)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        return svg(figure)


def in_time(stacks: Json, unit: Unit) -> str | None:
    """Draw the mean residual of early, middle and late shots.

    Parameters
    ----------
    stacks : dict
        ``residual.*.stacks`` of a diagnosis.
    unit : Unit
        To show the residual in.

    Returns
    -------
    str or None
        Data URI of an SVG; None where the order was not looked at.
    """
    parts = stacks.get("by_order") or []
    if len(parts) < 2:
        return None
    t = np.array(stacks["time_us"])
    low, high = (share * stacks["contact_us"] for share in SHOWN)
    near = (t >= low) & (t <= high)
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 2.7), layout="constrained")
        axes = figure.subplots()
        axes.axvspan(0, stacks["contact_us"], color="#f6efe6", lw=0)
        colours = mpl.colormaps[HEIGHTS](np.linspace(0.85, 0.1, len(parts)))
        for colour, part in zip(colours, parts, strict=True):
            y = np.array([np.nan if v is None else v for v in part["mean"]]) * unit.factor
            label = f"{part['part']} ({part['shots']} shots)"
            axes.plot(t[near], y[near], color=colour, lw=1.2, label=label)
        axes.set_xlabel("time after touch-down / µs")
        axes.set_ylabel(f"residual / {unit.label}")
        axes.legend(fontsize=8)
        return svg(figure)


def height_words(height_m: float | None) -> str:
    """Return a drop height for a label.

    Parameters
    ----------
    height_m : float or None
        [m]

    Returns
    -------
    str
        In mm; empty for an unknown one.
    """
    return "" if height_m is None else f"{height_m * 1e3:.1f} mm"


def pair_words(pair: str) -> str:
    """Return a pair for a label.

    Parameters
    ----------
    pair : str
        ``sphere/surface``; ``?`` or ``None`` for a name that is not known.

    Returns
    -------
    str
        The same; ``unnamed`` for each unknown name.
    """
    names = ["unnamed" if name in ("?", "None", "") else name for name in pair.split("/")]
    return "unnamed pair" if set(names) == {"unnamed"} else "/".join(names)


def spectra(before: Json, after: Json | None, unit: Unit) -> str:
    """Draw the residual's power density before and after beside the noise's.

    Parameters
    ----------
    before : dict
        ``residual.before.spectrum`` of a diagnosis.
    after : dict or None
        The same after the repair.
    unit : Unit
        To show the power density in.

    Returns
    -------
    str
        Data URI of an SVG.
    """
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 3.2), layout="constrained")
        axes = figure.subplots()
        f = np.array(before["frequency_Hz"]) / 1e3
        axes.loglog(f, before["noise"], color=NOISE, lw=5, alpha=0.45, label="noise")
        axes.loglog(f, before["residual"], color=BEFORE, lw=1.5, label="residual before")
        if after is not None:
            x = np.array(after["frequency_Hz"]) / 1e3
            axes.loglog(x, after["residual"], color=AFTER, lw=1.5, label="residual after")
        axes.set_xlabel("frequency / kHz")
        axes.set_ylabel(f"power density / ({unit.density})")
        axes.legend(fontsize=8)
        return svg(figure)


def moduli(before: Json, after: Json) -> str | None:
    """Draw each modulus after the repair relative to before, both with 95 % intervals.

    Parameters
    ----------
    before, after : dict
        ``moduli`` of both blocks of a diagnosis.

    Returns
    -------
    str or None
        Data URI of an SVG; None where nothing is known on both sides.
    """
    names = [n for n in before if _known(before[n]) and _known(after.get(n, {}))]
    if not names:
        return None
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 0.4 * len(names) + 1.1), layout="constrained")
        axes = figure.subplots()
        axes.axvline(0, color=INK, lw=1)
        for place, name in enumerate(names):
            reference = before[name]["plane_strain_modulus_Pa"]["value"]
            _whisker(axes, place - 0.15, before[name], reference, look=(BEFORE, "s"))
            _whisker(axes, place + 0.15, after[name], reference, look=(AFTER, "o"))
        for label, (colour, marker) in (("before", (BEFORE, "s")), ("after", (AFTER, "o"))):
            axes.plot([], [], marker, color=colour, label=label)
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("E/(1-ν²) relative to the base model's value / %   (bars: 95 %)")
        axes.legend(fontsize=8)
        return svg(figure)


def _known(entry: Json) -> bool:
    return bool(entry.get("plane_strain_modulus_Pa"))


def _whisker(
    axes: Axes, height: float, entry: Json, reference: float, *, look: tuple[str, str]
) -> None:
    colour, marker = look
    plane = entry["plane_strain_modulus_Pa"]
    low, high = (100 * (limit / reference - 1) for limit in plane["interval95"])
    axes.plot([low, high], [height, height], color=colour, lw=2, solid_capstyle="butt")
    middle = 100 * (plane["value"] / reference - 1)
    axes.plot(middle, height, marker, color=colour, ms=5, mec="white")


def svg(figure: Figure) -> str:
    """Return a figure as a data URI.

    Parameters
    ----------
    figure : Figure
        Drawn.

    Returns
    -------
    str
        Of an SVG that is the same for the same figure.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(drawn.getvalue()).decode()}"
