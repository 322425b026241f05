"""The observation of a drop, and how it goes into the shot file."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from analysis.campaign import Environment
from drivers.digitizer import TriggerSettings
from drivers.valve import VacuumReading, ValveReport
from impactd import __version__
from impactd.acquisition.preflight import Baseline
from impactd.rig.rig import Rig
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import Calibration, DropRequest, ShotMetadata
from impactd.storage.timestamp import utc_now


@dataclass
class Observation:
    """What was observed so far; filled in step by step."""

    started_utc: str = field(default_factory=utc_now)
    """When the drop began; ``started_monotonic_ns`` is the same on the host's clock."""
    started_monotonic_ns: int = field(default_factory=time.monotonic_ns)
    vacuum: VacuumReading | None = None
    """The gauge before the release."""
    may_have_fallen: bool = False
    """The valve was told to open, whether it did or not."""
    valve: ValveReport | None = None
    baseline: Baseline | None = None
    """Of the idle input."""
    environment: Environment | None = None
    """Temperature and humidity before the release."""
    trigger_ns: int = 0
    """Host clock at the trigger. [ns]"""
    captured_ns: int = 0
    """Host clock once the record was whole. [ns]"""
    notes: list[str] = field(default_factory=list)
    """What a reader of the shot should know."""

    def note_garbage(self, report: ValveReport) -> None:
        """Note the stray bytes that came with a valve's reply."""
        if report.garbage:
            self.notes.append(f"serial garbage tolerated: {report.garbage.hex(' ')}")

    def durations_s(self, stored_monotonic_ns: int) -> dict[str, float]:
        """Return ``impact_to_stored_s`` and ``record_to_stored_s`` of a durably stored drop. [s]"""
        return {
            "impact_to_stored_s": (stored_monotonic_ns - self.trigger_ns) * 1e-9,
            "record_to_stored_s": (stored_monotonic_ns - self.captured_ns) * 1e-9,
        }


def trigger_settings(settings: Settings) -> TriggerSettings:
    """Return the trigger with lengths in samples, at the calibrated rate."""
    trigger, rate_hz = settings.trigger, settings.digitizer.sample_rate_hz
    return TriggerSettings(
        level_v=trigger.level_v,
        hysteresis_v=trigger.hysteresis_v,
        pre_trigger_samples=round(trigger.pre_trigger_s * rate_hz),
        record_samples=round(trigger.record_s * rate_hz),
    )


def metadata_of(
    seen: Observation,
    request: DropRequest,
    *,
    rig: Rig,
    settings: Settings,
    materials: Materials,
    calibration: Calibration | None,
) -> ShotMetadata:
    """Return what is known of a drop by now, for the shot file."""
    valve, baseline = seen.valve, seen.baseline
    return ShotMetadata(
        started_utc=seen.started_utc,
        started_monotonic_ns=seen.started_monotonic_ns,
        gravity_m_per_s2=settings.release.gravity_m_per_s2,
        operator=request.operator,
        sphere=materials.spheres[request.sphere],
        surface=materials.surfaces[request.surface],
        drop_height_m=request.drop_height_m,
        speed_repeatability=settings.release.speed_repeatability,
        valve_monotonic_ns=valve.sent_monotonic_ns if valve else None,
        valve_identity=rig.valve.identity,
        valve_confirmed=valve.confirmed if valve else None,
        vacuum_v=seen.vacuum.volts if seen.vacuum else None,
        digitizer=rig.digitizer.identity,
        trigger=trigger_settings(settings),
        baseline_v=baseline.mean_v if baseline else None,
        noise_rms_v=baseline.noise_rms_v if baseline else None,
        sensor=settings.sensor.sensor(),
        environment=seen.environment,
        calibration=calibration.number if calibration else None,
        configuration=settings.snapshot(),
        software=f"impactd {__version__}",
        notes=tuple(seen.notes),
    )
