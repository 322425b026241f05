"""The command that reproduces the paper."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Json


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command()(paper)


def paper(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for page, pictures and JSON.")
    ] = Path("impactd-paper"),
    rigs: Annotated[int, typer.Option("--rigs", help="Simulated rigs for Tables 3-5.")] = 6,
    seed: Annotated[int, typer.Option("--seed", help="Of the first rig.")] = 1,
    as_json: Json = False,
) -> None:
    """Compute Maranzano & Hancock 2016 again.

    Every number stands beside theirs.
    """
    from impactd.paper.run import run_paper

    run_paper(out=out, rigs=rigs, seed=seed, as_json=as_json)
