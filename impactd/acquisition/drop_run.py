"""One drop from the request to the stored shot, step by step, on the loop's thread.

::

    load -> check -> arm -> release -> wait for the impact -> hold -> capture -> store

Each step does something, then tells the machine. A step that cannot be done raises; `DropRun` never
cleans up itself, the loop does that in one place for failures and aborts alike.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.bounce import first_impact
from drivers.digitizer import Record
from drivers.errors import AbortedError, DriverError, TriggerTimeoutError
from impactd.acquisition import refusals
from impactd.acquisition.devices import hold
from impactd.acquisition.environment_reading import EnvironmentReading
from impactd.acquisition.events import Event
from impactd.acquisition.failures import RescuedError, StepFailedError
from impactd.acquisition.observation import Observation, metadata_of, trigger_settings
from impactd.acquisition.preflight import (
    Baseline,
    Check,
    calibration_state,
    check_calibration,
    check_disk,
    check_input,
)
from impactd.acquisition.transitions import IllegalTransitionError, Machine, State
from impactd.acquisition.valve_guard import ValveGuard
from impactd.rig.rig import Rig
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import (
    Archive,
    ArchiveError,
    Drop,
    DropStateError,
    NotFoundError,
    Shot,
    ShotMetadata,
)

_LOOK_EVERY_S = 0.01
_STORE_AGAIN_S = 0.5
# Where no impact comes, the walk asks the gauge once (one answer of the valve) and then closes the
# valve itself. Only a walk that is stuck leaves it to the timer, so much later.
_CLOSING_S = 1.0
# The height is known to a percent or so and the trigger comes a little late; a "fall" shorter than
# this share of sqrt(2 h / g) was something else knocking at the cell.
_SHORTEST_FALL_SHARE = 0.8


class DropRun:
    """One drop under way.

    Parameters
    ----------
    accepted : int
        Abort epoch at which it was asked for.
    moved : callable
        Told after each step: ``(drop_state or None)``.
    tell : callable
        ``tell(kind, data)`` publishes an event; never waits.
    beat : callable
        Called while waiting, for the watchdog.
    ending : threading.Event
        Set once the daemon ends: a record that cannot be stored is waited for no longer.

    Attributes
    ----------
    doing : str
        What happens now, in words for the status sentence.
    aborting : threading.Event
        Set by whoever wants the end.
    finished : threading.Event
        Set once the drop's row says how it ended.
    hold_error : DriverError or None
        Of a valve that did not close after the impact.
    """

    def __init__(
        self,
        drop: Drop,
        *,
        accepted: int,
        guard: ValveGuard,
        rig: Rig,
        archive: Archive,
        settings: Settings,
        materials: Materials,
        machine: Machine,
        moved: Callable[[str | None], None],
        tell: Callable[[str, dict[str, Any]], None],
        beat: Callable[[], None],
        ending: threading.Event,
    ) -> None:
        self.drop = drop
        self.doing = "is being prepared"
        self.seen = Observation()
        self.aborting = threading.Event()
        self.aborted_by = ""
        self.finished = threading.Event()
        self.hold_error: DriverError | None = None
        self._accepted = accepted
        self._guard = guard
        self._rig = rig
        self._archive = archive
        self._settings = settings
        self._materials = materials
        self._machine = machine
        self._moved = moved
        self._tell = tell
        self._beat = beat
        self._ending = ending

    @property
    def fall_time_s(self) -> float:
        """Time of a free fall from the drop height, sqrt(2 h / g). [s]"""
        height_m = self.drop.request.drop_height_m
        return math.sqrt(2 * height_m / self._settings.release.gravity_m_per_s2)

    @property
    def _impact_limit_s(self) -> float:
        """Longest time from the release to the impact. [s]"""
        return self.fall_time_s + self._settings.timeouts.impact_margin_s

    def run(self) -> Shot:
        """Execute all steps; return the shot, durably stored.

        `hold_error` tells of a valve that did not close afterwards.

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
        return self._store(record)

    def metadata(self) -> ShotMetadata:
        """Return the metadata that are known by now."""
        return metadata_of(
            self.seen,
            self.drop.request,
            rig=self._rig,
            settings=self._settings,
            materials=self._materials,
            calibration=self._archive.calibrations.current(),
        )

    # Steps

    def _load(self) -> None:
        request = self.drop.request
        words = self._rig.loader.ask(request.sphere, request.surface, request.drop_height_m)
        self.doing = f"waits for its sphere: {words}"
        self._moved(None)
        try:
            self._wait_held(words)
        finally:
            self._rig.loader.cancel()
        self._advance(Event.SPHERE_HELD, "waits for a quiet input")

    def _wait_held(self, words: str) -> None:
        times = self._settings.timeouts
        began_s = time.monotonic()
        held_since_s: float | None = None
        while True:
            self._pulse()
            reading = self.seen.vacuum = self._rig.valve.vacuum()
            now_s = time.monotonic()
            if reading is None:
                self._wait_blind(began_s, words)
                return
            if not reading.held:
                held_since_s = None
            elif held_since_s is None:
                held_since_s = now_s
            if held_since_s is not None and now_s - held_since_s >= times.held_stable_s:
                return
            if now_s - began_s > times.loading_s:
                raise refusals.not_held(times.loading_s, reading, words)
            self.aborting.wait(_LOOK_EVERY_S)

    def _wait_blind(self, began_s: float, words: str) -> None:
        """Wait a fixed time, because the valve has no gauge, and say so in the file."""
        limit_s = self._settings.timeouts.blind_loading_s
        self.doing = f"gives {limit_s:g} s to hang its sphere unseen: {words}"
        self.seen.notes.append("sphere held: cannot tell, the valve has no vacuum gauge")
        while time.monotonic() - began_s < limit_s:
            self._pulse()
            self.aborting.wait(_LOOK_EVERY_S)

    def _check(self) -> None:
        limits = self._settings.preflight
        self._read_environment()
        quiet = self._wait_quiet()
        state = calibration_state(self._archive.calibrations.current(), self._settings.calibration)
        checks = (
            quiet,
            check_disk(self._archive.free_bytes()),
            check_calibration(state, limits, for_calibration=self.drop.calibration is not None),
        )
        for check in checks:
            if not check.ok:
                raise refusals.preflight_refused(check)
        self._advance(Event.CHECKS_PASSED, "arms the digitizer", "arming")

    def _read_environment(self) -> None:
        """Read temperature and humidity; without them the drop goes on, with a note why."""
        # Before the look at the input, which nothing may part from the release.
        with EnvironmentReading(self._settings.environment, self.drop.request.environment) as read:
            if not read.wait(0.0):
                self.doing = "waits for temperature and humidity"
                self._moved(None)
            while not read.wait(_LOOK_EVERY_S):
                self._pulse()
            self.seen.environment, unknown = read.result()
        if unknown is not None:
            self.seen.notes.append(f"temperature and humidity not known: {unknown.reason}")
            self._tell(
                "environment.unknown",
                {"drop": self.drop.number, "detail": unknown.reason, "remedy": unknown.remedy},
            )
        self.doing = "waits for a quiet input"

    def _wait_quiet(self) -> Check:
        """Check the idle input until it is quiet: the last sphere may still be bouncing."""
        limits = self._settings.preflight
        ends_s = time.monotonic() + self._settings.timeouts.settle_s
        while True:
            self._pulse()
            signal_v = self._rig.digitizer.sample_baseline(limits.baseline_samples)
            self.seen.baseline = Baseline.of(signal_v)
            check = check_input(self.seen.baseline, limits, self._settings.trigger)
            if check.ok or time.monotonic() >= ends_s:
                return check
            self.aborting.wait(_LOOK_EVERY_S)

    def _arm(self) -> None:
        self._pulse()
        self._rig.digitizer.arm(trigger_settings(self._settings))
        self._advance(Event.STREAMING, "releases the sphere", "armed")

    def _release(self) -> None:
        self._pulse()
        limit_s = self._impact_limit_s + self._settings.valve.timeout_s + _CLOSING_S
        self.seen.may_have_fallen = True
        report = self.seen.valve = self._guard.open(self._accepted, limit_s)
        if self._rig.valve.can_confirm and not report.confirmed:
            raise refusals.valve_unconfirmed()
        if not report.confirmed:
            self.seen.notes.append("valve state commanded, unconfirmed")
        self.seen.note_garbage(report)
        self._advance(Event.VALVE_OPENED, "falls", "released")

    def _wait_impact(self) -> None:
        limit_s = self._impact_limit_s
        try:
            trigger_ns = self._rig.digitizer.wait_trigger(limit_s, self.aborting)
        except TriggerTimeoutError as error:
            raise self._missed(limit_s, error) from error
        self.seen.trigger_ns = trigger_ns
        self._hold_again()
        self._advance(Event.TRIGGERED, "is being recorded", "capturing")

    def _missed(self, limit_s: float, error: TriggerTimeoutError) -> StepFailedError:
        """Distinguish a sphere that still hangs from one that fell beside the coupon."""
        reading = self._rig.valve.vacuum()
        if reading is not None and reading.held:
            return refusals.not_released(limit_s, reading, error.record)
        level_v = self._settings.trigger.level_v
        return refusals.no_impact(level_v, limit_s, self.fall_time_s, error.record)

    def _capture(self) -> Record:
        self._beat()
        margin_s = self._settings.timeouts.record_margin_s
        record = self._rig.digitizer.wait_record(margin_s, self.aborting)
        self.seen.captured_ns = time.monotonic_ns()
        record = self._at_the_impact(record)
        try:
            self._advance(Event.RECORD_COMPLETE, "is being stored", "storing")
        except AbortedError:
            raise refusals.aborted_when_full(record) from None
        return record

    def _at_the_impact(self, record: Record) -> Record:
        """Return the record, its trigger index moved if something else set off the trigger.

        A StepFailedError says that the impact comes before the sphere can have landed.
        """
        assert self.seen.valve is not None
        rate_hz, trigger = record.sample_rate_hz, record.trigger_index
        impact = first_impact(record.codes.astype(np.float64), rate_hz, trigger)
        late_s = (impact - trigger) / rate_hz
        # From before the command: a busy host reads its clock late, and must not lose a drop by it.
        waited_ns = self.seen.trigger_ns - self.seen.valve.began_monotonic_ns
        seen_s = waited_ns * 1e-9 * self._rig.clock_speed + late_s
        if seen_s < _SHORTEST_FALL_SHARE * self.fall_time_s:
            raise refusals.early_trigger(seen_s, self.fall_time_s, record)
        if impact == trigger:
            return record
        self.seen.notes.append(
            f"something else set off the trigger, {late_s * 1e3:.1f} ms before the impact; "
            "trigger_index is that of the impact"
        )
        self._tell("trigger.early", {"drop": self.drop.number, "early_s": late_s})
        late_ns = round(late_s * 1e9 / self._rig.clock_speed)
        return replace(
            record,
            trigger_index=impact,
            trigger_monotonic_ns=record.trigger_monotonic_ns + late_ns,
        )

    def _hold_again(self) -> None:
        """Close the valve; its failure must not cost the shot that is being recorded."""
        try:
            self.seen.note_garbage(hold(self._rig))
            self._guard.is_closed()
        except DriverError as error:
            self.hold_error = error
            self.seen.notes.append(f"the valve did not close after the impact: {error.what}")

    def _store(self, record: Record) -> Shot:
        self._beat()
        if not record.calibrated:
            self.seen.notes.append(
                "the digitizer's calibration table was refused: uncalibrated volts"
            )
        while True:
            try:
                return self._archive.store_shot(self.drop.number, record, self.metadata())
            except (DropStateError, NotFoundError):
                raise
            except ArchiveError as error:
                if self._ending.is_set():
                    raise self._rescued(record, error) from error
                self._keep_in_memory(error)

    def _rescued(self, record: Record, error: ArchiveError) -> RescuedError | ArchiveError:
        """Write a record to another disk, because memory ends with this process."""
        try:
            path = self._archive.rescue_shot(self.drop.number, record, self.metadata())
        except ArchiveError as nowhere:
            return ArchiveError(
                "The daemon had to end while a record could not be stored, and the record is "
                f"lost. {error.what} {nowhere.what}",
                remedy="Free space and request a new drop.",
            )
        return RescuedError(path)

    def _keep_in_memory(self, error: ArchiveError) -> None:
        """Publish what keeps the record from being stored, and wait: a fall cannot be repeated."""
        doing = f"keeps its record in memory until it can be stored: {error}"
        if doing != self.doing:
            self.doing = doing
            self._moved(None)
        ends_s = time.monotonic() + _STORE_AGAIN_S
        while time.monotonic() < ends_s and not self._ending.is_set():
            self._beat()
            self._ending.wait(_LOOK_EVERY_S)

    # Inside

    def _pulse(self) -> None:
        self._beat()
        if self.aborting.is_set():
            raise AbortedError("The drop was aborted.")

    def _advance(self, event: Event, doing: str, drop_state: str | None = None) -> None:
        """Send an event to the state machine, and report the next step."""
        try:
            self._machine.apply(event)
        except IllegalTransitionError:
            # Another thread aborted between the step and this line.
            if self.aborting.is_set() and self._machine.state is State.STOPPING:
                raise AbortedError("The drop was aborted.") from None
            raise
        self.doing = doing
        self._moved(drop_state)
