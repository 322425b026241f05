"""One drop from the request to the stored shot, step by step, on the service's thread.

::

    load -> check -> arm -> release -> wait for the impact -> capture -> hold -> store

Each step does something, then tells the machine. A step that cannot be done raises; `DropRun` never
cleans up itself, the service does that in one place for failures and aborts alike.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.digitizer import Record, TriggerSettings
from drivers.errors import AbortedError, DriverError, TriggerTimeoutError
from drivers.valve import VacuumReading, ValveReport
from impactd import __version__
from impactd.acquisition.devices import hold
from impactd.acquisition.events import Event
from impactd.acquisition.failures import Doubt, StepFailedError
from impactd.acquisition.preflight import (
    Baseline,
    Check,
    calibration_state,
    check_calibration,
    check_disk,
    check_input,
)
from impactd.acquisition.transitions import IllegalTransitionError, Machine, State
from impactd.materials import Materials
from impactd.rig import Rig
from impactd.settings import Settings
from impactd.storage.archive import Archive, Drop, ShotAbout
from impactd.storage.moment import utc_now
from impactd.storage.problem import Problem
from impactd.storage.shots import Shot

_LOOK_EVERY_S = 0.01
# The height is known to a percent or so and the trigger comes a little late; a "fall" shorter than
# this share of sqrt(2 h / g) was something else knocking at the cell.
_SHORTEST_FALL_SHARE = 0.8


@dataclass
class Progress:
    """What other threads may read while a drop runs.

    Attributes
    ----------
    doing : str
        What happens now, in words for the status sentence.
    baseline : Baseline or None
        Of the idle input before this drop.
    checks : list of Check
        What pre-flight found.
    """

    doing: str = "is being prepared"
    baseline: Baseline | None = None
    checks: list[Check] = field(default_factory=list)


class DropRun:
    """One drop under way.

    Parameters
    ----------
    drop : Drop
        Its row.
    rig, archive, settings, materials, machine
        What it works with.
    moved : callable
        Told after each step: ``(drop_state or None)``.
    beat : callable
        Called while waiting, for the watchdog.

    Attributes
    ----------
    aborting : threading.Event
        Set by whoever wants the end.
    aborted_by : str
        Who that was.
    release_lock : threading.Lock
        Held around the release, so that an abort is either before or after it.
    finished : threading.Event
        Set once the drop's row says how it ended.
    """

    def __init__(
        self,
        drop: Drop,
        *,
        rig: Rig,
        archive: Archive,
        settings: Settings,
        materials: Materials,
        machine: Machine,
        moved: Callable[[str | None], None],
        beat: Callable[[], None],
    ) -> None:
        self.drop = drop
        self.progress = Progress()
        self.aborting = threading.Event()
        self.aborted_by = ""
        self.release_lock = threading.Lock()
        self.finished = threading.Event()
        self._rig = rig
        self._archive = archive
        self._settings = settings
        self._materials = materials
        self._machine = machine
        self._moved = moved
        self._beat = beat
        self._started_utc = utc_now()
        self._started_ns = time.monotonic_ns()
        self._vacuum: VacuumReading | None = None
        self._valve: ValveReport | None = None
        self._trigger_ns = 0
        self._captured_ns = 0
        self._notes: list[str] = []
        self.hold_error: DriverError | None = None

    @property
    def fall_time_s(self) -> float:
        """Time of a free fall from the drop height, sqrt(2 h / g). [s]"""
        height_m = self.drop.request.drop_height_m
        return math.sqrt(2 * height_m / self._settings.release.gravity_m_per_s2)

    def run(self) -> Shot:
        """Walk through all steps.

        Returns
        -------
        Shot
            Durably stored. `hold_error` tells of a valve that did not close afterwards.

        Raises
        ------
        StepFailedError, AbortedError, DriverError, ArchiveError
            Something went wrong; nothing has been cleaned up.
        """
        self._load()
        self._check()
        self._arm()
        self._release()
        self._wait_impact()
        record = self._capture()
        self._hold_again()
        return self._store(record)

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
            "impact_to_stored_s": (stored_monotonic_ns - self._trigger_ns) * 1e-9,
            "record_to_stored_s": (stored_monotonic_ns - self._captured_ns) * 1e-9,
        }

    def about(self) -> ShotAbout:
        """Return the circumstances as far as they are known by now."""
        request, settings = self.drop.request, self._settings
        calibration = self._archive.calibrations.current()
        baseline = self.progress.baseline
        valve = self._valve
        return ShotAbout(
            started_utc=self._started_utc,
            started_monotonic_ns=self._started_ns,
            gravity_m_per_s2=settings.release.gravity_m_per_s2,
            operator=request.operator,
            sphere=self._materials.spheres[request.sphere],
            surface=self._materials.surfaces[request.surface],
            drop_height_m=request.drop_height_m,
            speed_repeatability=settings.release.speed_repeatability,
            valve_monotonic_ns=valve.sent_monotonic_ns if valve else None,
            valve_identity=self._rig.valve.identity,
            valve_confirmed=valve.confirmed if valve else None,
            vacuum_v=self._vacuum.volts if self._vacuum else None,
            digitizer=self._rig.digitizer.identity,
            trigger=self._trigger(),
            baseline_v=baseline.mean_v if baseline else None,
            noise_rms_v=baseline.noise_rms_v if baseline else None,
            sensor=settings.sensor.sensor(),
            calibration=calibration.number if calibration else None,
            configuration=settings.snapshot(),
            software=f"impactd {__version__}",
            notes=tuple(self._notes),
        )

    # Steps

    def _load(self) -> None:
        request = self.drop.request
        words = self._rig.loader.ask(request.sphere, request.surface, request.drop_height_m)
        timeouts = self._settings.timeouts
        self.progress.doing = f"waits for its sphere: {words}"
        self._moved(None)
        try:
            self._wait_held(timeouts.loading_s, timeouts.held_stable_s, words)
        finally:
            self._rig.loader.cancel()
        self._advance(Event.SPHERE_HELD)

    def _wait_held(self, limit_s: float, stable_s: float, words: str) -> None:
        began_s = time.monotonic()
        held_since_s: float | None = None
        while True:
            self._look_for_abort()
            self._beat()
            self._vacuum = self._rig.valve.vacuum()
            now_s = time.monotonic()
            if self._vacuum is None:
                self._wait_blind(began_s, words)
                return
            if not self._vacuum.held:
                held_since_s = None
            elif held_since_s is None:
                held_since_s = now_s
            if held_since_s is not None and now_s - held_since_s >= stable_s:
                return
            if now_s - began_s > limit_s:
                raise StepFailedError(
                    Problem(
                        "sphere-not-held",
                        "No sphere is held",
                        504,
                        f"No sphere was held within {limit_s:g} s; the gauge reads "
                        f"{self._vacuum.volts:.2f} V.",
                        f"Please {words}; look for a leak and a stopped pump if one hangs there.",
                    )
                )
            self.aborting.wait(_LOOK_EVERY_S)

    def _wait_blind(self, began_s: float, words: str) -> None:
        """Without a gauge nobody can tell; give the person time, and say so in the file."""
        limit_s = self._settings.timeouts.blind_loading_s
        self.progress.doing = f"gives {limit_s:g} s to hang its sphere unseen: {words}"
        self._notes.append("sphere held: cannot tell, the valve has no vacuum gauge")
        while time.monotonic() - began_s < limit_s:
            self._look_for_abort()
            self._beat()
            self.aborting.wait(_LOOK_EVERY_S)

    def _check(self) -> None:
        limits = self._settings.preflight
        quiet = self._wait_quiet()
        state = calibration_state(self._archive.calibrations.current(), self._settings.calibration)
        self.progress.checks = [
            quiet,
            check_disk(self._archive.free_bytes()),
            check_calibration(state, limits, for_calibration=self.drop.calibration is not None),
        ]
        for check in self.progress.checks:
            if not check.ok:
                raise StepFailedError(
                    Problem(
                        f"preflight-{check.name}",
                        "Pre-flight refused the drop",
                        503,
                        f"The {check.name} does not allow a drop: {check.sentence}.",
                        check.remedy,
                    )
                )
        self._advance(Event.CHECKS_PASSED, "arming")

    def _wait_quiet(self) -> Check:
        """Look at the idle input until it is quiet: the last sphere may still be bouncing."""
        self.progress.doing = "waits for a quiet input"
        limits = self._settings.preflight
        ends_s = time.monotonic() + self._settings.timeouts.settle_s
        while True:
            self._look_for_abort()
            self._beat()
            signal_v = self._rig.digitizer.sample_baseline(limits.baseline_samples)
            self.progress.baseline = Baseline.of(signal_v)
            check = check_input(self.progress.baseline, limits, self._settings.trigger)
            if check.ok or time.monotonic() >= ends_s:
                return check
            self.aborting.wait(_LOOK_EVERY_S)

    def _arm(self) -> None:
        self.progress.doing = "arms the digitizer"
        self._beat()
        self._rig.digitizer.arm(self._trigger())
        self._advance(Event.STREAMING, "armed")

    def _release(self) -> None:
        self.progress.doing = "releases the sphere"
        # The lock makes an abort fall either before the release, which then does not happen, or
        # after it, in which case the abort's own "vacuum on" has the last word.
        with self.release_lock:
            self._look_for_abort()
            self._valve = self._rig.valve.release()
        if self._rig.valve.can_confirm and not self._valve.confirmed:
            raise StepFailedError(
                Problem(
                    "valve-unconfirmed",
                    "The valve did not confirm",
                    500,
                    "The relay board did not read back that the valve is open.",
                    "Check relay and valve, then acknowledge the fault.",
                ),
                doubt=Doubt.PERSON,
            )
        if not self._valve.confirmed:
            self._notes.append("valve state commanded, unconfirmed")
        if self._valve.garbage:
            self._notes.append(f"serial garbage tolerated: {self._valve.garbage.hex(' ')}")
        self._advance(Event.VALVE_OPENED, "released")

    def _wait_impact(self) -> None:
        self.progress.doing = "falls"
        limit_s = self.fall_time_s + self._settings.timeouts.impact_margin_s
        self._beat()
        try:
            trigger_ns = self._rig.digitizer.wait_trigger(limit_s, self.aborting)
        except TriggerTimeoutError as error:
            raise self._missed(limit_s, error) from error
        assert self._valve is not None
        self._trigger_ns = trigger_ns
        fall_s = (trigger_ns - self._valve.sent_monotonic_ns) * 1e-9 * self._rig.clock_speed
        early = fall_s < _SHORTEST_FALL_SHARE * self.fall_time_s
        self._advance(Event.TRIGGERED, "capturing")
        if early:
            # The record is filled up nevertheless: it is the evidence.
            raise StepFailedError(
                Problem(
                    "early-trigger",
                    "Something else hit the cell",
                    500,
                    f"The trigger came {fall_s * 1e3:.1f} ms after the valve, and the fall takes "
                    f"{self.fall_time_s * 1e3:.1f} ms: that was not the sphere.",
                    "Look for vibration and for a trigger level too near the noise; then repeat.",
                ),
                record=self._rig.digitizer.wait_record(limit_s, self.aborting),
            )

    def _missed(self, limit_s: float, error: TriggerTimeoutError) -> StepFailedError:
        """Tell a sphere that still hangs from one that fell beside the coupon."""
        reading = self._rig.valve.vacuum()
        if reading is not None and reading.held:
            return StepFailedError(
                Problem(
                    "sphere-not-released",
                    "The sphere did not fall",
                    504,
                    f"The valve was opened and the gauge still says held ({reading.volts:.2f} V) "
                    f"after {limit_s:.2f} s: relay or valve is stuck.",
                    "Check the relay and the valve, take the sphere off, then acknowledge the "
                    "fault.",
                ),
                doubt=Doubt.PERSON,
                record=error.record,
            )
        level_v = self._settings.trigger.level_v
        return StepFailedError(
            Problem(
                "no-impact",
                "No impact was seen",
                504,
                f"No impact above {level_v * 1e3:g} mV was seen within {limit_s:.2f} s of the "
                f"release; the fall takes {self.fall_time_s:.3f} s.",
                "Look where the sphere went; if it hit the coupon, lower trigger.level_v or check "
                "cell and conditioner.",
            ),
            record=error.record,
        )

    def _capture(self) -> Record:
        self.progress.doing = "is being recorded"
        self._beat()
        margin_s = self._settings.timeouts.record_margin_s
        record = self._rig.digitizer.wait_record(margin_s, self.aborting)
        self._captured_ns = time.monotonic_ns()
        try:
            self._advance(Event.RECORD_COMPLETE, "storing")
        except AbortedError:
            raise StepFailedError(
                Problem("aborted", "Drop aborted", 409, "Aborted as the record was full.", ""),
                record=record,
            ) from None
        return record

    def _hold_again(self) -> None:
        """Close the valve; its failure must not cost the shot that is already in memory."""
        try:
            report = hold(self._rig)
        except DriverError as error:
            self.hold_error = error
            self._notes.append(f"the valve did not close after the record: {error.what}")
        else:
            if report.garbage:
                self._notes.append(f"serial garbage tolerated: {report.garbage.hex(' ')}")

    def _store(self, record: Record) -> Shot:
        self.progress.doing = "is being stored"
        self._beat()
        if not record.calibrated:
            self._notes.append("the digitizer's calibration table was refused: uncalibrated volts")
        return self._archive.store_shot(self.drop.number, record, self.about())

    # Inside

    def _trigger(self) -> TriggerSettings:
        trigger, rate_hz = self._settings.trigger, self._settings.digitizer.sample_rate_hz
        return TriggerSettings(
            level_v=trigger.level_v,
            hysteresis_v=trigger.hysteresis_v,
            pre_trigger_samples=round(trigger.pre_trigger_s * rate_hz),
            record_samples=round(trigger.record_s * rate_hz),
        )

    def _look_for_abort(self) -> None:
        if self.aborting.is_set():
            raise AbortedError("The drop was aborted.")

    def _advance(self, event: Event, drop_state: str | None = None) -> None:
        try:
            self._machine.apply(event)
        except IllegalTransitionError:
            # Another thread aborted between the step and this line.
            if self.aborting.is_set() and self._machine.state is State.STOPPING:
                raise AbortedError("The drop was aborted.") from None
            raise
        self._moved(drop_state)
