"""The confusion matrix of a blind trial."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis.aliases import Json
from analysis.errors import AnalysisError
from analysis.plots.style import INK, styled


def plot_confusion(matrix: Json, which: str = "detectable") -> Figure:
    """Draw a confusion matrix: rows are the true effects, columns the verdicts.

    Parameters
    ----------
    matrix : dict
        ``impactd-blind-confusion/1``.
    which : str, optional
        ``detectable``: draws that the noise does not hide; ``all``: every draw.

    Returns
    -------
    matplotlib.figure.Figure
        The darker, the larger the share of the row; each cell has its count, and a cell in which
        the truth was named alone is framed.

    Raises
    ------
    AnalysisError
        If ``which`` is neither, or the matrix has no trial.
    """
    if which not in matrix["counts"]:
        raise AnalysisError(f"There are no counts of {which!r}; ask for 'detectable' or 'all'.")
    counts = np.array(matrix["counts"][which], dtype=float)
    if not counts.size or not counts.any():
        raise AnalysisError(f"There is no trial among {which!r} to draw.")
    rows, columns = counts.sum(axis=1) > 0, counts.sum(axis=0) > 0
    counts = counts[rows][:, columns]
    acted = [name for name, kept in zip(matrix["rows"], rows, strict=True) if kept]
    said = [name for name, kept in zip(matrix["columns"], columns, strict=True) if kept]
    with styled():
        figure = Figure(
            figsize=(1.9 + 0.24 * len(said), 1.9 + 0.2 * len(acted)), layout="constrained"
        )
        axes = figure.subplots()
        shares = counts / counts.sum(axis=1, keepdims=True)
        axes.imshow(shares, cmap="Greys", vmin=0.0, vmax=1.3, aspect="auto")
        for y, x in zip(*np.nonzero(counts), strict=True):
            dark = shares[y, x] > 0.6
            axes.text(x, y, f"{counts[y, x]:.0f}", ha="center", va="center", fontsize=7,
                      color="white" if dark else INK)  # fmt: skip
        for y, truth in enumerate(acted):
            right = "adequate" if truth == "none" else truth
            for x, name in enumerate(said):
                if name == right:
                    axes.add_patch(_frame(x, y))
        axes.set_xticks(range(len(said)), said, rotation=90, fontsize=7)
        axes.set_yticks(range(len(acted)), acted, fontsize=7)
        axes.set_xlabel("said")
        axes.set_ylabel("acted")
        axes.grid(visible=False)
        axes.set_title(
            f"{counts.sum():.0f} {'' if which == 'all' else which + ' '}draws: counts, shaded by "
            "share of the row;\nframed: named rightly and alone",
            loc="left",
        )
        return figure


def _frame(x: int, y: int) -> Rectangle:
    return Rectangle((x - 0.5, y - 0.5), 1, 1, fill=False, ec=INK, lw=1.6)
