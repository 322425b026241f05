"""The style of every figure: fonts, greys, line styles, units."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl

INK, SOFT, PALE = "#202124", "#6f757d", "#e9ebee"
BEFORE, AFTER = "#b3491f", "#1558a8"
"""Two colours of different darkness; their lines differ in style too."""

WIDE = 7.2
"""Width of a figure over two columns of a journal. [inch]"""

MODELS: dict[str, dict[str, Any]] = {
    "hsd": {"color": BEFORE, "ls": (0, (4, 1.6)), "lw": 1.2},
    "kv": {"color": AFTER, "ls": (0, (1, 1)), "lw": 1.2},
    "kv2": {"color": AFTER, "ls": "-", "lw": 1.2},
}
_OTHERS = ("#4b7f52", "#7a4fa0", "#8a6d00")

# Any: matplotlib's own type names each of its hundreds of keys
LOOK: Any = {
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.5,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,  # letters stay letters: journals refuse Type 3 fonts
    "svg.fonttype": "none",
    "svg.hashsalt": "impactd",
}


def styled() -> AbstractContextManager[None]:
    """Return a context in which figures are made, and saved, in this look."""
    return mpl.rc_context(LOOK)


def line_of(model: str, place: int = 0) -> dict[str, Any]:
    """Return colour, style and width of a model's line, as keywords of ``Axes.plot``.

    The model is ``hsd``, ``kv`` or one with effects; ``place`` tells several with effects apart.
    """
    known = MODELS.get(model)
    if known is not None:
        return known
    return {"color": _OTHERS[place % len(_OTHERS)], "ls": (0, (6, 1.2, 1.2, 1.2)), "lw": 1.2}


@dataclass(frozen=True)
class Shown:
    """The unit a signal is drawn in."""

    signal: str
    residual: str
    """Unit on the axis of what is left of a signal."""
    factor: float
    """From the signal's unit to the residual's."""


_SHOWN = {
    "voltage": Shown("V", "mV", 1e3),
    "force_N": Shown("N", "N", 1.0),
    "acceleration_m_per_s2": Shown("m/s²", "m/s²", 1.0),
}
_MIXED = Shown("unit of the record", "unit of the record", 1.0)


def shown(quantities: set[str]) -> Shown:
    """Return the unit for recordings of these quantities.

    They are ``voltage``, ``force_N``, ``acceleration_m_per_s2``. If several are mixed, no unit is
    named.
    """
    return _SHOWN.get(next(iter(quantities)), _MIXED) if len(quantities) == 1 else _MIXED


def pair_words(sphere: str | None, surface: str | None) -> str:
    """Return a pair for a label; what is not known is left out."""
    names = [name for name in (sphere, surface) if name and name not in ("?", "None")]
    return " on ".join(names) or "unnamed pair"


def named_pair(name: str) -> str:
    """Return a pair ``sphere/surface`` for a label; what is not known is left out.

    A pair with a slash in one of its names ("POM 1/4 in") stays as it is.
    """
    sphere, _, surface = name.partition("/")
    if "/" in surface:
        return name
    return pair_words(sphere, surface)


def height_words(height_m: float | None) -> str:
    """Return a drop height for a label, empty when it is not known."""
    return "" if height_m is None else f"{height_m * 1e3:.1f} mm"
