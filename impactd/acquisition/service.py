"""The acquisition service: admits one drop at a time, runs it, aborts it, reports the status.

::

    any thread ── request_drop ──> row in the archive ──> machine: REQUESTED ──┐
    any thread ── abort ──> vacuum on, digitizer stopped, machine: ABORTED     │
                                                                               v
    rig_loop.RigLoop ── connect ── look (idle) ── DropRun.run ── clean up ── recover

Only the loop's own thread drives the devices. An abort is the one exception: it touches them
from the caller's thread, because it must not wait for anything.
"""

from __future__ import annotations

import time
from typing import Any

import structlog

from impactd.acquisition.abort_epoch import AbortEpoch
from impactd.acquisition.admission import REMEDY, Admission
from impactd.acquisition.devices import make_safe
from impactd.acquisition.endings import about_drop
from impactd.acquisition.errors import NotReadyError
from impactd.acquisition.events import Event
from impactd.acquisition.progress_writer import ProgressWriter
from impactd.acquisition.reservation import AbortReport, Reservation, report_of
from impactd.acquisition.rig_loop import Publish, RigLoop
from impactd.acquisition.status import Facts, ServiceStatus, status_of
from impactd.acquisition.transitions import DROP_UNDER_WAY, State
from impactd.rig.rig import Rig
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import (
    FINAL_STATES,
    Archive,
    ArchiveError,
    Drop,
    DropRequest,
)

_log = structlog.get_logger("impactd.acquisition")
# Longer than any single step may block (firmware load 5 s, a fall, a slow disk).
_ALIVE_WITHIN_S = 20.0
# An abort waits this long for the drop's row, so that its answer can already say "aborted".
_ROW_PATIENCE_S = 0.05
_ACKNOWLEDGE_S = 10.0
# A drop waits for its sphere and for a quiet input; beyond all its own limits something is wrong.
_DROP_MARGIN_S = 30.0
# At the end, for events that still wait: as long as the index waits for its lock.
_LAST_WORDS_S = 10.0


