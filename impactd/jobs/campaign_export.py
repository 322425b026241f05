"""Stored shots as a campaign folder that gives the numbers which the daemon gave.

The folder holds all that a fit of the daemon depends on: materials, release, the restitution from
the bounce, and in ``calibration`` the load cell as the calibration behind the fits found it. Its
``sensor`` is the certificate's, from which a diagnosis starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from impactd.advice import best_fit
from impactd.jobs.orders import calibrated, knowledge, shot_places
from impactd.jobs.tasks import campaign_of
from impactd.settings.material_book import MaterialBook
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError, Calibration
from impactd.storage.campaign_folder import write_campaign
from impactd.storage.errors import NotFoundError
from impactd.storage.materials_json import sensor_to_json
from impactd.storage.shot_metadata import StoredShot


def export_campaign(
    archive: Archive,
    numbers: Sequence[int],
    out: Path,
    *,
    settings: Settings,
    book: MaterialBook,
) -> Path:
    """Write stored shots (at least one) as a campaign folder; return its ``campaign.json``.

    The folder is created when absent. It gets spheres and surfaces as the shots' fits took them.
    Raises ArchiveError if there is no shot, they make no campaign, or the folder holds one already.
    """
    if not numbers:
        raise ArchiveError("There is nothing to export.", remedy="Name at least one shot.")
    shots = sorted((archive.read_shot(n) for n in numbers), key=lambda one: one.shot.number)
    if any(one.metadata.source == "import" for one in shots):
        # Recorded elsewhere: no calibration of ours, and nothing beside what the files remember.
        return archive.export(numbers, "campaign", out)[0]
    calibration, told = _calibration(archive, [one.shot.number for one in shots])
    order = knowledge(None, settings, book.at(_materials_version(archive, shots, book)))
    order["shots"] = shot_places(archive, [one.shot.number for one in shots])
    campaign = campaign_of(order, shots)
    return write_campaign(
        out,
        replace(campaign, sensor=settings.sensor.sensor()),
        tuple(one.recording for one in shots),
        assumptions=told,
        calibration=None if calibration is None else _carried(calibration, settings),
    )


def _calibration(
    archive: Archive, numbers: Sequence[int]
) -> tuple[Calibration | None, tuple[str, ...]]:
    """Return the calibration that the shots' fits depend on, and what to say of it."""
    fits = [best_fit(archive.fits.for_shot(number)) for number in numbers]
    used = {fit.calibration for fit in fits if fit is not None}
    if not used:  # what a fit would take now
        chosen = archive.calibrations.current()
    else:
        known = [number for number in used if number is not None]
        chosen = archive.calibrations.get(max(known)) if known else None
    if chosen is None or chosen.result is None:
        return None, ()
    own = [number for number in numbers if _series_of(archive, number) == chosen.number]
    if own:
        return None, (
            f"Shot {own[0]} belongs to calibration {chosen.number}, so it is exported with the "
            "load cell's certificate: a calibration cannot confirm itself.",
        )
    if len(used) > 1:
        return chosen, (
            f"Some of these shots were last fitted before calibration {chosen.number}; all are "
            "given with it. `impactd refit` brings the archive's numbers up to date.",
        )
    return chosen, ()


def _materials_version(archive: Archive, shots: Sequence[StoredShot], book: MaterialBook) -> int:
    """Return the newest version of the book that the shots' fits were made with."""
    fits = [best_fit(archive.fits.for_shot(one.shot.number)) for one in shots]
    known = [int(fit.result.get("materials_version", 0)) for fit in fits if fit is not None]
    return max(known, default=book.version)


def _series_of(archive: Archive, number: int) -> int | None:
    try:
        return archive.drop(number).calibration
    except NotFoundError:  # its row was lost with an index; the shot is there
        return None


def _carried(calibration: Calibration, settings: Settings) -> dict[str, object]:
    assert calibration.result is not None
    return {
        "number": calibration.number,
        "model": calibration.result.get("model"),
        "finished_utc": calibration.finished_utc,
        "valid_until_utc": calibration.valid_until_utc,
        "sensor": sensor_to_json(calibrated(calibration.result, settings.sensor.sensor())),
    }
