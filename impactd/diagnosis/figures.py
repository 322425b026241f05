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
from matplotlib.layout_engine import ConstrainedLayoutEngine

from analysis.plots.residuals import plot_stack
from analysis.plots.span import span_us
from analysis.plots.style import Shown, styled
from analysis.written_numbers import counted
from impactd.aliases import Json
from impactd.diagnosis.set_aside import shot_words
from impactd.diagnosis.unit import Unit

BEFORE, AFTER, NOISE, INK = "#c4572c", "#1c6dd0", "#8a8f98", "#202124"
"""Colours that stay apart in grey and for the colour-blind."""
HEIGHTS = "viridis"
WIDE = 9.9
"""Width of every picture, so that letters come out equally large. [inch]"""

MOST_SET_ASIDE = 6
"""Pictures of shots that do not belong: two rows of three; more push the result off the screen."""
NAME = 40
"""Longest name over one of three pictures in a row. [characters]"""

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


def stacked(
    stacks: Json, noise_rms: float, title: str, unit: Unit, span: tuple[float, float]
) -> str:
    """Draw the residual of each pair against time after touch-down, one curve per height.

    Parameters
    ----------
    stacks : dict
        ``residual.*.stacks`` of a diagnosis.
    noise_rms : float
        Of one sample, hatched. [as recorded]
    span : tuple of float
        From when to when. [us]
    """
    drawn_in = Shown(unit.label, unit.label, unit.factor)
    with styled():
        return svg(plot_stack(stacks, noise_rms, title=title, unit=drawn_in, wide=WIDE, span=span))


def in_time(stacks: Json, unit: Unit) -> str | None:
    """Draw the mean residual of early, middle and late shots.

    Parameters
    ----------
    stacks : dict
        ``residual.*.stacks`` of a diagnosis.

    Returns
    -------
    str or None
        Data URI of an SVG; None where the order was not looked at.
    """
    parts = stacks.get("by_order") or []
    if len(parts) < 2:
        return None
    t = np.array(stacks["time_us"])
    low, high = span_us(stacks)
    near = (t >= low) & (t <= high)
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDE, 2.7), layout="constrained")
        axes = figure.subplots()
        axes.axvspan(0, stacks["contact_us"], color="#f6efe6", lw=0)
        colours = mpl.colormaps[HEIGHTS](np.linspace(0.85, 0.1, len(parts)))
        for colour, part in zip(colours, parts, strict=True):
            y = np.array([np.nan if v is None else v for v in part["mean"]]) * unit.factor
            label = f"{part['part']} ({counted(part['shots'], 'shot')})"
            axes.plot(t[near], y[near], color=colour, lw=1.2, label=label)
        axes.set_xlabel("time after touch-down / µs")
        axes.set_ylabel(f"residual / {unit.label}")
        axes.legend(fontsize=8)
        return svg(figure)


def spectra(before: Json, after: Json | None, unit: Unit) -> str:
    """Draw the residual's power density before and after, and the noise's.

    Parameters
    ----------
    before : dict
        ``residual.before.spectrum`` of a diagnosis.
    after : dict or None
        The same after the repair.
    unit : Unit
        To show the power density in.
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


def set_aside_shots(shots: list[Json], noise_rms: float, unit: Unit) -> str | None:
    """Draw shots that do not belong, each over what the model makes of it as it is labelled.

    Parameters
    ----------
    shots : list of dict
        Of ``set_aside`` of a diagnosis, with ``curves``; the first `MOST_SET_ASIDE` are drawn.
    noise_rms : float
        Of one sample, in grey. [as recorded]

    Returns
    -------
    str or None
        Data URI of an SVG; None where there are none.
    """
    drawn = shots[:MOST_SET_ASIDE]
    if not drawn:
        return None
    columns = min(3, len(drawn))
    rows = math.ceil(len(drawn) / columns)
    with mpl.rc_context(LOOK):
        apart = ConstrainedLayoutEngine(h_pad=0.08)  # one shot's axis from the next one's name
        figure = Figure(figsize=(WIDE, 3.3 * rows), layout=apart)
        grid = figure.subplots(
            2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1] * rows}
        )
        for place, shot in enumerate(drawn):
            row, column = divmod(place, columns)
            _set_aside_shot(grid[2 * row : 2 * row + 2, column], shot, noise_rms, unit)
        for place in range(len(drawn), rows * columns):
            for axes in grid[2 * rows - 2 :, place % columns]:
                axes.set_visible(False)
        for row in range(rows):
            grid[2 * row, 0].set_ylabel(f"signal / {unit.label}")
            grid[2 * row + 1, 0].set_ylabel(f"left / {unit.label}")
        grid[0, 0].legend(fontsize=8, loc="upper right")
        figure.align_ylabels(grid[:, 0])
        return svg(figure)


def _set_aside_shot(pair: Any, shot: Json, noise_rms: float, unit: Unit) -> None:
    t, signal, labelled = (
        np.array([np.nan if v is None else v for v in shot["curves"][key]])
        for key in ("time_us", "signal", "as_labelled")
    )
    signal, labelled = unit.factor * signal, unit.factor * labelled
    above, below = pair
    above.plot(t, signal, color=INK, lw=1.2, label="record")
    above.plot(t, labelled, color=BEFORE, lw=1.2, ls=(0, (4, 1.6)), label="model, as labelled")
    above.tick_params(labelbottom=False)
    said = shot_words(shot)
    above.set_title(said if len(said) <= NAME else f"{said[: NAME - 1]}…", loc="left", fontsize=8)
    noise = unit.factor * noise_rms
    below.axhspan(-noise, noise, color=NOISE, alpha=0.45, lw=0)
    below.plot(t, signal - labelled, color=BEFORE, lw=1)
    below.set_xlabel("time in the record / µs")
    below.sharex(above)


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

    Returns
    -------
    str
        Of an SVG that is the same for the same figure.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(drawn.getvalue()).decode()}"
