"""An archive of many shots, for benchmarks and tests: rows and fits as after many drops.

A simulated campaign is fitted by the program's own tasks; its results are then copied, each with
its modulus moved within its uncertainty, under as many drops as are asked for. The shots have rows
and no files: nothing that reads a trace may be asked for them.
"""

from __future__ import annotations

import copy
import math
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.aliases import Json
from impactd.jobs.orders import SHOT_MODELS, order_without_shots, shot_places
from impactd.jobs.refit_task import fit_chunk
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import INDEX_NAME, Archive, DropRequest
from impactd.storage.drops import Drop, DropTable
from impactd.storage.fits import FitTable
from impactd.storage.index import Index
from impactd.storage.numbers import NumberSequence
from impactd.storage.shots import Shot, ShotTable
from impactd.storage.timestamp import as_utc

ROWS_A_TRANSACTION = 500
"""So that the write-ahead log stays small; a benchmark need not wait for every row."""
_FIRST = datetime(2025, 1, 1, tzinfo=UTC)
_SECONDS_A_DROP = 60.0


@dataclass(frozen=True)
class FittedShot:
    """A shot of the simulated campaign with its results.

    Attributes
    ----------
    results : dict
        By model, as the daemon writes them.
    """

    shot: Shot
    results: dict[str, Json]


def fitted_shots(settings: Settings, materials: Materials, *, seed: int = 0) -> list[FittedShot]:
    """Return a simulated campaign's shots with the results that the daemon's task gives them.

    Returns
    -------
    list of FittedShot
        One for each shot whose fits all converged.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        simulated = simulate_campaign(CampaignSettings(drop_heights_m=(0.03,), repeats=1), seed)
        with Archive.open(folder / "archive", reserve_bytes=0) as archive:
            report = archive.import_campaign(write_campaign_folder(folder / "campaign", simulated))
            order = order_without_shots(archive, settings, materials, SHOT_MODELS)
            order |= {"shots": shot_places(archive, report.numbers), "with_curves": True}
            found = []
            for one in fit_chunk(order):
                results = {fit["model"]: fit for fit in one["fits"]}
                if all(fit["outcome"]["status"] == "converged" for fit in results.values()):
                    found.append(FittedShot(archive.shot(one["shot"]), results))
    return found


def fill_archive(
    directory: Path, templates: list[FittedShot], shots: int, *, seed: int = 0
) -> None:
    """Write so many drops, shots and fits into an archive's index.

    Parameters
    ----------
    directory : Path
        Of the archive; created when absent. A daemon may serve it meanwhile.
    templates : list of FittedShot
        Whose results are copied, in turns.
    seed : int
        Of what the moduli are moved by.
    """
    Archive.open(directory, reserve_bytes=0).close()
    generator = np.random.default_rng(seed)
    index = Index(directory / INDEX_NAME)
    try:
        numbers = NumberSequence(index, directory)
        first = numbers.last() + 1
        for start in range(first, first + shots, ROWS_A_TRANSACTION):
            end = min(start + ROWS_A_TRANSACTION, first + shots)
            with index.transaction():
                for number in range(start, end):
                    template = templates[number % len(templates)]
                    _write(index, number, template, float(generator.normal()))
                numbers.raise_to(end - 1)
    finally:
        index.close()


def _write(index: Index, number: int, template: FittedShot, score: float) -> None:
    started = as_utc((_FIRST + timedelta(seconds=_SECONDS_A_DROP * number)).isoformat())
    row = template.shot
    request = DropRequest(
        row.sphere or "", row.surface or "", row.drop_height_m or 0.0, operator="bench"
    )
    sha256 = f"{number:064x}"
    DropTable(index).restore(
        Drop(
            number=number,
            state="analysed",
            request=request,
            owner="bench",
            shot=number,
            problem=None,
            requested_utc=started,
            updated_utc=started,
            calibration=None,
            idempotency_key=f"bench-{number}",
        )
    )
    ShotTable(index).add(
        Shot(
            number=number,
            file=f"shots/{number:06d}.h5",
            sha256=sha256,
            size_bytes=row.size_bytes,
            source="drop",
            origin="",
            started_utc=started,
            stored_utc=started,
            sphere=request.sphere,
            surface=request.surface,
            drop_height_m=request.drop_height_m,
            operator=request.operator,
            quantity=row.quantity,
            sample_rate_hz=row.sample_rate_hz,
            samples=row.samples,
            trigger_index=row.trigger_index,
            peak=row.peak,
            clipped=False,
        )
    )
    fits = FitTable(index)
    for model, result in template.results.items():
        fits.add(number, model, None, _moved(result, number, sha256, score))


def _moved(result: Json, number: int, sha256: str, score: float) -> Json:
    """Return a result of another drop of the same pair: E* moved by its random uncertainty."""
    moved = copy.deepcopy(result)
    moved |= {"shot_numbers": [number], "file_sha256": [sha256]}
    for pair in moved["pairs"].values():
        modulus = pair.get("reduced_modulus_Pa")
        if modulus:
            u_random = math.sqrt(max(modulus["u"] ** 2 - pair["u_calibration_Pa"] ** 2, 0.0))
            modulus["value"] += score * u_random
    return moved
