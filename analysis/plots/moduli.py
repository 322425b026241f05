"""The network of pairs, and each material's modulus against the stated one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis.aliases import Json
from analysis.campaign import Campaign, Quantity
from analysis.errors import AnalysisError
from analysis.plots.style import AFTER, INK, SOFT, WIDE, styled
from analysis.written_numbers import K_95, counted

_MARKS = {"fitted": "o", "reference": "s", "withheld": "X"}


def literature_of(campaign: Campaign) -> dict[str, Quantity]:
    """Return the Young's moduli that a campaign states, by material.

    Returns
    -------
    dict of Quantity
        Without those that are to be found. [Pa]
    """
    found: dict[str, Quantity] = {}
    for materials in (campaign.spheres, campaign.surfaces):
        for name, material in materials.items():
            if material.youngs_modulus_pa is not None:
                found[name] = material.youngs_modulus_pa
    return found


def plot_moduli(document: Json, literature: Mapping[str, Quantity] | None = None) -> Figure:
    """Draw which pairs were dropped, and what came out for each material.

    Parameters
    ----------
    document : dict
        ``impactd-fit/1``, or the ``before`` or ``after`` block of a diagnosis: ``moduli``, and
        ``pairs`` where it has them.
    literature : mapping of Quantity, optional
        Stated Young's moduli by material. [Pa]

    Returns
    -------
    matplotlib.figure.Figure
        Left: the network, a cell for each pair that met, with E* and the number of shots. Right:
        how far Young's modulus lies from the stated one, with its 95 % interval; the hatched bar
        is the stated one, two u to each side. What is stated nowhere stands as a number only.

    Raises
    ------
    AnalysisError
        If there is no modulus in it.
    """
    moduli = document.get("moduli") or {}
    if not any(entry.get("youngs_modulus_Pa") for entry in moduli.values()):
        raise AnalysisError(
            "There is no modulus to draw: all are withheld, or the recordings are in reduced "
            "units. A campaign needs masses, radii and one modulus that is known."
        )
    pairs = {
        (p["sphere"], p["surface"]): p
        for p in (document.get("pairs") or {}).values()
        if p.get("reduced_modulus_Pa")
    }
    spheres = len({sphere for sphere, _ in pairs})
    with styled():
        tall = max(0.34 * len(moduli) + 1.2, 0.56 * spheres + 1.3)
        figure = Figure(figsize=(WIDE if pairs else 0.6 * WIDE, tall), layout="constrained")
        if pairs:
            surfaces = len({surface for _, surface in pairs})
            widths = [0.6 + 0.22 * surfaces, 1.0]
            network, chart = figure.subplots(1, 2, width_ratios=widths)
            _network(network, pairs, moduli)
        else:
            chart = figure.subplots()
        _chart(chart, moduli, literature or {})
        return figure


def _network(axes: Axes, pairs: Mapping[tuple[str, str], Json], moduli: Json) -> None:
    spheres, surfaces = (sorted({pair[side] for pair in pairs}) for side in (0, 1))
    for y, sphere in enumerate(spheres):
        for x, surface in enumerate(surfaces):
            pair = pairs.get((sphere, surface))
            axes.add_patch(
                Rectangle(
                    (x - 0.5, y - 0.5),
                    1,
                    1,
                    fc="white",
                    ec=SOFT,
                    lw=0.6,
                    hatch=None if pair else "////",
                )
            )
            if pair:
                value = _said(pair["reduced_modulus_Pa"]).replace(" ±", "\n±")
                said = f"{value}\n{counted(pair['shots'], 'shot')}"
                axes.text(x, y, said, ha="center", va="center", fontsize=6.5, linespacing=1.3)
    axes.set_xlim(-0.5, len(surfaces) - 0.5)
    axes.set_ylim(len(spheres) - 0.5, -0.5)
    axes.set_xticks(range(len(surfaces)), [_named(n, moduli) for n in surfaces], fontsize=7)
    axes.set_yticks(range(len(spheres)), [_named(name, moduli) for name in spheres])
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title("E* / GPa ± 95 % (■ reference; hatched: did not meet)", loc="left", fontsize=7.5)


def _named(name: str, moduli: Json) -> str:
    reference = moduli.get(name, {}).get("status") == "reference"
    return name.replace("_", "\n") + (" ■" if reference else "")


def _chart(axes: Axes, moduli: Json, stated: Mapping[str, Quantity]) -> None:
    names = sorted(moduli, key=lambda n: _middle(moduli[n], stated.get(n)))
    axes.axvline(0, color=INK, lw=0.7)
    for y, name in enumerate(names):
        young, known = moduli[name].get("youngs_modulus_Pa"), stated.get(name)
        if known is not None:
            reach = 200 * known.u / known.value
            axes.barh(y, 2 * reach, left=-reach, height=0.6, facecolor="white", edgecolor=SOFT,
                      hatch="/////", lw=0.6, zorder=1)  # fmt: skip
        if known is not None and young:
            low, high = (100 * (limit / known.value - 1) for limit in young["interval95"])
            middle = 100 * (young["value"] / known.value - 1)
            axes.plot([low, high], [y, y], color=AFTER, lw=2.2, zorder=3, solid_capstyle="butt")
            axes.plot(middle, y, _MARKS[moduli[name]["status"]], color=AFTER, ms=5, mec="white",
                      zorder=4)  # fmt: skip
        said = f"{_said(young)} GPa" if young else "withheld"
        axes.annotate(said, (1.02, y), xycoords=("axes fraction", "data"), va="center",
                      fontsize=7.5, annotation_clip=False)  # fmt: skip
    axes.set_yticks(range(len(names)), [_named(name, moduli) for name in names])
    axes.set_ylim(-0.7, len(names) - 0.3)
    axes.margins(x=0.08)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("E over the stated value, less 1 / %")
    axes.set_title("E: bar 95 %; hatched: stated ± 2 u", loc="left", fontsize=7.5)


def _middle(entry: Json, known: Quantity | None) -> float:
    young = entry.get("youngs_modulus_Pa")
    return float(young["value"]) if young else known.value if known else 0.0


def _said(quantity: Json) -> str:
    value, reach = quantity["value"] / 1e9, K_95 * quantity["u"] / 1e9
    digits = int(np.clip(1 - np.floor(np.log10(reach)), 0, 6)) if reach > 0 else 3
    return f"{value:.{digits}f} ± {reach:.{digits}f}"
