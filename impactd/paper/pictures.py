"""The paper's figures from our model, and two of ours: the rigs' moduli and the valley."""

from __future__ import annotations

import math
import statistics
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from analysis.paper import figures
from analysis.paper.contact import (
    FIG2_CELL,
    FIG2_DROP,
    TABLE3_CELL,
    Cell,
    contact_history,
    crystal_trace,
)
from analysis.paper.valley import Valley
from impactd.paper.rigs import RigFigures
from impactd.paper.source import over_literature, rows

NAMES = ("figure-2", "figure-3", "figure-4", "tables-4-5", "valley")
INK, HSD, KV = "#202124", "#d9822b", "#1c6dd0"
_EDGE_PA = 29e9
_SHADES = ("#9ec5f4", "#5a9be8", "#1c6dd0", "#0b3a75")

# Any: matplotlib's own type names each of its hundreds of keys
_STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e6ea",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "savefig.dpi": 110,
}


def draw_all(folder: Path, rigs: RigFigures, valley: Valley) -> dict[str, Path]:
    """Draw every picture.

    Parameters
    ----------
    folder : Path
        Created if need be.
    rigs : RigFigures
        Of the simulated rigs.
    valley : Valley
        Of one shot.

    Returns
    -------
    dict of Path
        By the names of ``NAMES``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / f"paper-{name}.png" for name in NAMES}
    with mpl.rc_context(_STYLE):
        _figure_2().savefig(paths["figure-2"])
        _figure_3().savefig(paths["figure-3"])
        _figure_4().savefig(paths["figure-4"])
        _moduli(rigs).savefig(paths["tables-4-5"])
        _valley(valley).savefig(paths["valley"])
    return paths


def _figure_2() -> Figure:
    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    force, indentation, crystal = figure.subplots(1, 3, sharex=True)
    times = np.arange(0.0, 150e-6, 1e-7)
    for eps, colour in zip(figures.FIG2_RESTITUTIONS, _SHADES, strict=True):
        depth = contact_history(FIG2_DROP, eps, FIG2_CELL).indentation_at(times)
        look: Any = {"color": colour, "lw": 1.5, "label": f"eps {eps:g}"}
        force.plot(times * 1e6, FIG2_DROP.stiffness * depth**1.5, **look)
        indentation.plot(times * 1e6, depth * 1e6, **look)
        crystal.plot(times * 1e6, crystal_trace(FIG2_DROP, eps, FIG2_CELL, times) * 1e9, **look)
    force.set_ylabel("elastic force / N")
    indentation.set_ylabel("indentation / µm")
    crystal.set_ylabel("crystal compression / nm")
    force.legend(loc="upper right")
    for axes in (force, indentation, crystal):
        axes.set_xlabel("time since touch-down / µs")
        axes.set_xlim(0, 150)
    return figure


def _figure_3() -> Figure:
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    times = np.arange(0.0, 500e-6, 2e-7)
    cells = (("Fig. 2's crystal", FIG2_CELL), ("Table 3's crystal", TABLE3_CELL))
    for axes, (name, cell) in zip(panels, cells, strict=True):
        depth = contact_history(FIG2_DROP, 0.8, cell).indentation_at(times)
        axes.plot(
            times * 1e6, FIG2_DROP.stiffness * depth**1.5, color=INK, lw=1.5, label="force on it"
        )
        ratios = sorted({round(cell.damping_ratio, 3), 0.3, 1.0})
        for ratio, colour in zip(ratios, (KV, "#5a9be8", "#9ec5f4"), strict=True):
            mu = 2 * ratio * math.sqrt(cell.stiffness_n_per_m * cell.mass_kg)
            damped = Cell(cell.mass_kg, cell.stiffness_n_per_m, mu)
            shown = cell.stiffness_n_per_m * crystal_trace(FIG2_DROP, 0.8, damped, times)
            label = f"k times compression, damping ratio {ratio:g}"
            axes.plot(times * 1e6, shown, color=colour, lw=1.3, label=label)
        khz = cell.natural_frequency_hz / 1e3
        axes.set_title(f"{name}, {khz:.1f} kHz", loc="left", fontsize=9)
        axes.set_xlabel("time since touch-down / µs")
        axes.legend(loc="upper right", fontsize=8)
    panels[0].set_ylabel("N")
    return figure


def _figure_4() -> Figure:
    elastic, _, _ = figures.figure_4()
    figure = Figure(figsize=(5.2, 3.6), layout="constrained")
    axes = figure.subplots()
    masses_g = np.array(figures.FIG4_MASSES_KG) * 1e3
    stiffnesses = np.array(figures.FIG4_STIFFNESSES_N_PER_M) / 1e9
    levels = [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]
    filled = axes.contourf(masses_g, stiffnesses, elastic.T * 1e3, levels=levels, cmap="Blues")
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis, ticks in ((axes.xaxis, (10, 20, 50, 100, 200)), (axes.yaxis, (0.2, 0.5, 1, 2))):
        axis.set_ticks(list(ticks), [f"{x:g}" for x in ticks])
        axis.set_minor_formatter("")
    axes.plot(35.4, 0.416, "o", color=HSD, ms=6)
    axes.annotate("Table 3", (35.4, 0.416), (6, 5), textcoords="offset points", color=HSD)
    axes.set_xlabel("crystal mass / g")
    axes.set_ylabel("crystal stiffness / (GN/m)")
    axes.grid(visible=False)
    figure.colorbar(filled, label="largest |F_el(KV) - F_el(HSD)| / mN")
    return figure


def _moduli(rigs: RigFigures) -> Figure:
    pairs = list(rows("table5_kv"))
    theirs = {"HSD": over_literature("table4_hsd"), "KV": over_literature("table5_kv")}
    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, sharex=True)
    at = np.arange(len(pairs))[::-1]
    for name, colour, marker, shift in (("HSD", HSD, "s", -0.14), ("KV", KV, "o", 0.14)):
        known = [i for i, pair in enumerate(pairs) if pair in theirs[name]]
        values = [theirs[name][pairs[i]] for i in known]
        left.plot(values, at[known] + shift, marker, color=colour, ms=5, label=f"{name}, paper")
    looks = (
        ("hsd_onset", "HSD, touch-down at onset", "#f2c08d", "D", -0.22),
        ("hsd_aligned", "HSD, touch-down free", HSD, "s", 0.0),
        ("kv_joint", "KV, our joint fit", KV, "o", 0.22),
    )
    for way, label, colour, marker, shift in looks:
        ratios = [rigs.pairs[pair].ratio[way] for pair in pairs]
        right.errorbar(
            [statistics.fmean(r) for r in ratios],
            at + shift,
            xerr=[statistics.stdev(r) for r in ratios],
            fmt=marker,
            color=colour,
            ms=5,
            lw=1.2,
            label=label,
        )
    left.set_yticks(at, [" / ".join(pair) for pair in pairs])
    left.set_title("paper: E* over that of Tables 1-2", loc="left", fontsize=9)
    right.set_title("simulated rigs: E* over the true one", loc="left", fontsize=9)
    for axes in (left, right):
        axes.axvline(1.0, color=INK, lw=0.8)
        axes.set_xscale("log")
        axes.set_xlim(0.25, 2.5)
        axes.set_xticks([0.3, 0.5, 0.7, 1.0, 1.4, 2.0], ["0.3", "0.5", "0.7", "1", "1.4", "2"])
        axes.xaxis.set_minor_formatter("")
        axes.set_xlabel("ratio of reduced moduli")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=8)
    return figure


def _valley(valley: Valley) -> Figure:
    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    axes = figure.subplots()
    sphere, surface = valley.sphere_pa / 1e9, valley.surface_pa / 1e9
    shown = np.log10(np.maximum(valley.excess_chi2, 1.0))
    filled = axes.contourf(
        sphere, surface, shown, levels=np.arange(3, 9.1, 0.5), cmap="Blues_r", extend="both"
    )
    for number, end_point in enumerate(valley.ends):
        # one that ran off to infinity leaves the picture at its edge
        a, b, c, d = (min(x, _EDGE_PA) for x in end_point[:4])
        axes.annotate(
            "",
            (c / 1e9, d / 1e9),
            (a / 1e9, b / 1e9),
            arrowprops={"arrowstyle": "-|>", "color": HSD, "lw": 1.3},
        )
        start, end = ("start", "end") if number == 0 else (None, None)
        axes.plot(a / 1e9, b / 1e9, "o", color=HSD, ms=4, label=start)
        axes.plot(c / 1e9, d / 1e9, "o", mfc="white", mec=HSD, ms=5, label=end)
    reduced = valley.ends[0][4]
    line = sphere[sphere > valley.sphere_softness * reduced / 1e9 * 1.001]
    rest = 1e9 / reduced - valley.sphere_softness / line
    axes.plot(line, valley.surface_softness / rest, color=INK, lw=0.9, label="constant E*")
    paper = rows("table5_kv")["acetal", "polycarbonate"]
    axes.plot(paper.sphere_pa / 1e9, paper.surface_pa / 1e9, "*", color=INK, ms=9, label="Table 5")
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
        axis.set_minor_formatter("")
    axes.set_xlim(0.6, 30)
    axes.set_ylim(0.6, 30)
    axes.set_xlabel("E of the sphere (acetal) / GPa")
    axes.set_ylabel("E of the surface (polycarbonate) / GPa")
    axes.grid(visible=False)
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.85), fontsize=8)
    figure.colorbar(filled, label="log10 of excess chi2")
    return figure
