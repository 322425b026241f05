"""A calibration run: a series of drops of reference spheres, then one joint fit.

::

    request ──> row per slot (never twice) ──> own thread: reserve the rig
        for each planned drop: request_drop ──> wait for "held", impact, "stored"
        give the rig back ──> job "calibrate" ──> the job runner writes result and due date

The service waits for each sphere; this module only knows the order. An abort of any drop, or of the
rig, ends the whole run: whoever aborts wants the rig still.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import structlog

from analysis.written_numbers import counted
from impactd.acquisition.errors import (
    CalibrationRefusedError,
    NotReadyError,
    RequestAbortedError,
    RequestRefusedError,
)
from impactd.acquisition.failures import failure_of
from impactd.acquisition.reservation import Reservation
from impactd.acquisition.service import AcquisitionService
from impactd.jobs.orders import request_calibration_fit
from impactd.settings.materials import Materials, UnknownMaterialError
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError, Calibration, DropRequest
from impactd.storage.problem import Problem
from impactd.storage.request_key import RequestKey

_log = structlog.get_logger("impactd.calibration")
# A sphere can miss or bounce off a tweezer; one more try per planned drop is allowed.
_TRIES = 2
_MOST_DROPS = 500


class _EndedEarlyError(Exception):
    """The run cannot go on."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        super().__init__(problem.detail)


@dataclass(frozen=True)
class PlannedDrop:
    """One drop of a series, of references in the materials file."""

    sphere: str
    surface: str
    drop_height_m: float


