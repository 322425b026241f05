"""What import, export, verify and reindex do."""

# ruff: noqa: PLC0415 - imported when a campaign is exported: the fits need a second to load

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from analysis.written_numbers import counted
from impactd.console.failure import Failure
from impactd.console.options import open_archive, settings_of
from impactd.console.progress_bar import progress
from impactd.console.tables import print_json
from impactd.reports.rejected import rejected_words
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive


def import_campaign(
    campaign: Path, *, config: Path | None, data: Path | None, as_json: bool
) -> None:
    """Take a campaign folder into the archive and say which numbers its shots got.

    Parameters
    ----------
    campaign : Path
        The folder or its ``campaign.json``.
    config, data : Path or None
        As given on the command line.
    as_json : bool
        Print the report as JSON.

    Raises
    ------
    Failure
        If not one shot could be used.
    """
    with open_archive(config, data) as archive:
        report = archive.import_campaign(campaign)
    if as_json:
        print_json(asdict(report))
    else:
        if report.numbers:
            print(f"Imported {counted(len(report.numbers), 'shot')}: {_ranges(report.numbers)}.")
        if report.already:
            print(f"Already here: {_ranges(report.already)}.")
        for item in report.rejected:
            print(rejected_words(asdict(item)))
    if not report.numbers and not report.already:
        raise Failure(f"no shot of {campaign} could be used.")


def _ranges(numbers: Sequence[int]) -> str:
    """Return numbers as people write them: ``3-7, 9``."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1][1:] = [number]
        else:
            parts.append([number])
    return ", ".join("-".join(str(end) for end in part) for part in parts)


def export(
    numbers: Sequence[int],
    form: str,
    out: Path,
    *,
    config: Path | None,
    data: Path | None,
    as_json: bool,
) -> None:
    """Copy shots out of the archive and print the files.

    Parameters
    ----------
    form : str
        ``csv``, ``npz`` or ``campaign``.
    out : Path
        A folder; created when absent.
    config, data : Path or None
        As given on the command line.
    """
    with open_archive(config, data, existing=True) as archive:
        if form == "campaign":
            files = [str(_campaign(archive, numbers, out, settings_of(config, data)))]
        else:
            files = [str(path) for path in archive.export(numbers, form, out)]
    if as_json:
        print_json({"format": form, "shots": list(numbers), "files": files})
    else:
        print("\n".join(files))


def _campaign(archive: Archive, numbers: Sequence[int], out: Path, settings: Settings) -> Path:
    from impactd.jobs.campaign_export import export_campaign
    from impactd.settings.material_book import MaterialBook

    book = MaterialBook(settings.materials.file, archive.directory)
    return export_campaign(archive, numbers, out, settings=settings, book=book)


def verify(*, config: Path | None, data: Path | None, as_json: bool) -> None:
    """Check index and files; print what is wrong.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.
    as_json : bool
        Print every finding as JSON, good ones included.

    Raises
    ------
    Failure
        If anything is wrong.
    """
    found = []
    with open_archive(config, data, existing=True) as archive:
        for finding in archive.verify():
            found.append(finding)
            progress(f"{len(found)} looked at: {finding.subject}")
    progress("", last=True)
    bad = [finding for finding in found if finding.problem]
    if as_json:
        print_json([asdict(finding) for finding in found])
    else:
        for finding in bad:
            print(f"{finding.subject}: {finding.problem}")
    if bad:
        raise Failure(f"{len(bad)} of {len(found)} items are not as they were stored.")
    if not as_json:
        print(f"All {len(found)} items are as they were stored.")


def reindex(*, config: Path | None, data: Path | None, as_json: bool) -> None:
    """Rebuild the index from journal and files; print its contents and what is lost.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.
    as_json : bool
        Print the report as JSON.

    Raises
    ------
    Failure
        If something is lost, or is not what was written.
    """
    report = Archive.reindex(settings_of(config, data).storage.directory)
    if as_json:
        print_json(asdict(report))
    else:
        print(
            f"The index holds {counted(report.shots, 'shot')} and "
            f"{counted(report.drops, 'drop')} again; the "
            f"next number is {report.last_number + 1}."
        )
        taken = report.kept["calibration files"], report.kept["diagnosis files"]
        if any(taken):
            print(f"Taken from their files: {taken[0]} calibrations, {taken[1]} diagnoses.")
        for line in report.damaged:
            print(f"Damaged: {line}")
        for line in report.lost:
            print(f"Lost: {line}")
        if not report.lost:
            print("Nothing was lost.")
        if report.old_index:
            print(f"The old index is kept as {report.old_index}.")
    if report.damaged or report.lost:
        raise Failure(
            f"{len(report.damaged)} items are not what was written, {len(report.lost)} are lost."
        )
