"""``impactd new``: its names and options."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Json


class TimeUnit(StrEnum):
    """What a column of times may be in."""

    S = "s"
    MS = "ms"
    US = "us"
    NS = "ns"


def _scale(scale: float) -> float:
    """Return the scale as given; one that leaves nothing of the numbers is wrong usage."""
    if not math.isfinite(scale) or scale == 0.0:
        raise typer.BadParameter(
            f"{scale:g} leaves nothing of the numbers; give what one of them is in --unit."
        )
    return scale


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command()(new)


def new(  # noqa: PLR0917 - typer reads options from the parameters
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILES...",
            help="Recordings of any instrument: csv and other text, npy, npz, mat, wav, uff, tdms, "
            "lvm, hdf5 (FILE.h5:/path). Text may be gzip.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder to write into.",
            show_default="NAME-campaign of the first file",
        ),
    ] = None,
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Samples a second.", min=0)
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option("--unit", help="What the numbers are: V, mV, N, kN, g, m/s2, strain ..."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column", help=("Name or number of the signal; repeatable; `all` takes every one.")
        ),
    ] = None,
    scale: Annotated[
        float,
        typer.Option("--scale", help="Factor from the file's numbers to --unit.", callback=_scale),
    ] = 1.0,
    time: Annotated[
        TimeUnit | None, typer.Option("--time", help="What the file's times are in.")
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option("--threshold", help="A hit exceeds this value; in --unit.", min=0),
    ] = None,
    values: Annotated[
        Path | None,
        typer.Option(
            "--values",
            metavar="FILE.json",
            help="What you measured: the keys of campaign.json, and shots by name.",
        ),
    ] = None,
    drops: Annotated[
        Path | None,
        typer.Option(
            "--drops",
            metavar="FILE.csv",
            help="Which recording is which drop: a table with the columns name, sphere, surface, "
            "drop_height_mm.",
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Ask nothing; accept all proposals.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Make a campaign folder from recordings of any instrument.

    Finds the hits, says what it assumed, and draws a picture to look at.
    """
    from impactd.console import new_campaign
    from impactd.importing.choices import Choices

    choices = Choices(
        rate_hz=rate,
        unit=unit,
        columns=tuple(column or ()),
        scale=scale,
        time_unit=None if time is None else time.value,
        threshold=threshold,
        values=values,
        drops=drops,
    )
    new_campaign.run(files, out, choices, yes=yes, as_json=as_json)
