"""Shots into and out of the archive: campaign folders in; csv, npz or a campaign folder out."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.campaign import Campaign, Environment, Rejected, Sensor
from analysis.campaign import Shot as Recorded
from impactd.storage.assemble import assemble_campaign
from impactd.storage.campaign_folder import (
    CampaignFolder,
    read_campaign_folder,
    write_campaign,
)
from impactd.storage.campaign_shot import CampaignShot
from impactd.storage.csv_table import csv_line
from impactd.storage.errors import ArchiveError
from impactd.storage.metadata_json import metadata_to_json
from impactd.storage.publish import publish
from impactd.storage.shot_metadata import Recording, ShotMetadata, StoredShot
from impactd.storage.shots import Shot
from impactd.storage.timestamp import utc_now
from impactd.storage.version import software

FORMATS = ("csv", "npz", "campaign")
_CSV_COLUMNS = {
    "voltage": "volts",
    "force_N": "force_N",
    "acceleration_m_per_s2": "acceleration_m_per_s2",
}


@dataclass(frozen=True)
class ImportReport:
    """The outcome of an import."""

    folder: str
    numbers: tuple[int, ...]
    """Shots that were stored now."""
    already: tuple[int, ...]
    """Shots that were there from an earlier import of the same samples."""
    rejected: tuple[Rejected, ...]
    """Shots that were refused, and why."""


def import_folder(
    path: Path,
    *,
    known: Callable[[str], Shot | None],
    store: Callable[[Recording, ShotMetadata], Shot],
) -> ImportReport:
    """Store the shots of a campaign folder (or its ``campaign.json``) in an archive.

    ``known`` gives the shot that was imported from an origin before, or ``None``. Raises
    CampaignError if the folder cannot be used as a whole.
    """
    folder = read_campaign_folder(path)
    place = path if path.is_dir() else path.parent
    numbers: list[int] = []
    already: list[int] = []
    for one in folder.shots:
        metadata = _metadata(one, folder, place.resolve().name)
        old = known(metadata.origin)
        if old is not None:
            already.append(old.number)
        else:
            numbers.append(store(one.recording, metadata).number)
    return ImportReport(str(place), tuple(numbers), tuple(already), folder.campaign.rejected)


def _metadata(one: CampaignShot, folder: CampaignFolder, place: str) -> ShotMetadata:
    campaign, shot = folder.campaign, one.shot
    content = hashlib.sha256(one.recording.samples.tobytes()).hexdigest()
    return ShotMetadata(
        started_utc=utc_now(),
        started_monotonic_ns=0,
        gravity_m_per_s2=campaign.gravity_m_per_s2,
        sphere=None if shot.sphere is None else campaign.spheres[shot.sphere],
        surface=None if shot.surface is None else campaign.surfaces[shot.surface],
        drop_height_m=shot.drop_height_m,
        speed_repeatability=campaign.speed_repeatability,
        sensor=campaign.sensor,
        restitution=shot.restitution,
        environment=_around(shot, campaign),
        source="import",
        origin=f"{place}/{one.file} sha256:{content}",
        software=software(),
        notes=("Imported; the start time is the time of the import.",),
    )


def _around(shot: Recorded, campaign: Campaign) -> Environment | None:
    """Return the shot's environment, completed by that of the whole campaign."""
    if shot.environment is None:
        return campaign.environment
    return shot.environment.completed_by(campaign.environment)


def export_shots(shots: Sequence[StoredShot], form: str, out: Path) -> list[Path]:
    """Write shots for other programs; return the files, in the order of the shots.

    Parameters
    ----------
    form : str
        ``csv`` (``time_s,volts`` and a json beside it), ``npz`` (codes, signal, time and metadata)
        or ``campaign`` (a folder that `import_folder` reads; its ``campaign.json`` is returned).
    out : Path
        A directory; created when absent.

    Raises
    ------
    ArchiveError
        If the form is unknown, a file exists already or the shots make no campaign.
    """
    if form not in FORMATS:
        raise ArchiveError(f"The format {form!r} is unknown; there are {', '.join(FORMATS)}.")
    if not shots:
        raise ArchiveError("There is nothing to export.", remedy="Name at least one shot.")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArchiveError(f"{out} cannot be made: {error.strerror}.") from error
    if form == "campaign":
        return [_export_campaign(shots, out)]
    write = _export_csv if form == "csv" else _export_npz
    return [write(one, out) for one in shots]


def _export_campaign(shots: Sequence[StoredShot], out: Path) -> Path:
    ordered = sorted(shots, key=lambda one: one.shot.number)
    campaign = archive_campaign(ordered)
    return write_campaign(out, campaign, tuple(one.recording for one in ordered))


def archive_campaign(shots: Sequence[StoredShot]) -> Campaign:
    """Return shots (at least one) as a campaign with what their files remember, nothing newer.

    The sensor is that of the first shot. Raises ArchiveError if the shots do not share gravity,
    release and load cell, or describe a material differently.
    """
    first = shots[0].metadata
    for one in shots[1:]:
        for name in ("gravity_m_per_s2", "speed_repeatability"):
            if getattr(one.metadata, name) != getattr(first, name):
                raise ArchiveError(
                    f"Shots {shots[0].shot.number} and {one.shot.number} differ in {name}.",
                    remedy="Put them into separate campaigns.",
                )
    return assemble_campaign(
        shots, None, first.sensor or Sensor(), first.gravity_m_per_s2, first.speed_repeatability
    )


def _times(one: StoredShot) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    recording = one.recording
    return (np.arange(recording.samples.size) - recording.trigger_index) / recording.sample_rate_hz


def _facts(one: StoredShot) -> dict[str, object]:
    found = metadata_to_json(one.shot.number, one.recording, one.metadata, one.drop)
    return {**found, "file_sha256": one.shot.sha256}


def csv_text(one: StoredShot) -> str:
    """Return a header line, then time from the trigger [s] and signal [its unit] of each sample."""
    buffer = io.StringIO()
    buffer.write(csv_line(("time_s", _CSV_COLUMNS[one.recording.quantity])).replace("\r\n", "\n"))
    np.savetxt(
        buffer,
        np.column_stack((_times(one), one.recording.signal)),
        fmt=("%.9e", "%.9g"),
        delimiter=",",
    )
    return buffer.getvalue()


def _export_csv(one: StoredShot, out: Path) -> Path:
    path = out / f"shot{one.shot.number:06d}.csv"
    publish(path, csv_text(one).encode())
    facts = json.dumps(_facts(one), allow_nan=False, indent=1) + "\n"
    publish(path.with_suffix(".json"), facts.encode())
    return path


def _export_npz(one: StoredShot, out: Path) -> Path:
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        codes=one.recording.samples,
        signal=one.recording.signal,
        time_s=_times(one),
        facts_json=np.array(json.dumps(_facts(one), allow_nan=False)),
    )
    path = out / f"shot{one.shot.number:06d}.npz"
    publish(path, buffer.getvalue())
    return path
