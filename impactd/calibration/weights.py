"""A calibration from weights: computed at once, kept as a record of its own kind."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from analysis.static_calibration import Reading, compare, static_calibration
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, Calibration
from impactd.storage.calibrations import STATIC_WEIGHTS
from impactd.storage.timestamp import utc_after
from impactd.storage.version import software


@dataclass(frozen=True)
class Weighing:
    """Readings of the cell under weights."""

    readings: tuple[Reading, ...]
    hold_time_s: float
    """From putting a weight down to its reading. [s]"""
    discharge_time_constant_s: float | None
    """Of cell and conditioner; None where it is not known. [s]"""


def calibrate_with_weights(
    archive: Archive, settings: Settings, weighing: Weighing, *, slot: str | None, owner: str
) -> Calibration:
    """Compute the gain from weights and store it.

    The same slot with the same readings gives the same record. ``meaningless`` outcomes are kept
    too, with their warning and without a gain.

    Raises
    ------
    AnalysisError
        If the readings fix no slope; nothing is stored then.
    IdempotencyConflictError
        If the slot was used for something else.
    """
    found = static_calibration(
        weighing.readings,
        hold_time_s=weighing.hold_time_s,
        discharge_time_constant_s=weighing.discharge_time_constant_s,
        gravity_m_per_s2=settings.release.gravity_m_per_s2,
    )
    result: dict[str, Any] = {**found.to_json(), "software": software()}
    current = archive.calibrations.current()
    if current is not None and current.result is not None:
        result["against"] = {**compare(result, current.result), "calibration": current.number}
    plan = [{"method": STATIC_WEIGHTS, **asdict(weighing)}]
    plan[0]["readings"] = list(plan[0]["readings"])
    with archive.transaction():
        record, created = archive.calibrations.begin(slot, plan, owner)
        if not created:
            return record
        return archive.calibrations.finish(
            record.number, result, utc_after(settings.calibration.validity_days)
        )
