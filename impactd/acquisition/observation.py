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
    """What was observed so far; filled in step by step.

    Attributes
    ----------
    started_utc, started_monotonic_ns
        When the drop began, on both clocks.
    vacuum : VacuumReading or None
        The gauge before the release.
    may_have_fallen : bool
        The valve was told to open, whatever came of it.
    baseline : Baseline or None
        Of the idle input.
    environment : Environment or None
        Temperature and humidity before the release.
    trigger_ns, captured_ns : int
        Host clock at the trigger and once the record was whole. [ns]
    notes : list of str
        What a reader of the shot should know.
    """

    started_utc: str = field(default_factory=utc_now)
    started_monotonic_ns: int = field(default_factory=time.monotonic_ns)
    vacuum: VacuumReading | None = None
    may_have_fallen: bool = False
    valve: ValveReport | None = None
    baseline: Baseline | None = None
    environment: Environment | None = None
    trigger_ns: int = 0
    captured_ns: int = 0
    notes: list[str] = field(default_factory=list)

    def note_garbage(self, report: ValveReport) -> None:
        """Note the stray bytes that came with a valve's reply."""
        if report.garbage:
            self.notes.append(f"serial garbage tolerated: {report.garbage.hex(' ')}")

    def durations_s(self, stored_monotonic_ns: int) -> dict[str, float]:
        """Return how long the stored drop took.

        Parameters
        ----------
        stored_monotonic_ns : int
            Host clock once it was durable. [ns]

        Returns
        -------
        dict
            ``impact_to_stored_s`` and ``record_to_stored_s``. [s]
        """
        return {
            "impact_to_stored_s": (stored_monotonic_ns - self.trigger_ns) * 1e-9,
            "record_to_stored_s": (stored_monotonic_ns - self.captured_ns) * 1e-9,
        }


def trigger_settings(settings: Settings) -> TriggerSettings:
    """Return the trigger in the digitizer's words.

    Parameters
    ----------
    settings : Settings
        Times in seconds.

    Returns
    -------
    TriggerSettings
        Lengths in samples at the calibrated rate.
    """
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
    """Return what is known of a drop by now.

    Returns
    -------
    ShotMetadata
        For `Archive.store_shot` and `Archive.keep_partial`.
    """
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
