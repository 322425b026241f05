"""Figs 2-4 of Maranzano & Hancock 2016 from its numbers, and recorded traces under a model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.diagnosis.document.residual import time_us
from analysis.errors import AnalysisError
from analysis.fit.result import FitResult
from analysis.fit.shot_fit import ShotFit
from analysis.paper import figures
from analysis.paper.contact import (
    FIG2_CELL,
    FIG2_DROP,
    TABLE3_CELL,
    Cell,
    contact_history,
    crystal_trace,
)
from analysis.plots.style import AFTER, BEFORE, INK, WIDE, line_of, pair_words, shown, styled

_SHADES = ("#9ec5f4", "#5a9be8", "#1c6dd0", "#0b3a75")
_STYLES: tuple[Any, ...] = ((0, (1.2, 1.2)), (0, (4, 1.4)), (0, (6, 1.2, 1.2, 1.2)), "-")
_AFTER_CONTACTS = 5.0
_COLUMNS = 3


def figure_2() -> Figure:
    """Draw Fig. 2: force, indentation and crystal for four restitutions."""
    with styled():
        figure = Figure(figsize=(WIDE, 2.6), layout="constrained")
        force, indentation, crystal = figure.subplots(1, 3, sharex=True)
        times = np.arange(0.0, 150e-6, 1e-7)
        looks = zip(figures.FIG2_RESTITUTIONS, _SHADES, _STYLES, strict=True)
        for eps, colour, style in looks:
            depth = contact_history(FIG2_DROP, eps, FIG2_CELL).indentation_at(times)
            look: Any = {"color": colour, "ls": style, "lw": 1.3, "label": f"ε = {eps:g}"}
            force.plot(times * 1e6, FIG2_DROP.stiffness * depth**1.5, **look)
            indentation.plot(times * 1e6, depth * 1e6, **look)
            trace = crystal_trace(FIG2_DROP, eps, FIG2_CELL, times)
            crystal.plot(times * 1e6, trace * 1e9, **look)
        force.set_ylabel("elastic force / N")
        indentation.set_ylabel("indentation / µm")
        crystal.set_ylabel("crystal compression / nm")
        force.legend(loc="upper right")
        for axes in (force, indentation, crystal):
            axes.set_xlabel("time after touch-down / µs")
            axes.set_xlim(0, 150)
        return figure


def figure_3() -> Figure:
    """Draw Fig. 3: how two crystals answer the same impact.

    They are the crystal of Fig. 2 and that of Table 3, with other dampings.
    """
    with styled():
        figure = Figure(figsize=(WIDE, 2.9), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        times = np.arange(0.0, 500e-6, 2e-7)
        cells = (("Fig. 2's crystal", FIG2_CELL), ("Table 3's crystal", TABLE3_CELL))
        for axes, (name, cell) in zip(panels, cells, strict=True):
            depth = contact_history(FIG2_DROP, 0.8, cell).indentation_at(times)
            axes.plot(times * 1e6, FIG2_DROP.stiffness * depth**1.5, color=INK, lw=1.6,
                      label="force on it")  # fmt: skip
            ratios = sorted({round(cell.damping_ratio, 3), 0.3, 1.0})
            looks = zip(ratios, (AFTER, "#5a9be8", "#9ec5f4"), ("-", *_STYLES[1::-1]), strict=True)
            for ratio, colour, style in looks:
                mu = 2 * ratio * math.sqrt(cell.stiffness_n_per_m * cell.mass_kg)
                damped = Cell(cell.mass_kg, cell.stiffness_n_per_m, mu)
                drawn = cell.stiffness_n_per_m * crystal_trace(FIG2_DROP, 0.8, damped, times)
                label = f"k times compression, damping ratio {ratio:g}"
                axes.plot(times * 1e6, drawn, color=colour, ls=style, lw=1.2, label=label)
            khz = cell.natural_frequency_hz / 1e3
            axes.set_title(f"{name}, {khz:.1f} kHz", loc="left")
            axes.set_xlabel("time after touch-down / µs")
            axes.legend(loc="upper right")
        panels[0].set_ylabel("force / N")
        return figure


def figure_4() -> Figure:
    """Draw Fig. 4: how far apart HSD and KV are in force, whatever the crystal.

    A map over the crystal's mass and stiffness, with lines that carry their numbers.
    """
    elastic, _, _ = figures.figure_4()
    with styled():
        figure = Figure(figsize=(4.4, 3.2), layout="constrained")
        axes = figure.subplots()
        masses_g = np.array(figures.FIG4_MASSES_KG) * 1e3
        stiffnesses = np.array(figures.FIG4_STIFFNESSES_N_PER_M) / 1e9
        levels = [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]
        filled = axes.contourf(masses_g, stiffnesses, elastic.T * 1e3, levels=levels, cmap="Blues")
        lines = axes.contour(
            masses_g, stiffnesses, elastic.T * 1e3, levels=levels[1::2], colors=INK, linewidths=0.6
        )
        axes.clabel(lines, fontsize=7)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis, ticks in ((axes.xaxis, (10, 20, 50, 100, 200)), (axes.yaxis, (0.2, 0.5, 1, 2))):
            axis.set_ticks(list(ticks), [f"{x:g}" for x in ticks])
            axis.set_minor_formatter("")
        axes.plot(35.4, 0.416, "o", color=BEFORE, mec="white", ms=6)
        axes.annotate("Table 3", (35.4, 0.416), (6, 5), textcoords="offset points", color=BEFORE)
        axes.set_xlabel("crystal mass / g")
        axes.set_ylabel("crystal stiffness / (GN/m)")
        axes.grid(visible=False)
        figure.colorbar(filled, label="largest |F_el(KV) − F_el(HSD)| / mN")
        return figure


def plot_traces(fit: FitResult) -> Figure:
    """Draw one model over recorded shots, a panel per pair, as the paper shows its fits.

    Returns
    -------
    matplotlib.figure.Figure
        From each pair the shot whose R² is its middle one.

    Raises
    ------
    AnalysisError
        If no shot could be fitted.
    """
    if not fit.shots:
        raise AnalysisError(f"There is no trace to draw: {fit.outcome.message}")
    pairs: dict[str, list[ShotFit]] = {}
    for one in fit.shots:
        pairs.setdefault(pair_words(one.item.shot.sphere, one.item.shot.surface), []).append(one)
    columns = min(_COLUMNS, len(pairs))
    rows = math.ceil(len(pairs) / columns)
    unit = shown({one.item.shot.quantity for one in fit.shots})
    with styled():
        figure = Figure(figsize=(WIDE, 1.6 * rows + 0.7), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False)
        for axes, name in zip(panels.flat, sorted(pairs), strict=False):
            middle = sorted(pairs[name], key=lambda one: one.r2)[len(pairs[name]) // 2]
            t, contact_us = time_us(middle), middle.contact_time_s * 1e6
            axes.plot(t, middle.item.window.signal, "o", color="#b4b8be", ms=3, mew=0)
            axes.plot(t, middle.prediction, **{**line_of(fit.model), "ls": "-", "lw": 1.0})
            axes.set_xlim(-0.5 * contact_us, min(_AFTER_CONTACTS * contact_us, float(t[-1])))
            axes.set_title(name, loc="left", fontsize=7.5)
            axes.annotate(f"R² {middle.r2:.4f}", (0.98, 0.9), xycoords="axes fraction", ha="right",
                          fontsize=7.5)  # fmt: skip
        for axes in panels.flat[len(pairs) :]:
            axes.set_visible(False)
        for axes in panels[:, 0]:
            axes.set_ylabel(f"signal / {unit.signal}")
        for place in range(max(0, len(pairs) - columns), len(pairs)):
            panels.flat[place].set_xlabel("time after touch-down / µs")
        figure.suptitle(
            f"{fit.model.upper()} (line) and records (dots)", x=0.01, ha="left", fontsize=9
        )
        return figure
