"""What the uncertainty of every modulus is made of: of a campaign, or of the daemon's archive."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import getpass
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.written_numbers import measured
from impactd.aliases import Json
from impactd.console.client import connect
from impactd.console.decisions import MEASURANDS, Asked
from impactd.console.failure import Failure
from impactd.console.progress_bar import progress
from impactd.console.tables import print_json, table, wrapped

if TYPE_CHECKING:
    from impactd.reports.pdf_signature import Signatory

SHOWN_SHARE = 1e-3
"""Share of the variance below which a row is only in the JSON."""
_NAMES = {"plane_strain_modulus_Pa": "E/(1-nu^2)", "youngs_modulus_Pa": "E"}


@dataclass(frozen=True)
class Report:
    """A report to be written, and who signs it."""

    file: Path | None
    signatory: Signatory | None

    @classmethod
    def asked_for(
        cls,
        file: Path | None,
        key: Path | None,
        certificate: Path | None,
        passphrase_file: Path | None,
        reason: str,
    ) -> Report:
        """Return it; refuse what cannot be written or signed before anything is computed."""
        if key is None:
            return cls(file, None)
        if file is None or file.suffix.lower() != ".pdf":
            raise Failure("--sign-with signs a PDF; name it with --report FILE.pdf.")
        from impactd.reports.pdf_signature import PassphraseMissingError, load_signatory

        passphrase = os.environ.get("IMPACTD_SIGN_PASSPHRASE")
        if passphrase_file is not None:
            passphrase = passphrase_file.read_text("utf-8").rstrip("\r\n")
        try:
            return cls(file, load_signatory(key, certificate, passphrase, reason))
        except PassphraseMissingError:
            if not sys.stdin.isatty():
                raise
        passphrase = getpass.getpass(f"Passphrase of {key}: ")
        return cls(file, load_signatory(key, certificate, passphrase, reason))

    def write(self, document: Json, names: list[str], asked: Asked) -> None:
        """Write the budgets of these materials; signed, that of the one modulus asked for."""
        if self.file is None:
            return
        from impactd.moduli.budget_report import write_budget_report, write_signed_sheet

        if self.signatory is None:
            write_budget_report(self.file, document, names)
            return
        if len(names) != 1:
            raise Failure(
                f"A signature stands under one modulus, and there are those of {', '.join(names)}; "
                "choose one with --specimen."
            )
        measurand = MEASURANDS[asked.of]
        write_signed_sheet(self.file, document, names[0], measurand, self.signatory)


def budget(
    path: Path,
    model: str,
    asked: Asked,
    *,
    draws: int | None,
    refits: int | None,
    json_out: Path | None,
    written: Report,
) -> None:
    """Fit a campaign folder and print the budget of every modulus that was to be found.

    Parameters
    ----------
    path : Path
        ``campaign.json`` or its folder.
    asked : Asked
        Limits, and which material to show.
    draws : int or None
        Draws of a Monte Carlo to compare with.
    refits : int or None
        Whole fits of redrawn records to compare with.
    json_out : Path or None
        Where the budgets go, all of them; ``-`` prints them instead of the tables.
    written : Report
        Where a report goes, and who signs it.

    Raises
    ------
    Failure
        If the fit has no moduli, the limits mean nothing, or there are too few draws.
    """
    from analysis import fit_campaign
    from analysis.budget_monte_carlo import FORMAT, monte_carlo
    from analysis.budget_monte_carlo import refits as refitted
    from impactd.jobs.rebound import with_later_landings
    from impactd.storage.campaign_folder import read_campaign
    from impactd.storage.version import software

    campaign = with_later_landings(read_campaign(path), model)
    result = fit_campaign(
        campaign, model, heldout=False, progress=lambda w, s: progress(w, share=s)
    )
    found = result.budget()
    if found is None:
        raise Failure(
            f"{path}: there is no modulus for a budget: {result.outcome.message} A budget needs "
            "radius and mass of the spheres and names of the surfaces."
        )
    document: Json = {**found, "model": result.model, "outcome": result.outcome.message}
    moduli = result.moduli()
    document |= {
        "status": {name: moduli[name]["status"] for name in found["moduli"]},
        "assumptions": list(result.problem.assumptions),
        "shots": len(result.shots),
        "software": software(),
    }
    names = shown(document, asked.specimen)
    asked.write_into(document, names)
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
    written.write(document, names, asked)
    if json_out == Path("-"):
        print_json(document)
        return
    if json_out is not None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        json_out.write_text(text + "\n", encoding="utf-8")
    print(report(document, names))


def of_the_archive(
    filters: Json, asked: Asked, *, written: Report, url: str | None, as_json: bool
) -> None:
    """Print the budgets of the moduli that all stored shots give.

    Parameters
    ----------
    filters : dict
        ``specimen``, ``since``, ``until``; ``None`` where not given.
    written : Report
        Where a report goes, and who signs it.
    as_json : bool
        Print the answer as JSON.

    Raises
    ------
    Failure
        If no modulus is stated.
    """
    with connect(url) as client:
        document = client.get("/v1/moduli/budget", **filters, **asked.query())
    if as_json:
        print_json(document)
    if not document["moduli"]:
        of = f" of {asked.specimen}" if asked.specimen else ""
        raise Failure(f"No modulus{of} is stated, so there is no budget; see `impactd moduli`.")
    names = list(document["moduli"]) if asked.specimen else shown(document, None)
    written.write(document, names, asked)
    if not as_json:
        print(report(document, names))


def shown(document: Json, specimen: str | None) -> list[str]:
    """Return the materials to show: those whose modulus was to be found, or all stated ones.

    Parameters
    ----------
    document : dict
        ``impactd-budget/1`` with ``status``.

    Raises
    ------
    Failure
        If its modulus is not among them.
    """
    if specimen is not None:
        if specimen not in document["moduli"]:
            known = ", ".join(document["moduli"])
            raise Failure(f"No modulus of {specimen!r} is stated; there is one of: {known}.")
        return [specimen]
    found = [name for name, status in document["status"].items() if status == "fitted"]
    return found or list(document["moduli"])


def report(document: Json, names: list[str]) -> str:
    """Return budgets as the tables a person reads.

    Parameters
    ----------
    document : dict
        ``impactd-budget/1`` of a fit.

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
    parts += map(wrapped, document.get("assumptions") or [])
    parts += map(wrapped, document.get("warnings") or [])
    return "\n\n".join(parts)


