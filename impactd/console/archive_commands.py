"""Commands that work on the archive's own files: import, export, verify, reindex."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Config, Data, Json


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


def import_campaign(
    campaign: Annotated[Path, typer.Argument(help="A campaign folder or its campaign.json.")],
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Take the recordings of a campaign folder into the archive."""
    from impactd.console import archive_files

    archive_files.import_campaign(campaign, config=config, data=data, as_json=as_json)


def export(
    shots: Annotated[list[int], typer.Argument(metavar="SHOT...", help="Shot numbers.")],
    format: Annotated[
        ExportFormat, typer.Option("--format", help="csv and npz: a file per shot.")
    ] = ExportFormat.CAMPAIGN,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write into.")] = Path(
        "impactd-export"
    ),
    config: Config = None,
    data: Data = None,
) -> None:
    """Copy shots out of the archive."""
    from impactd.console import archive_files

    archive_files.export(shots, format.value, out, config=config, data=data)


def verify(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """Check every shot file against its SHA-256 and the index."""
    from impactd.console import archive_files

    archive_files.verify(config=config, data=data, as_json=as_json)


def reindex(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """Rebuild the index from the shot files; the daemon must be stopped."""
    from impactd.console import archive_files

    archive_files.reindex(config=config, data=data, as_json=as_json)
