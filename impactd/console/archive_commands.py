"""Commands that work on the archive's own files: import, export, verify, reindex."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from impactd.console import completions
from impactd.console.options import Config, Data, Json


class ExecutorKind(StrEnum):
    """Where a re-fit runs."""

    PROCESS = "process"
    DASK = "dask"


class ExportFormat(StrEnum):
    """What shots may be exported as."""

    CSV = "csv"
    NPZ = "npz"
    CAMPAIGN = "campaign"


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command("import")(import_campaign)
    app.command("export")(export)
    app.command()(verify)
    app.command()(reindex)
    app.command()(refit)


def import_campaign(
    campaign: Annotated[Path, typer.Argument(help="A campaign folder or its campaign.json.")],
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Take the recordings of a campaign folder into the archive."""
    from impactd.console import archive_files

    archive_files.import_campaign(campaign, config=config, data=data, as_json=as_json)


def export(  # noqa: PLR0917 - typer reads options from the parameters
    shots: Annotated[list[int], typer.Argument(metavar="SHOT...", help="Shot numbers.")],
    format: Annotated[
        ExportFormat, typer.Option("--format", help="csv and npz: a file per shot.")
    ] = ExportFormat.CAMPAIGN,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write into.")] = Path(
        "impactd-export"
    ),
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Copy shots out of the archive."""
    from impactd.console import archive_files

    archive_files.export(shots, format.value, out, config=config, data=data, as_json=as_json)


def verify(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """Check the index against its journal, and every shot file against its SHA-256."""
    from impactd.console import archive_files

    archive_files.verify(config=config, data=data, as_json=as_json)


def reindex(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """Rebuild the index from its journal and the files, and say what is lost.

    The daemon must be stopped.
    """
    from impactd.console import archive_files

    archive_files.reindex(config=config, data=data, as_json=as_json)


def refit(  # noqa: PLR0917 - typer reads options from the parameters
    executor: Annotated[
        ExecutorKind, typer.Option("--executor", help="Processes here, or a Dask cluster.")
    ] = ExecutorKind.PROCESS,
    workers: Annotated[int, typer.Option("--workers", min=1, help="How many processes.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="A Dask cluster that runs already."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            help="Repeatable; without it, the models of every new shot.",
            autocompletion=completions.models,
        ),
    ] = None,
    label: Annotated[
        str,
        typer.Option(
            "--label", help=("With a new label, shots that are done already are fitted again.")
        ),
    ] = "",
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Fit every stored shot again with today's calibration.

    Goes on where it was ended.
    """
    from impactd.console import refit as console

    console.run(
        executor.value,
        workers=workers,
        scheduler=scheduler,
        models=model,
        label=label,
        config=config,
        data=data,
        as_json=as_json,
    )
