"""What the paper's tables say, and what follows from them without any model of ours."""

from __future__ import annotations

import math
import statistics
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources

from impactd.aliases import Json


@dataclass(frozen=True)
class PaperPair:
    """One row of Table 4 or 5.

    Attributes
    ----------
    surface_pa, surface_std_pa, sphere_pa, sphere_std_pa : float
        Fitted Young's moduli and their standard deviations. [Pa]
    """

    surface_pa: float
    surface_std_pa: float
    sphere_pa: float
    sphere_std_pa: float


@cache
def tables() -> Json:
    """Return the paper's tables as they stand in ``tables.toml``."""
    text = resources.files("impactd.paper").joinpath("tables.toml").read_text(encoding="utf-8")
    found = tomllib.loads(text)
    # Table 2 lacks PTFE although Tables 4-5 use it as a surface: Table 1's
    found["surface"]["ptfe"] = found["sphere"]["ptfe"]
    return found


def rows(table: str) -> dict[tuple[str, str], PaperPair]:
    """Return Table 4 (``table4_hsd``) or 5 (``table5_kv``) by (sphere, surface)."""
    found = {}
    for name, numbers in tables()[table].items():
        sphere, _, surface = name.partition("-")
        found[sphere, surface] = PaperPair(*(1e9 * x for x in numbers))
    return found


def literature(side: str, name: str) -> tuple[float, float]:
    """Return (E [Pa], nu) of Tables 1-2; the middle where they give a range."""
    entry = tables()[side][name]
    ratio = entry["poissons_ratio"]
    middle = statistics.fmean(ratio) if isinstance(ratio, list) else float(ratio)
    return statistics.fmean(entry["youngs_modulus_Pa"]), middle


def reduced(pair: tuple[str, str], sphere_pa: float, surface_pa: float) -> float:
    """Return E* of a pair from two Young's moduli and Tables 1-2's Poisson's ratios. [Pa]"""
    nu_p, nu_s = literature("sphere", pair[0])[1], literature("surface", pair[1])[1]
    return 1 / ((1 - nu_p**2) / sphere_pa + (1 - nu_s**2) / surface_pa)


def literature_reduced(pair: tuple[str, str]) -> float:
    """Return E* of a pair from Tables 1-2. [Pa]"""
    return reduced(pair, literature("sphere", pair[0])[0], literature("surface", pair[1])[0])


def over_literature(table: str) -> dict[tuple[str, str], float]:
    """Return each row's E* over that of Tables 1-2. [1]"""
    return {
        pair: reduced(pair, row.sphere_pa, row.surface_pa) / literature_reduced(pair)
        for pair, row in rows(table).items()
    }


def distance_from_literature(table: str, pairs: set[tuple[str, str]]) -> float:
    """Return the mean of ``|ln(E / E_literature)|`` over both moduli of these pairs. [1]"""
    found = []
    for pair, row in rows(table).items():
        if pair in pairs:
            for side, name, value in (
                ("sphere", pair[0], row.sphere_pa),
                ("surface", pair[1], row.surface_pa),
            ):
                found.append(abs(math.log(value / literature(side, name)[0])))
    return statistics.fmean(found)


def spread_of_materials(table: str) -> dict[str, Json]:
    """Return how one material's modulus differs from pair to pair, beside what the rows state.

    Parameters
    ----------
    table : str
        ``table4_hsd`` or ``table5_kv``.

    Returns
    -------
    dict
        By ``sphere steel`` and the like, where it occurs in two pairs or more: moduli [GPa], their
        standard deviation over their mean, and the median of the stated ones over theirs.
    """
    values: dict[str, list[tuple[float, float]]] = {}
    for (sphere, surface), row in rows(table).items():
        values.setdefault(f"sphere {sphere}", []).append((row.sphere_pa, row.sphere_std_pa))
        values.setdefault(f"surface {surface}", []).append((row.surface_pa, row.surface_std_pa))
    found = {}
    for name, pairs in values.items():
        moduli = [value for value, _ in pairs]
        if len(moduli) > 1:
            found[name] = {
                "moduli_GPa": [round(m / 1e9, 4) for m in moduli],
                "relative_std_between_pairs": statistics.stdev(moduli) / statistics.fmean(moduli),
                "median_relative_std_stated": statistics.median(s / m for m, s in pairs),
            }
    return found


def paper_moduli(table: str, side: str, name: str) -> tuple[float, float, float] | None:
    """Return mean, lowest and highest modulus that the paper's pairs give a material.

    Parameters
    ----------
    table : str
        ``table4_hsd`` or ``table5_kv``.
    side : str
        ``sphere`` or ``surface``.

    Returns
    -------
    tuple of float or None
        [Pa] None where no pair has it.
    """
    found = [
        (row.sphere_pa if side == "sphere" else row.surface_pa)
        for pair, row in rows(table).items()
        if pair[0 if side == "sphere" else 1] == name
    ]
    return (statistics.fmean(found), min(found), max(found)) if found else None