class CalibrationRunner:
    """Runs calibrations, one at a time."""

    def __init__(self, service: AcquisitionService, archive: Archive, settings: Settings) -> None:
        self._service = service
        self._archive = archive
        self._settings = settings
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._told: dict[str, Any] | None = None

    def request(
        self,
        plan: Sequence[Mapping[str, Any]] | None = None,
        *,
        slot: str | None,
        owner: str,
        unattended: bool = False,
        accepted: int | None = None,
    ) -> Calibration:
        """Begin a run; return as soon as its row is durable.

        Parameters
        ----------
        plan : sequence of mapping, optional
            ``sphere``, ``surface``, ``drop_height_m``, ``repeats``; the settings' when left out.
        slot : str or None
            The same slot gives the same run, whatever became of it.
        unattended : bool
            Nobody stands by the rig.
        accepted : int, optional
            Abort epoch at which the request was received; now without it.

        Raises
        ------
        CalibrationRefusedError
            If the rig is not declared safe for unattended runs, cannot see its spheres, or the
            plan is empty or names materials that are no references.
        UnknownMaterialError, DropHeightError, IdempotencyConflictError, BusyError, NotReadyError,
        RequestAbortedError
            As for a drop.
        """
        wanted = self._plan(plan)
        epoch = self._service.epoch.now() if accepted is None else accepted
        with self._lock:
            known = None if slot is None else self._archive.calibrations.by_slot(slot)
            if known is not None:
                # The table compares the plan; a slot with another plan is a conflict.
                return self._archive.calibrations.begin(slot, wanted, owner)[0]
            drops = self._check(wanted, unattended=unattended)
            reservation = self._service.reserve(f"calibration of {owner}", _NO_NUMBER_YET, epoch)
            try:
                run, created = self._archive.calibrations.begin(slot, wanted, owner)
                reservation.calibration = run.number
                reservation.owner = f"calibration {run.number} of {owner}"
            except BaseException:
                self._service.give_back(reservation)
                raise
            assert created, "the slot was looked up under the same lock"
            self._thread = threading.Thread(
                target=self._run, args=(run, drops, reservation), name="calibration", daemon=True
            )
            self._thread.start()
        return run

    def interrupt_unfinished(self) -> list[Calibration]:
        """Fail the runs that a dead daemon left under way; they are never continued."""
        ended = []
        for run in self._archive.calibrations.list(limit=20):
            if run.state in ("requested", "running"):
                problem = Problem(
                    "interrupted",
                    "Calibration interrupted",
                    500,
                    f"The daemon ended after {counted(len(run.drops), 'drop')} of calibration "
                    f"{run.number}.",
                    "Request a new calibration; its slot stays used.",
                )
                ended.append(self._archive.calibrations.fail(run.number, problem))
        return ended

    def stop(self) -> None:
        """Let no further drop begin and wait for the end; the service aborts the one under way."""
        self._ending.set()
        thread = self._thread
        if thread is not None:
            thread.join(timeout=30.0)

    def running(self) -> bool:
        """Return whether a run is under way."""
        thread = self._thread
        return thread is not None and thread.is_alive()

    def progress(self) -> dict[str, Any] | None:
        """Return the last ``calibration.progress`` of the run under way."""
        told = self._told
        return dict(told) if told is not None and self.running() else None

    # Admission

    def _plan(self, plan: Sequence[Mapping[str, Any]] | None) -> list[dict[str, Any]]:
        if plan is None:
            return [drops.model_dump(mode="json") for drops in self._settings.calibration.plan]
        return [{"repeats": 1, **drops} for drops in plan]

    def _check(self, plan: list[dict[str, Any]], *, unattended: bool) -> list[PlannedDrop]:
        if unattended and not self._settings.rig.unattended_safe:
            raise CalibrationRefusedError(
                "The rig is not declared safe for unattended runs.",
                "Run `impactd calibrate` while you stand at the rig. Or set rig.unattended_safe "
                "= true, after a responsible person has agreed.",
            )
        if unattended and self._settings.valve.adc_channel is None:
            raise CalibrationRefusedError(
                "An unattended run cannot see whether a sphere is held: the valve has no gauge.",
                "Stay at the rig, or connect a vacuum gauge and set valve.adc_channel.",
            )
        drops = [
            PlannedDrop(item["sphere"], item["surface"], float(item["drop_height_m"]))
            for item in plan
            for _ in range(int(item["repeats"]))
        ]
        if not 0 < len(drops) <= _MOST_DROPS:
            raise CalibrationRefusedError(
                f"The plan has {counted(len(drops), 'drop')}; a run has 1 to {_MOST_DROPS}.",
                "Fill in [[calibration.plan]] in the settings, or send a plan.",
            )
        self._check_materials(drops, self._service.materials)
        return drops

    def _check_materials(self, drops: list[PlannedDrop], materials: Materials) -> None:
        for drop in drops:
            materials.check(drop.sphere, drop.surface)
            self._service.check_height(drop.drop_height_m)
            for role, name in (("sphere", drop.sphere), ("surface", drop.surface)):
                reason = materials.why_no_reference(role, name)
                if reason:
                    raise CalibrationRefusedError(
                        f"The plan cannot calibrate: {reason}.", "Name reference materials."
                    )

    # The run

    def _run(self, run: Calibration, drops: list[PlannedDrop], reservation: Reservation) -> None:
        began_s = time.monotonic()
        try:
            self._told = None
            self._archive.calibrations.set_state(run.number, "running")
            self._tell("calibration.started", run, {"drops": len(drops)})
            for index, planned in enumerate(drops):
                self._progress(run, index, len(drops), began_s, planned)
                self._drop(run, planned, index, reservation)
            self._service.give_back(reservation)
            with self._archive.transaction():
                self._archive.calibrations.set_state(run.number, "fitting")
                request_calibration_fit(self._archive, run.number)
            self._told = None
            self._tell("calibration.fitting", run, {"drops": len(drops)})
        except Exception as error:  # the run ends with a reason, whatever it was
            self._fail(run, error)
        finally:
            self._service.give_back(reservation)

    def _drop(
        self, run: Calibration, planned: PlannedDrop, index: int, reservation: Reservation
    ) -> None:
        """Make one planned drop, with a second try."""
        request = DropRequest(planned.sphere, planned.surface, planned.drop_height_m, run.owner)
        for attempt in range(_TRIES):
            self._look_for_end(run, reservation)
            drop = self._service.request_drop(
                request,
                owner=reservation.owner,
                # So that not even a defect here could fire a planned drop twice.
                idempotency_key=RequestKey("calibration", f"{run.number}-{index}-{attempt}").text,
                calibration=run.number,
                # Of the series: an abort between two drops voids all that are left.
                accepted=reservation.accepted,
            )
            drop = self._service.wait_for_end(drop.number)
            self._look_for_end(run, reservation)
            if drop.state in ("stored", "analysed"):
                return
            if drop.state == "aborted":
                raise _EndedEarlyError(_aborted(run, drop.problem))
            self._service.wait_ready(self._settings.timeouts.recover_every_s + 5.0)
        detail = drop.problem.detail if drop.problem else f"drop {drop.number} is {drop.state}"
        raise _EndedEarlyError(
            Problem(
                "calibration-drop-failed",
                "A drop of the series failed",
                500,
                f"{planned.sphere} on {planned.surface} from {planned.drop_height_m * 1e3:.1f} mm "
                f"failed {_TRIES} times: {detail}",
                drop.problem.remedy if drop.problem else "",
            )
        )

    def _look_for_end(self, run: Calibration, reservation: Reservation) -> None:
        if reservation.aborted.is_set():
            by = reservation.aborted_by
            raise _EndedEarlyError(
                _aborted(run, Problem("aborted", "", 409, f"the series was aborted by {by}.", ""))
            )
        if self._ending.is_set():
            raise _EndedEarlyError(
                Problem("shutdown", "The daemon ended", 503, "The daemon ended.", "Start it again.")
            )

    def _progress(
        self, run: Calibration, done: int, of: int, began_s: float, planned: PlannedDrop
    ) -> None:
        # An estimate from the drops so far; before the first one nobody knows the technician.
        each_s = (time.monotonic() - began_s) / done if done else None
        told: dict[str, Any] = {
            "done": done,
            "of": of,
            "remaining_s": None if each_s is None else each_s * (of - done),
            "next": {
                "sphere": planned.sphere,
                "surface": planned.surface,
                "drop_height_m": planned.drop_height_m,
            },
        }
        self._told = {"number": run.number, **told}
        self._tell("calibration.progress", run, told)

    def _fail(self, run: Calibration, error: Exception) -> None:
        if isinstance(error, _EndedEarlyError):
            problem = error.problem
        elif isinstance(error, RequestAbortedError):
            problem = _aborted(run, Problem("aborted", "", 409, str(error), ""))
        elif isinstance(error, NotReadyError):
            problem = Problem(
                "not-ready", "The rig was not ready", 409, error.sentence, error.remedy
            )
        elif isinstance(error, (RequestRefusedError, UnknownMaterialError)):
            problem = Problem("refused", "A drop was refused", 409, str(error), "")
        else:
            problem = failure_of(error).problem
            if problem.type == "internal":
                _log.error("a calibration failed unexpectedly", number=run.number, exc_info=error)
        try:
            self._archive.calibrations.fail(run.number, problem)
        except ArchiveError:
            _log.exception("a calibration's end could not be written", number=run.number)
        self._tell("calibration.failed", run, {"type": problem.type, "reason": problem.detail})

    def _tell(self, kind: str, run: Calibration, data: dict[str, Any]) -> None:
        self._service.publish(kind, {"number": run.number, "slot": run.slot, **data})


# Calibrations start at 1: no drop of anybody else is let through before the run has its number.
_NO_NUMBER_YET = 0


def _aborted(run: Calibration, problem: Problem | None) -> Problem:
    return Problem(
        "aborted",
        "Calibration aborted",
        409,
        f"Calibration {run.number} was aborted: {problem.detail if problem else 'no reason given'}",
        "Request a new calibration when the rig is free.",
    )
