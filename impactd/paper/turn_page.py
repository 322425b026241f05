"""The tables of the section "The paper as one diagnosis", from what the turns found."""

from __future__ import annotations

import math

from impactd.aliases import Json
from impactd.paper.source import paper_moduli, tables
from impactd.paper.turn import TO_BE_FOUND, Rung, Turn

LADDER_HEADINGS = (
    "model",
    "residual / mV",
    "held out / mV",
    "R2",
    "R2, paper's calibrations (Table 3)",
    "R2, paper's pairs (Tables 4-5)",
)
_PAPER_R2 = {"hsd": ("table4_hsd", "0.48"), "kv": ("table5_kv", "0.86")}


def ladder_rows(turn: Turn) -> list[list[str]]:
    """Return one row of text per model, the paper's R2 beside those that it has."""
    found = []
    for rung in turn.rungs:
        paper = ["-", "-"]
        if rung.model in _PAPER_R2:
            mean, std = tables()["load_cell"][rung.model]["r_squared"]
            paper = [f"{mean:.2f} ± {std:.2f}", _PAPER_R2[rung.model][1]]
        left = [f"{1e3 * rung.rms_v:.4g}", f"{1e3 * rung.heldout_rms_v:.4g}"]
        found.append([shown_model(rung.model), *left, short_of_one(rung.r2), *paper])
    return found


def shown_model(name: str) -> str:
    """Return a model's name as the paper writes its bases: ``KV + echo``."""
    base, *effects = name.split("+")
    return " + ".join([base.upper(), *effects])


def short_of_one(r2: float) -> str:
    """Return an R2 with two digits of what it lacks."""
    lacks = 1.0 - r2
    return f"{r2:.2f}" if lacks > 0.05 else f"{r2:.{max(2, 1 - math.floor(math.log10(lacks)))}f}"


def moduli_headings(turn: Turn, *, with_paper: bool) -> list[str]:
    """Return the headings of `moduli_rows`."""
    paper = ["HSD, paper", "KV, paper"] if with_paper else []
    return ["E / GPa", *paper, *(shown_model(r.model) for r in turn.rungs), "true"]


def moduli_rows(turn: Turn, *, with_paper: bool) -> list[list[str]]:
    """Return one row of text per material: the paper's range over pairs, each rung's, the truth.

    Parameters
    ----------
    with_paper : bool
        Whether Tables 4 and 5 stand beside it.

    Returns
    -------
    list of list of str
        Materials that nobody stated are bold and come first.
    """
    rows = []
    for name in sorted(turn.true_moduli_pa, key=lambda n: (not _is_sought(n), n)):
        entry = turn.rungs[0].moduli[name]
        side, plain = entry["side"], name.rpartition(":")[2]
        shown = f"{side} {plain}"
        cells = [f"**{shown}**" if _is_sought(name) else shown]
        if with_paper:
            cells += [_range(table, side, plain) for table in ("table4_hsd", "table5_kv")]
        cells += [_stated(rung.moduli.get(name)) for rung in turn.rungs]
        rows.append([*cells, f"{turn.true_moduli_pa[name][0] / 1e9:.4g}"])
    return rows


def worst_error(turn: Turn, rung: Rung) -> float:
    """Return how far the sought E/(1 - nu^2) that is furthest off is from its true value. [1]

    Not of E: what nu adds to its error is no matter of the model.
    """
    errors = []
    for name, (_, true) in turn.true_moduli_pa.items():
        found = rung.moduli[name]["plane_strain_modulus_Pa"]
        if _is_sought(name) and found is not None:
            errors.append(abs(float(found["value"]) / true - 1.0))
    return max(errors, default=math.nan)


def _is_sought(name: str) -> bool:
    return name.rpartition(":")[2] in TO_BE_FOUND


def _stated(entry: Json | None) -> str:
    modulus = entry["youngs_modulus_Pa"] if entry else None
    if modulus is None:
        return "-"
    digits = max(1, 2 - math.floor(math.log10(max(2 * modulus["u"] / 1e9, 1e-12))) - 1)
    return f"{modulus['value'] / 1e9:.{min(digits, 4)}f} ± {2 * modulus['u'] / 1e9:.2g}"


def _range(table: str, side: str, name: str) -> str:
    found = paper_moduli(table, side, name)
    if found is None:
        return "-"
    mean, low, high = (x / 1e9 for x in found)
    return f"{mean:.3g}" if low == high else f"{mean:.3g} ({low:.3g} to {high:.3g})"
