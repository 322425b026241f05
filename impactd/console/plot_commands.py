"""The command that draws figures for papers."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from impactd.console import completions
from impactd.console.options import Json, Url, written


class Kind(StrEnum):
    """What may be drawn of a thing."""

    TRACE = "trace"
    TRACES = "traces"
    RESIDUALS = "residuals"
    MODULI = "moduli"
    DIAGNOSIS = "diagnosis"


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command()(plot)


def plot(  # noqa: PLR0917 - the framework fills them by name
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT...",
            help="Shot numbers; a shot's .h5; a campaign.json; the JSON of a fit, a diagnosis, "
            "`calibrate --history` or a confusion matrix; diagnosis-7; calibrations; "
            "figure-2, figure-3, figure-4.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Ends in .pdf, .svg or .png.",
            callback=written(".pdf", ".svg", ".png"),
        ),
    ],
    kind: Annotated[
        Kind | None,
        typer.Option(
            "--kind",
            help=(
                "trace: one shot, models and residuals. traces: a panel per pair. residuals: "
                "stacked over repetitions. moduli: the network against the stated values."
            ),
            show_default="depends on what is drawn",
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            help="Repeatable; a trace shows the base models without it.",
            autocompletion=completions.models,
        ),
    ] = None,
    shot: Annotated[
        str | None,
        typer.Option("--shot", help="With a campaign and --kind trace: the shot's name."),
    ] = None,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """Draw a picture for a paper.

    Of a shot, a campaign, a diagnosis, calibrations or a blind trial.
    """
    from impactd.console import plots

    plots.run(
        what,
        out,
        kind=None if kind is None else kind.value,
        models=model or [],
        shot=shot,
        url=url,
        as_json=as_json,
    )
