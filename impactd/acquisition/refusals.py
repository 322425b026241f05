"""Reasons for which a step of a drop refuses to continue, each with a remedy."""

from __future__ import annotations

from drivers.digitizer import Record
from drivers.valve import VacuumReading
from impactd.acquisition.failures import Doubt, StepFailedError
from impactd.acquisition.preflight import Check
from impactd.storage.problem import Problem


def not_held(limit_s: float, reading: VacuumReading, words: str) -> StepFailedError:
    """No sphere was hung in time."""
    return StepFailedError(
        Problem(
            "sphere-not-held",
            "No sphere is held",
            504,
            f"No sphere was held within {limit_s:g} s; the gauge reads {reading.volts:.2f} V.",
            f"Please {words}; if one hangs there, look for a leak or a stopped pump.",
        )
    )


def preflight_refused(check: Check) -> StepFailedError:
    """A check of pre-flight does not allow the drop."""
    return StepFailedError(
        Problem(
            f"preflight-{check.name}",
            "Pre-flight refused the drop",
            503,
            f"The {check.name} does not allow a drop: {check.sentence}.",
            check.remedy,
        )
    )


def valve_unconfirmed() -> StepFailedError:
    """A board that reads back did not."""
    return StepFailedError(
        Problem(
            "valve-unconfirmed",
            "The valve did not confirm",
            500,
            "The relay board did not read back that the valve is open.",
            "Check relay and valve, then acknowledge the fault.",
        ),
        doubt=Doubt.PERSON,
    )


def early_trigger(seen_s: float, fall_s: float, record: Record) -> StepFailedError:
    """Something hit the cell before the sphere could; the record is the evidence."""
    return StepFailedError(
        Problem(
            "early-trigger",
            "Something else hit the cell",
            500,
            f"The trigger came {seen_s * 1e3:.1f} ms after the valve, and the fall takes "
            f"{fall_s * 1e3:.1f} ms: that was not the sphere.",
            "Look for vibration, and for a trigger level that is too close to the noise; then "
            "repeat the drop.",
        ),
        record=record,
    )


def not_released(limit_s: float, reading: VacuumReading, record: Record | None) -> StepFailedError:
    """The valve says open and the gauge says that the sphere still hangs there."""
    return StepFailedError(
        Problem(
            "sphere-not-released",
            "The sphere did not fall",
            504,
            f"The valve was opened and the gauge still says held ({reading.volts:.2f} V) after "
            f"{limit_s:.2f} s: relay or valve is stuck.",
            "Check the relay and the valve, remove the sphere, then acknowledge the fault.",
        ),
        doubt=Doubt.PERSON,
        record=record,
    )


def no_impact(
    level_v: float, limit_s: float, fall_s: float, record: Record | None
) -> StepFailedError:
    """The sphere fell, and nothing crossed the level."""
    return StepFailedError(
        Problem(
            "no-impact",
            "No impact was seen",
            504,
            f"No impact above {level_v * 1e3:g} mV was seen within {limit_s:.2f} s of the release; "
            f"the fall takes {fall_s:.3f} s.",
            "Find the sphere. If it hit the coupon, lower trigger.level_v or check cell and "
            "conditioner.",
        ),
        record=record,
    )


def aborted_when_full(record: Record) -> StepFailedError:
    """The abort came as the record was full; it is kept as evidence."""
    return StepFailedError(
        Problem(
            "aborted", "Drop aborted", 409, ("The drop was aborted when the record was full."), ""
        ),
        record=record,
    )
