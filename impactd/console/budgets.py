"""``impactd budget``: what the uncertainty of every modulus of a campaign is made of."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from impactd.console.failure import Failure
from impactd.console.progress_bar import progress
from impactd.console.tables import measured, print_json, table

SHOWN_SHARE = 1e-3
"""Share of the variance below which a row is only in the JSON."""
_NAMES = {"plane_strain_modulus_Pa": "E/(1-nu^2)", "youngs_modulus_Pa": "E"}

Json = dict[str, Any]


def budget(
    path: Path, model: str, *, draws: int | None, refits: int | None, json_out: Path | None
) -> None:
    """Fit a campaign folder and print the budget of every modulus that was to be found.

    Parameters
    ----------
    path : Path
        ``campaign.json`` or its folder.
    model : str
        Base model, with effects.
    draws : int or None
        Draws of a Monte Carlo to compare with.
    refits : int or None
        Whole fits of redrawn records to compare with.
    json_out : Path or None
        Where the budgets go, all of them; ``-`` prints them instead of the tables.

    Raises
    ------
    Failure
        If the fit has no moduli, or there are too few draws.
    """
    from analysis import fit_campaign
    from analysis.budget_monte_carlo import FORMAT, monte_carlo
    from analysis.budget_monte_carlo import refits as refitted
    from impactd.storage.campaign_folder import read_campaign
    from impactd.storage.version import software

    result = fit_campaign(
        read_campaign(path), model, heldout=False, progress=lambda w, s: progress(w, share=s)
    )
    found = result.budget()
    if found is None:
        raise Failure(
            f"{path}: there is no modulus to account for: {result.outcome.message} A budget needs "
            "radius and mass of the spheres and names of the surfaces."
        )
    document: Json = {**found, "model": result.model, "outcome": result.outcome.message}
    document |= {"assumptions": list(result.problem.assumptions), "software": software()}
    if draws is not None:
        try:
            sampled = monte_carlo(result, draws)
        except ValueError as error:
            raise Failure(f"--monte-carlo: {error}") from None
        rows = [one.to_json() for one in sampled]
        document["monte_carlo"] = {"format": FORMAT, "draws": draws, "moduli": rows}
    if refits is not None:
        again = refitted(result, refits, progress=lambda w, s: progress(w, share=s))
        rows = [one.to_json() for one in again]
        document["refits"] = {"format": FORMAT, "draws": refits, "moduli": rows}
    progress("", last=True)
    if json_out == Path("-"):
        print_json(document)
        return
    if json_out is not None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        json_out.write_text(text + "\n", encoding="utf-8")
    print(report(document, _sought(result.moduli())))


def _sought(moduli: Json) -> list[str]:
    """Return the materials whose modulus was to be found; all where all were stated."""
    found = [name for name, one in moduli.items() if one["status"] == "fitted"]
    return found or list(moduli)


def report(document: Json, names: list[str]) -> str:
    """Return budgets as the tables a person reads.

    Parameters
    ----------
    document : dict
        ``impactd-budget/1`` of a fit.
    names : list of str
        Materials to show.

    Returns
    -------
    str
        A table for each modulus, what would improve it most, and the comparison with draws.
    """
    parts = []
    for name in names:
        for measurand, one in document["moduli"][name].items():
            parts.append(budget_table(f"{_NAMES[measurand]} of {name}", one))
    for key, words in (("monte_carlo", "draws"), ("refits", "whole fits")):
        if key in document:
            parts.append(_compared(document[key], words, names))
    parts += document.get("assumptions") or []
    return "\n\n".join(parts)


def budget_table(title: str, one: Json) -> str:
    """Return one budget as a table, its sentence below.

    Parameters
    ----------
    title : str
        Which modulus.
    one : dict
        ``impactd-budget/1`` of one modulus.

    Returns
    -------
    str
        Rows of less than a thousandth of the variance are left out.
    """
    value = {"value": one["value"], "u": one["u"], "unit": "Pa"}
    said = f"{title} = {measured(value, scale=1e-9)} GPa, u = {one['relative_u']:.2%}"
    parts = (
        f"{one['relative_u_common']:.2%} common to all shots, "
        f"{one['relative_u_averaged']:.2%} that more shots lessen"
    )
    rows = [
        (
            row["label"],
            "-" if row["value"] is None else f"{row['value']:.6g}",
            f"{row['u']:.2g}",
            row["unit"],
            row["distribution"],
            "-" if row["sensitivity"] is None else f"{row['sensitivity']:.3g}",
            f"{row['contribution']:.3%}",
            f"{row['share']:.1%}",
            f"{row['degrees_of_freedom']:.0f}" if row["degrees_of_freedom"] else "inf",
            row["traceable_to"] or "",
        )
        for row in one["rows"]
        if row["share"] >= SHOWN_SHARE
    ]
    headings = ("input", "value", "u", "unit", "distribution", "d ln/d", "gives", "share", "dof")
    return "\n".join(
        [f"{said} ({parts})", table((*headings, "traceable to"), rows), one["improve"]]
    )


def _compared(sampled: Json, words: str, names: list[str]) -> str:
    rows = [
        (
            one["material"],
            _NAMES[one["measurand"]],
            f"{one['linear']['u'] / one['value']:.3%}",
            f"{one['draws']['u'] / one['value']:.3%}",
            _interval(one["linear"]["interval95"]),
            _interval(one["draws"]["interval95"]),
        )
        for one in sampled["moduli"]
        if one["material"] in names
    ]
    headings = ("material", "modulus", "u, budget", f"u, {words}", "95 %/GPa, budget")
    title = f"Beside {sampled['draws']} {words} (JCGM 101):"
    return "\n".join([title, table((*headings, f"95 %/GPa, {words}"), rows)])


def _interval(ends: list[float]) -> str:
    return f"{ends[0] * 1e-9:.4g} .. {ends[1] * 1e-9:.4g}"
