"""Admission to the rig: one operator at a time, and only on a rig that is ready."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from impactd.acquisition.errors import BusyError, DropHeightError, NotReadyError
from impactd.acquisition.preflight import (
    CalibrationState,
    Check,
    calibration_state,
    check_calibration,
    check_disk,
)
from impactd.acquisition.reservation import Reservation
from impactd.acquisition.rig_loop import RigLoop
from impactd.acquisition.transitions import State
from impactd.settings.settings import Settings
from impactd.storage.archive import FINAL_STATES, Archive

REMEDY = "Do what the sentence says; `impactd status` shows when the rig is ready."
# A client that saw "stored" may ask again at once; the loop is a few milliseconds behind its row.
_LAST_STEPS_S = 1.0


class Admission:
    """Decides whether a drop or a series may begin.

    Attributes
    ----------
    lock : threading.Lock
        Held from `admit` until the drop has begun, so that of many requests one wins.
    entering : int
        Requests on their way from `admit` to the loop; read without the lock.
    """

    def __init__(self, loop: RigLoop, archive: Archive, settings: Settings) -> None:
        self.lock = threading.Lock()
        self.reservation: Reservation | None = None
        self.entering = 0
        self._counting = threading.Lock()
        self._loop = loop
        self._archive = archive
        self._settings = settings

    @contextmanager
    def way_in(self) -> Iterator[None]:
        """Hold the lock; count whoever waits for it, because an abort must know of them."""
        with self._counting:
            self.entering += 1
        try:
            with self.lock:
                yield
        finally:
            with self._counting:
                self.entering -= 1

    def check_height(self, drop_height_m: float) -> None:
        """Raise `DropHeightError`, which says what is allowed, unless the rig allows a height."""
        rig = self._settings.rig
        # Written so that NaN is refused too.
        if not rig.min_drop_height_m <= drop_height_m <= rig.max_drop_height_m:
            raise DropHeightError(drop_height_m, rig.min_drop_height_m, rig.max_drop_height_m)

    def admit(
        self, calibration: int | None, sentence: str, series: Reservation | None = None
    ) -> None:
        """Raise unless a drop may begin now; the caller holds the lock.

        ``sentence`` is that of the status, for a rig that is not ready.

        Raises
        ------
        BusyError
            If somebody else holds the rig.
        NotReadyError
            If the rig cannot take a drop.
        StorageFullError
            If the disk's reserve would be touched.
        """
        self._wait_last_steps()
        with self._loop.present:
            run, state = self._loop.run, self._loop.machine.state
        if run is not None:
            raise BusyError(run.drop.owner, run.drop.number)
        held = self.reservation
        own = held is not None and (
            series is held or (calibration is not None and held.calibration == calibration)
        )
        if held is not None and not own:
            raise BusyError(held.owner, None)
        if state is not State.IDLE or self._loop.ending.is_set():
            raise NotReadyError(sentence, REMEDY)
        checks = (
            *self._loop.watch.findings.checks,
            *self.quick_checks(self.calibration(), for_calibration=calibration is not None),
        )
        for check in checks:
            if not check.ok:
                self._loop.look_again()
                if check.name == "disk":
                    self._archive.check_space()  # a full disk has an error of its own
                raise NotReadyError(f"NOT READY: {check.sentence}.", check.remedy or REMEDY)

    def calibration(self) -> CalibrationState:
        """Return the state of the load cell's calibration."""
        return calibration_state(self._archive.calibrations.current(), self._settings.calibration)

    def quick_checks(
        self, calibration: CalibrationState, *, for_calibration: bool = False
    ) -> tuple[Check, ...]:
        """Return the checks that cost nothing, disk and calibration; a failed one is no error."""
        try:
            disk = check_disk(self._archive.free_bytes())
        except OSError as error:
            what = f"the archive's disk does not answer: {error.strerror}"
            disk = Check("disk", False, what, "Check whether it is mounted.")
        limits = self._settings.preflight
        return disk, check_calibration(calibration, limits, for_calibration=for_calibration)

    def alarms(self, calibration: CalibrationState) -> list[str]:
        """Return what needs attention about the calibration although drops are possible."""
        alarms = []
        if calibration.word != "valid":
            alarms.append(f"{calibration.sentence[0].upper()}{calibration.sentence[1:]}.")
        limit = self._settings.calibration.drift_limit_sigmas
        if calibration.drift_sigmas is not None and calibration.drift_sigmas > limit:
            alarms.append(
                f"The load cell drifted by {calibration.drift_sigmas:.1f} standard deviations "
                f"since the previous calibration (limit {limit:g})."
            )
        return alarms

    def _wait_last_steps(self) -> None:
        with self._loop.present:
            run = self._loop.run
        if run is not None and self._archive.drop(run.drop.number).state in FINAL_STATES:
            run.finished.wait(_LAST_STEPS_S)
