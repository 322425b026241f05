"""Commands around the analysis: fit, diagnose, effects."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Json, Url


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    for command in (fit, diagnose, effects):
        app.command()(command)


def fit(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN.json | SHOT...",
            help="A campaign folder's file, fitted here; or shot numbers, fitted by the daemon.",
        ),
    ],
    model: Annotated[str, typer.Option("--model", help="hsd or kv.")] = "kv",
    json_out: Annotated[
        Path | None, typer.Option("--json", metavar="OUT", help="Write the result here; - prints.")
    ] = None,
    url: Url = None,
) -> None:
    """Fit recordings together, and show each pair's modulus."""
    from impactd.console import fits

    if all(item.isdigit() for item in what):
        fits.by_the_daemon([int(item) for item in what], model, json_out=json_out, url=url)
    elif len(what) == 1:
        fits.offline(Path(what[0]), model, json_out=json_out)
    else:
        raise typer.BadParameter("give one campaign file, or only shot numbers")


def diagnose(
    campaign: Annotated[Path, typer.Argument(help="A campaign folder's campaign.json.")],
    base: Annotated[str, typer.Option("--base", help="kv or hsd.")] = "kv",
    json_out: Annotated[Path | None, typer.Option("--json", metavar="OUT")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="OUT.html")] = None,
) -> None:
    """Find out why a model does not fit. Not yet there."""
    from impactd.console.failure import Failure

    raise Failure(
        f"diagnosing {campaign} from the base {base} is not there yet; `impactd fit` shows R2, "
        "chi2 and flags of the base model."
    )


def effects(as_json: Json = False) -> None:
    """List the effects a measurement may hide."""
    from impactd.console.tables import print_json, table
    from impactd.effect_list import effect_list

    found = effect_list()
    if as_json:
        print_json(found)
    elif found:
        headings = ("id", "slot", "title")
        print(table(headings, [[item.get(name, "") for name in headings] for item in found]))
    else:
        print("The effect library of this version is empty.")