class AcquisitionService:
    """Drops, one at a time.

    The service opens the rig's devices. ``publish(kind, data)`` tells clients what happened.
    """

    def __init__(
        self,
        rig: Rig,
        archive: Archive,
        settings: Settings,
        materials: Materials,
        publish: Publish,
    ) -> None:
        self._rig = rig
        self._archive = archive
        self._settings = settings
        self._materials = materials
        self._tell = publish
        self._epoch = AbortEpoch()
        self._writer = ProgressWriter()
        self._loop = RigLoop(
            rig,
            archive,
            settings,
            materials,
            self.publish,
            epoch=self._epoch,
            writer=self._writer,
        )
        self._admission = Admission(self._loop, archive, settings)

    # Life

    def start(self) -> None:
        """End what a dead daemon left under way, then open the devices in the service's thread."""
        for drop in self._archive.interrupt_unfinished():
            self.publish(f"drop.{drop.state}", about_drop(drop))
        self._epoch.open()
        self._loop.start()

    def stop(self) -> None:
        """End whatever runs with the valve safe; safe to call twice."""
        # Nothing moves from here on, whoever still waits for the disk or for a lock.
        self._epoch.close("shutdown")
        self._loop.ending.set()
        self.abort(by="shutdown")
        self._loop.stop()
        self._writer.stop(_LAST_WORDS_S)

    def alive(self) -> bool:
        """Return whether loop and database answered lately, for the watchdog."""
        if not self._loop.is_running():
            return False
        if time.monotonic() - self._loop.beat_s > _ALIVE_WITHIN_S:
            return False
        try:
            self._archive.events.last_id()
        except Exception:  # whatever it is, the database did not answer
            _log.exception("the archive's index does not answer")
            return False
        return True

    # Requests

    @property
    def epoch(self) -> AbortEpoch:
        """The abort epoch; each request is stamped with it on arrival."""
        return self._epoch

    @property
    def drop_under_way(self) -> Drop | None:
        """The drop under way as it was begun, without asking the database."""
        with self._loop.present:
            return self._loop.run.drop if self._loop.run is not None else None

    def request_drop(
        self,
        request: DropRequest,
        *,
        owner: str,
        idempotency_key: str | None = None,
        calibration: int | None = None,
        accepted: int | None = None,
        series: Reservation | None = None,
    ) -> Drop:
        """Begin a drop; return as soon as its row is durable.

        The drop is ``requested``, or however far the drop of the same key has come; ``failed`` when
        the rig went into doubt meanwhile, ``aborted`` when somebody aborted meanwhile.

        Parameters
        ----------
        owner : str
            How others are told who holds the rig.
        idempotency_key : str, optional
            The same key with the same request gives the same drop, even while the rig is busy.
        calibration : int, optional
            The calibration run it belongs to.
        accepted : int, optional
            Abort epoch at which the request was received; now without it.
        series : Reservation, optional
            The reservation of the series it belongs to.

        Raises
        ------
        UnknownMaterialError, DropHeightError
            If the rig does not know or allow what is asked.
        IdempotencyConflictError
            If the key belongs to another request.
        RequestAbortedError
            If somebody aborted since it was received.
        BusyError
            If somebody else holds the rig.
        NotReadyError
            If the rig cannot take a drop now.
        """
        epoch = self._epoch.now() if accepted is None else accepted
        self._materials.check(request.sphere, request.surface)
        self.check_height(request.drop_height_m)
        with self._admission.way_in():
            if idempotency_key is not None:
                known = self._archive.drop_by_key(idempotency_key, request)
                if known is not None:
                    return known
            self._check_epoch(epoch)
            self._admission.admit(calibration, self.status().sentence, series)
            self._check_epoch(epoch)
            drop, _ = self._archive.begin_drop(
                request, owner=owner, idempotency_key=idempotency_key, calibration=calibration
            )
            begun = self._loop.begin(drop, epoch)
        self.publish("drop.requested", about_drop(drop))
        return drop if begun else self._archive.drop(drop.number)

    def _check_epoch(self, epoch: int) -> None:
        # Only for a clear answer: what counts is the comparison as the valve opens.
        if self._loop.ending.is_set():
            return  # the daemon ends, and says so itself
        if not self._epoch.is_present(epoch):
            raise self._epoch.refusal()

    def reserve(
        self, owner: str, calibration: int | None = None, accepted: int | None = None
    ) -> Reservation:
        """Hold the rig for a series of drops, until `give_back`.

        Parameters
        ----------
        owner : str
            How others are told who holds the rig.
        calibration : int, optional
            Only drops of this calibration run are let through.
        accepted : int, optional
            Abort epoch at which the series was asked for; now without it.

        Raises
        ------
        RequestAbortedError
            If somebody aborted since it was asked for.
        BusyError
            If somebody else holds the rig.
        NotReadyError
            If the rig cannot take a drop now.
        """
        epoch = self._epoch.now() if accepted is None else accepted
        with self._admission.way_in():
            self._admission.admit(calibration, self.status().sentence)
            self._check_epoch(epoch)
            reservation = Reservation(owner, calibration, epoch)
            self._admission.reservation = reservation
            return reservation

    def give_back(self, reservation: Reservation) -> None:
        """End a reservation; do nothing when it has ended."""
        with self._admission.lock:
            if self._admission.reservation is reservation:
                self._admission.reservation = None

    def abort(self, *, by: str, number: int | None = None) -> AbortReport:
        """End whatever runs: vacuum on, digitizer stopped, state changed, before this returns.

        Nothing that was accepted before the return moves the valve any more. No database and no
        file is touched, and no lock is waited for that is held longer than some microseconds.
        With a ``number``, only if this drop is the one under way; without, the rig is made safe
        even when nothing runs.
        """
        began_s = time.monotonic()
        with self._loop.present:
            run = self._loop.run
            # A drop that has its row and not yet the rig is one of those that are entering.
            entering = self._admission.entering if run is None else 0
            other = run.drop.number != number if run is not None else entering == 0
            if number is not None and other:
                return AbortReport(False, None, f"Drop {number} is not under way.", 0.0)
            self._epoch.advance(by)
            reservation = self._admission.reservation
            if run is not None:
                run.aborted_by = run.aborted_by or by
                run.aborting.set()
            before = self._loop.machine.apply(Event.ABORTED)
        if reservation is not None:
            reservation.aborted_by = by
            reservation.aborted.set()
        troubles = make_safe(self._rig)
        took_s = time.monotonic() - began_s
        if run is not None and before in DROP_UNDER_WAY:
            run.finished.wait(_ROW_PATIENCE_S)
        number = run.drop.number if run is not None else None
        report = report_of(
            before, number, reservation, entering=entering, troubles=troubles, took_s=took_s
        )
        _log.info("abort", by=by, state=before.value, took_ms=round(took_s * 1e3, 1))
        told = {"by": by, "drop": report.drop, "took_s": took_s, "sentence": report.sentence}
        self.publish("rig.abort", told)
        # Once more: what was accepted while the vacuum went on is older than this answer.
        self._epoch.advance(by)
        return report

    def acknowledge_fault(self, *, by: str) -> None:
        """Confirm that the rig was checked; the devices are asked again and the rig becomes idle.

        Raises NotReadyError if a device still does not answer.
        """
        if self._loop.machine.state is not State.FAULT:
            return
        self.publish("rig.acknowledged", {"by": by})
        self._loop.acknowledge()
        if not self.wait_ready(_ACKNOWLEDGE_S):
            raise NotReadyError(self.status().sentence, REMEDY)

    def check_height(self, drop_height_m: float) -> None:
        """Raise `DropHeightError` unless the rig allows a height. [m]"""
        self._admission.check_height(drop_height_m)

    def use_materials(self, materials: Materials) -> None:
        """Take these for the drops that are asked for from now on."""
        self._materials = materials
        self._loop.use_materials(materials)

    @property
    def materials(self) -> Materials:
        """The spheres and surfaces that a drop may name."""
        return self._materials

    # Answers

    def status(self) -> ServiceStatus:
        """Return the status and its reasons."""
        with self._loop.present:
            run, state = self._loop.run, self._loop.machine.state
            reservation, aftermath = self._admission.reservation, self._loop.aftermath
        calibration = self._admission.calibration()
        checks = (*self._loop.watch.findings.checks, *self._admission.quick_checks(calibration))
        owner = run.drop.owner if run else reservation.owner if reservation else None
        return status_of(
            Facts(
                state=state,
                owner=owner,
                drop=run.drop.number if run else None,
                doing=run.doing if run else "",
                fault=self._loop.fault,
                retry_s=self._settings.timeouts.recover_every_s,
                checks=checks,
                calibration=calibration,
                alarms=tuple(self._admission.alarms(calibration)),
                aftermath=aftermath,
            )
        )

    def wait(self, number: int, timeout_s: float) -> Drop:
        """Return a drop once it has ended, or as it is when the time is over."""
        ends_s = time.monotonic() + timeout_s
        with self._loop.changed:
            while True:
                drop = self._archive.drop(number)
                left_s = ends_s - time.monotonic()
                if drop.state in FINAL_STATES or left_s <= 0:
                    return drop
                self._loop.changed.wait(min(left_s, 0.5))

    def wait_for_end(self, number: int) -> Drop:
        """Return a drop once it has ended, or still under way when its own limits have passed."""
        times, around = self._settings.timeouts, self._settings.environment
        reading_s = 0.0 if around is None else around.command_limit_s
        limit_s = times.loading_s + times.blind_loading_s + times.settle_s + reading_s
        return self.wait(number, limit_s + _DROP_MARGIN_S)

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait until the rig is idle."""
        ends_s = time.monotonic() + timeout_s
        with self._loop.changed:
            while self._loop.machine.state is not State.IDLE:
                left_s = ends_s - time.monotonic()
                if left_s <= 0:
                    return False
                self._loop.changed.wait(min(left_s, 0.1))
        return True

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        """Publish an event soon, in order; one that cannot be published is logged and does no harm.

        ``kind`` is e.g. ``calibration.progress``, ``data`` is JSON-ready.
        """
        self._writer.put(lambda: self._tell_now(kind, data))

    def _tell_now(self, kind: str, data: dict[str, Any]) -> None:
        try:
            self._tell(kind, data)
        except ArchiveError as error:  # a full disk is no defect, and a log is not to fill it
            _log.warning("an event could not be told", kind=kind, why=error.what)
        except Exception:  # no listener may stop a drop
            _log.exception("an event could not be told", kind=kind)
