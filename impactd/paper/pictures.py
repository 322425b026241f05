"""The paper's figures, and three of ours: the closed model, the rigs' moduli and the valley."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from analysis.paper.valley import Valley
from analysis.plots.paper_figures import figure_2, figure_3, figure_4
from impactd.paper.pair_traces import FIGURE_PAIRS
from impactd.paper.rigs import RigFigures
from impactd.paper.source import over_literature, rows
from impactd.paper.trace_pictures import closed_figure, figure_of

NAMES = ("figure-2", "figure-3", "figure-4", *FIGURE_PAIRS, "closed", "tables-4-5", "valley")
INK, HSD, KV = "#202124", "#d9822b", "#1c6dd0"
_EDGE_PA = 29e9

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

    Returns
    -------
    dict of Path
        By the names of ``NAMES``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / f"paper-{name}.png" for name in NAMES}
    with mpl.rc_context(_STYLE):
        figure_2().savefig(paths["figure-2"])
        figure_3().savefig(paths["figure-3"])
        figure_4().savefig(paths["figure-4"])
        for name in FIGURE_PAIRS:
            figure_of(name).savefig(paths[name])
        closed_figure().savefig(paths["closed"])
        _moduli(rigs).savefig(paths["tables-4-5"])
        _valley(valley).savefig(paths["valley"])
    return paths


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