def budget_table(title: str, one: Json) -> str:
    """Return one budget as a table, its sentence below.

    Parameters
    ----------
    one : dict
        ``impactd-budget/1`` of one modulus.

    Returns
    -------
    str
        Rows of less than a thousandth of the variance are left out.
    """
    value = {"value": one["value"], "u": one["u"], "unit": "Pa"}
    said = f"{title} = {measured(value, scale=1e-9)} GPa (95 %), u = {one['relative_u']:.2%}"
    parts = (
        f"{one['relative_u_common']:.2%} common to all shots, {one['relative_u_averaged']:.2%} "
        "reduced by more shots"
    )
    shown_rows = [
        row
        for row in sorted(one["rows"], key=lambda row: not row["common"])
        if row["share"] >= SHOWN_SHARE
    ]
    rows = [
        (
            row["label"] if row["common"] else f"{row['label']} *",
            "-" if row["value"] is None else f"{row['value']:.6g}",
            "-" if row["u"] is None else f"{row['u']:.2g}",
            row["unit"],
            row["distribution"],
            "-" if row["sensitivity"] is None else f"{row['sensitivity']:.3g}",
            f"{row['contribution']:.3%}",
            f"{row['share']:.1%}",
            f"{row['degrees_of_freedom']:.0f}" if row["degrees_of_freedom"] else "inf",
        )
        for row in shown_rows
    ]
    headings = ("input", "value", "u", "unit", "distribution", "d ln/d", "gives", "share", "dof")
    traced = [f"{row['label']}: {row['traceable_to']}" for row in shown_rows if row["traceable_to"]]
    decision = [one["conformity"]["sentence"]] if "conformity" in one else []
    return "\n".join(
        [
            wrapped(f"{said} ({parts})"),
            table(headings, rows),
            "* reduced by more shots; everything else is common to them.",
            *([wrapped(f"Traceable to: {'; '.join(traced)}.")] if traced else []),
            wrapped(one["improve"]),
            *map(wrapped, decision),
        ]
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
