"""Checks before the valve may open: measured facts in, results with sentences out.

Nothing here touches a device or the disk; the service collects the facts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactd.settings.instrument import TriggerSection
from impactd.settings.sections import CalibrationSection, PreflightSection
from impactd.storage.calibrations import Calibration


@dataclass(frozen=True)
class Check:
    """The result of one check."""

    name: str
    """``digitizer``, ``valve``, ``sphere``, ``input``, ``disk``, ``calibration``."""
    ok: bool
    """Whether it allows a drop."""
    sentence: str
    """What was measured, with values and units."""
    remedy: str = ""
    """What to do, empty when it is ``ok``."""


@dataclass(frozen=True)
class Baseline:
    """Statistics of the idle input."""

    mean_v: float
    noise_rms_v: float
    """Standard deviation. [V]"""
    peak_v: float
    """Largest distance from the mean, either way. [V]"""
    samples: int

    @classmethod
    def of(cls, signal_v: NDArray[np.float64]) -> Baseline:
        """Return the statistics of a stretch of idle input, shape (n,). [V]"""
        mean_v = float(np.mean(signal_v))
        peak_v = max(float(np.max(signal_v)) - mean_v, mean_v - float(np.min(signal_v)))
        return cls(mean_v, float(np.std(signal_v)), peak_v, int(signal_v.size))


def check_input(baseline: Baseline, limits: PreflightSection, trigger: TriggerSection) -> Check:
    """Judge the idle input.

    Besides mean and noise, nothing may come within the hysteresis of the trigger level: a sphere
    that still bounces, or a knock, would be taken for the impact.
    """
    found = (
        f"baseline {round(baseline.mean_v * 1e3, 2) + 0.0:.2f} mV, "  # + 0.0: never -0.00
        f"noise {baseline.noise_rms_v * 1e3:.3f} mV rms"
    )
    if not limits.baseline_min_v <= baseline.mean_v <= limits.baseline_max_v:
        return Check(
            "input",
            False,
            f"{found}: the baseline must lie between {limits.baseline_min_v * 1e3:g} and "
            f"{limits.baseline_max_v * 1e3:g} mV",
            "Make sure that nothing rests on the cell, then wait until its conditioner has "
            "settled.",
        )
    highest_v = abs(trigger.level_v) - trigger.hysteresis_v
    if baseline.peak_v > highest_v:
        return Check(
            "input",
            False,
            f"{found}, peak {baseline.peak_v * 1e3:.1f} mV: nothing may exceed "
            f"{highest_v * 1e3:g} mV, which is near the trigger",
            "Wait until the last sphere is at rest; look for shocks and vibration.",
        )
    if baseline.noise_rms_v > limits.noise_max_v:
        return Check(
            "input",
            False,
            f"{found}: the noise must stay below {limits.noise_max_v * 1e3:g} mV rms",
            "Look for vibration (pump, steps) and for a loose cable between cell and conditioner.",
        )
    if baseline.noise_rms_v < limits.noise_min_v:
        return Check(
            "input",
            False,
            f"{found}: an input that quiet (below {limits.noise_min_v * 1e3:g} mV rms) is dead",
            "Check that cell and conditioner are switched on and wired to the configured channel.",
        )
    return Check("input", True, found)


def check_disk(free_above_reserve_bytes: int) -> Check:
    """Judge the space on the disk: free bytes above the reserve, negative inside it."""
    megabytes = free_above_reserve_bytes / 1e6
    if free_above_reserve_bytes < 0:
        return Check(
            "disk",
            False,
            f"the archive's disk lacks {-megabytes:.0f} MB of its reserve",
            "Free space, or move storage.directory to another disk.",
        )
    return Check("disk", True, f"{megabytes / 1e3:.3g} GB free above the reserve")


@dataclass(frozen=True)
class CalibrationState:
    """The state of the load cell's calibration."""

    word: str
    """``none``, ``valid``, ``due`` (ends soon) or ``overdue``."""
    number: int | None
    """The calibration in force."""
    finished_utc: str | None
    valid_until_utc: str | None
    days_left: float | None
    """Until it ends; negative when overdue. [d]"""
    drift_sigmas: float | None
    """Largest drift against the one before. [1]"""
    sentence: str
    """The state in words."""

    @property
    def valid(self) -> bool:
        """Whether results may depend on it."""
        return self.word in ("valid", "due")


def calibration_state(
    current: Calibration | None, section: CalibrationSection, now: datetime | None = None
) -> CalibrationState:
    """Return the state of the calibration, given the last one that was done.

    ``now`` has a time zone; without it, it is the present time.
    """
    if current is None or current.valid_until_utc is None:
        return CalibrationState(
            "none", None, None, None, None, None, "the load cell was never calibrated on this rig"
        )
    ends = datetime.fromisoformat(current.valid_until_utc)
    left = ends - (now or datetime.now(UTC))
    date = current.valid_until_utc[:10]
    if left < timedelta(0):
        word, sentence = "overdue", f"calibration {current.number} is overdue since {date}"
    elif left < timedelta(days=section.remind_days):
        word, sentence = "due", f"calibration {current.number} is due by {date}"
    else:
        word, sentence = "valid", f"calibration {current.number} is valid until {date}"
    return CalibrationState(
        word,
        current.number,
        current.finished_utc,
        current.valid_until_utc,
        left / timedelta(days=1),
        _drift_sigmas(current.result),
        sentence,
    )


def check_calibration(
    state: CalibrationState, limits: PreflightSection, *, for_calibration: bool = False
) -> Check:
    """Judge the calibration; drops of a calibration run may go without."""
    required = limits.require_valid_calibration and not for_calibration
    if required and not state.valid:
        return Check("calibration", False, state.sentence, "Run `impactd calibrate`.")
    return Check("calibration", True, state.sentence)


def _drift_sigmas(result: dict[str, Any] | None) -> float | None:
    drift = (result or {}).get("drift")
    worst = drift.get("largest_in_u") if isinstance(drift, dict) else None
    return float(worst) if isinstance(worst, (int, float)) and math.isfinite(worst) else None
