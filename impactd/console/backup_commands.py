"""``impactd backup`` and ``impactd restore``."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from analysis.written_numbers import counted
from impactd.console.options import Config, Data, Json, settings_of


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command()(backup)
    app.command()(restore)


def backup(
    out: Annotated[Path, typer.Argument(metavar="OUT.tar", help="A file that is not there yet.")],
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Write a backup of the archive; the daemon may go on working.

    It holds shots, fits, calibrations, the journal and the hashes of tokens. Settings and materials
    are files of your own: keep them with it.
    """
    from impactd.console.progress_bar import progress
    from impactd.console.tables import print_json
    from impactd.storage.backup import back_up

    directory = settings_of(config, data).storage.directory
    made = back_up(directory, out, lambda text, share: progress(text, share=share))
    progress("", last=True)
    if as_json:
        print_json({"file": str(made.file), "files": made.files, "size_bytes": made.size_bytes})
    else:
        print(f"{made.file}: {made.files} files, {made.size_bytes / 1e6:.1f} MB.")


def restore(
    file: Annotated[Path, typer.Argument(metavar="BACKUP.tar", help="From `impactd backup`.")],
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Restore the archive of a backup into an empty data directory, and rebuild its index."""
    from impactd.console.failure import Failure
    from impactd.console.tables import print_json
    from impactd.storage.backup import restore as restored

    directory = settings_of(config, data).storage.directory
    report = restored(file, directory)
    if as_json:
        print_json(dataclasses.asdict(report))
    else:
        print(
            f"{directory} holds {counted(report.shots, 'shot')} and "
            f"{counted(report.drops, 'drop')}; the next number is {report.last_number + 1}."
        )
        for line in (*report.damaged, *report.lost):
            print(line)
    if report.damaged or report.lost:
        raise Failure("the backup does not restore everything, see above.")
