"""Commands around the analysis: fit, budget, diagnose, effects."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.base_models import DEFAULT_BASE
from impactd.console import completions
from impactd.console.options import (
    SIGN_REASON,
    Csv,
    DecisionRule,
    Guard,
    Json,
    JsonCommand,
    JsonOut,
    Lower,
    Modulus,
    Of,
    Report,
    Rule,
    SignCertificate,
    SignPassphrase,
    SignReason,
    SignWith,
    Upper,
    Url,
    written,
)


class BaseModel(StrEnum):
    """What a diagnosis may start from."""

    KV2 = "kv2"
    KV = "kv"
    HSD = "hsd"


def _positive(seconds: float | None) -> float | None:
    """Return seconds as given; anything but a positive number is wrong usage."""
    if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
        raise typer.BadParameter(
            f"{seconds:g} is not a valid search time; give a positive number of seconds, or leave "
            "the option out to search to the end."
        )
    return seconds


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    for command in (fit, budget, diagnose):
        app.command(cls=JsonCommand)(command)
    app.command()(effects)


def fit(  # noqa: PLR0917 - typer reads options from the parameters
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN.json | SHOT...",
            help="A campaign folder's file, fitted here; or shot numbers, fitted by the daemon.",
        ),
    ],
    model: Annotated[
        str,
        typer.Option(
            "--model",
            help="hsd, kv or kv2, with effects after a plus.",
            autocompletion=completions.models,
        ),
    ] = DEFAULT_BASE,
    json_out: JsonOut = None,
    identifiability: Annotated[
        bool,
        typer.Option(
            "--identifiability",
            help=(
                "Also say what the shots determine and what they do not, with profile likelihoods."
            ),
        ),
    ] = False,
    csv_out: Csv = None,
    url: Url = None,
) -> None:
    """Fit recordings together, and show each pair's modulus."""
    from impactd.console import fits

    if all(item.isdigit() for item in what):
        fits.by_the_daemon(
            [int(item) for item in what], model, json_out=json_out, csv_out=csv_out, url=url
        )
    elif len(what) == 1:
        fits.offline(
            Path(what[0]),
            model,
            json_out=json_out,
            csv_out=csv_out,
            identifiability=identifiability,
        )
    else:
        raise typer.BadParameter("give one campaign file, or only shot numbers")


def budget(  # noqa: PLR0917 - typer reads options from the parameters
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.json", help="A campaign folder's file.")
    ],
    model: Annotated[
        str,
        typer.Option(
            "--model",
            help="hsd, kv or kv2, with effects after a plus.",
            autocompletion=completions.models,
        ),
    ] = DEFAULT_BASE,
    draws: Annotated[
        int | None,
        typer.Option(
            "--monte-carlo", metavar="N", help="Compare with N draws; 10000 take a second."
        ),
    ] = None,
    refits: Annotated[
        int | None,
        typer.Option(
            "--refits", metavar="N", help="Compare with N whole fits of redrawn records.", min=2
        ),
    ] = None,
    json_out: JsonOut = None,
    report: Report = None,
    sign_with: SignWith = None,
    sign_certificate: SignCertificate = None,
    sign_passphrase_file: SignPassphrase = None,
    sign_reason: SignReason = SIGN_REASON,
    specimen: Annotated[
        str | None, typer.Option("--specimen", help="Only this material; the one of the limits.")
    ] = None,
    lower: Lower = None,
    upper: Upper = None,
    rule: DecisionRule = Rule.BOTH,
    guard: Guard = 1.0,
    of: Of = Modulus.YOUNG,
) -> None:
    """Show the uncertainty budget of every modulus, and what would reduce it most.

    With a limit also whether the modulus passes, fails or is undecided (JCGM 106).
    """
    from impactd.console import budgets
    from impactd.console.decisions import Asked

    if str(campaign).isdigit():
        raise typer.BadParameter(
            "a budget is of a campaign.json; `impactd moduli --budget` has that of stored shots"
        )

    asked = Asked(lower, upper, rule, guard, of, specimen)
    budgets.budget(
        campaign,
        model,
        asked,
        draws=draws,
        refits=refits,
        json_out=json_out,
        written=budgets.Report.asked_for(
            report, sign_with, sign_certificate, sign_passphrase_file, sign_reason
        ),
    )


def diagnose(  # noqa: PLR0917 - typer reads options from the parameters
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CAMPAIGN.json | SHOT...]",
            help="A campaign folder's file, diagnosed here; or shot numbers, or nothing for all "
            "shots, diagnosed by the daemon.",
        ),
    ] = None,
    base: Annotated[
        BaseModel | None,
        typer.Option(
            "--base", help="Model to start from; by default kv2, or kv if the campaign obeys kv."
        ),
    ] = None,
    budget_s: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="SECONDS",
            help=(
                "Search no longer than this, then give the best verdict so far and say that it is "
                "one. The base fit is always made; compiling, once on each machine, does not "
                "count."
            ),
            callback=_positive,
        ),
    ] = None,
    json_out: JsonOut = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="OUT.html",
            help="Write the report here.",
            callback=written(".html"),
        ),
    ] = None,
    pdf: Annotated[
        Path | None,
        typer.Option(
            "--pdf",
            metavar="OUT.pdf",
            help="Write the result on one page for the file.",
            callback=written(".pdf"),
        ),
    ] = None,
    csv_out: Csv = None,
    url: Url = None,
) -> None:
    """Find what the model misses, and name it.

    Shows the error on held-out shots before and after.
    """
    from impactd.console import diagnoses

    given = what or []
    if all(item.isdigit() for item in given):
        numbers = [int(item) for item in given]
        diagnoses.by_the_daemon(
            numbers,
            base or DEFAULT_BASE,
            budget_s=budget_s,
            json_out=json_out,
            csv_out=csv_out,
            report=report,
            pdf=pdf,
            url=url,
        )
    elif len(given) == 1:
        diagnoses.offline(
            Path(given[0]),
            base,
            budget_s=budget_s,
            json_out=json_out,
            csv_out=csv_out,
            report=report,
            pdf=pdf,
        )
    else:
        raise typer.BadParameter("give one campaign file, or only shot numbers")


def effects(as_json: Json = False) -> None:
    """List the effects a measurement may hide."""
    from impactd.console.tables import print_json, table
    from impactd.effect_list import effect_list

    found = effect_list()
    if as_json:
        print_json(found)
        return
    rows = [
        (
            effect["id"],
            effect["slot"],
            effect["title"],
            effect["tell_tale"],
        )
        for effect in found
    ]
    print(table(("id", "slot", "what a real rig does", "how it shows"), rows))
    print(f"\n{len(found)} effects; --json has their numbers, bounds, sources and validation too.")
