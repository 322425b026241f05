"""The end of a drop: its state, its problem, and whether the rig may continue."""

from __future__ import annotations

import threading
from typing import Any

import structlog

from impactd.acquisition.drop_run import DropRun
from impactd.acquisition.errors import RequestAbortedError
from impactd.acquisition.failures import Doubt, Failure, failure_of
from impactd.storage.archive import Archive, ArchiveError, Drop, DropStateError
from impactd.storage.problem import Problem

_log = structlog.get_logger("impactd.acquisition")


def ending_of(run: DropRun, failure: Failure) -> tuple[str, Problem]:
    """Return the final state of a drop, ``failed`` or ``aborted``, and why."""
    if not run.aborting.is_set():
        return "failed", failure.problem
    step = run.doing.partition(":")[0]  # without what somebody was asked to hang
    detail = f"Drop {run.drop.number} was aborted by {run.aborted_by} at this step: {step}."
    if failure.problem.type != "aborted":
        detail += f" Besides: {failure.problem.detail}"
    remedy = "The sphere was not released; request a new drop."
    if run.seen.may_have_fallen:
        remedy = (
            "Look at the coupon first, because the sphere may have fallen; then request a new drop."
        )
    return "aborted", Problem("aborted", "Drop aborted", 409, detail, remedy)


def aftermath_of(run: DropRun) -> str:
    """Return what to check after a drop without a shot, before the next sphere is hung."""
    if not run.seen.may_have_fallen:
        return ""
    return f"drop {run.drop.number} ended after its release: look at the coupon first"


def voided_problem(error: RequestAbortedError) -> Problem:
    """Return why a drop was never begun: somebody aborted while it was being admitted."""
    return Problem(
        "aborted", "Drop aborted", 409, str(error), ("Look at the rig, then repeat the request.")
    )


def not_ready_problem(fault: Failure | None) -> Problem:
    """Return why a drop was never begun: the rig went into doubt while it was being admitted."""
    detail = fault.problem.detail if fault else "The rig was lost when the drop was requested."
    remedy = fault.problem.remedy if fault else "See `impactd status`, then repeat the request."
    return Problem("not-ready", "The rig is not ready", 409, detail, remedy)


def worst_of(*found: Failure | None) -> Failure | None:
    """Return the failure that puts the rig in doubt, ``None`` when the next drop may come.

    A failure that needs a person comes first; else the order of the arguments counts.
    """
    doubtful = [f for f in found if f is not None and f.doubt is not Doubt.NONE]
    calling = [f for f in doubtful if f.doubt is Doubt.PERSON]
    return next(iter(calling or doubtful), None)


def keep_evidence(archive: Archive, run: DropRun, failure: Failure, reason: str) -> str | None:
    """Keep the record of a failed drop in ``partial/``, and return the name of its file.

    ``None`` where the failure carries no record, or it cannot be kept. ``reason`` says why it is no
    shot.
    """
    if failure.record is None:
        return None
    try:
        return archive.keep_partial(run.drop.number, failure.record, run.metadata(), reason).name
    except Exception:  # evidence is a courtesy: it must not keep a failed drop from ending
        _log.exception("the partial record could not be kept", drop=run.drop.number)
        return None


class Rows:
    """Closes drops' rows, and remembers those that the archive could not take."""

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._unwritten: list[tuple[int, str, Problem]] = []
        # The loop and a request that came too late both end drops here.
        self._lock = threading.Lock()

    def close(self, number: int, state: str, problem: Problem) -> Failure | None:
        """Write how a drop ended: ``failed`` or ``aborted``.

        Return why it could not be written, else ``None``; after a failure no drop should follow.
        """
        with self._lock:
            self._unwritten.append((number, state, problem))
        try:
            self.write_all()
        except ArchiveError as error:
            _log.error("a drop's end could not be written", drop=number, why=error.what)
            return Failure(failure_of(error).problem, Doubt.RETRY)
        return None

    def write_all(self) -> None:
        """Write what could not be written before; raise ArchiveError if that is still so."""
        with self._lock:
            while self._unwritten:
                number, state, problem = self._unwritten[0]
                try:
                    self._archive.set_drop_state(number, state, problem)
                except DropStateError:
                    # It has ended already, e.g. stored in the moment that something else failed.
                    _log.warning("a drop had ended before", drop=number, wanted=state)
                self._unwritten.pop(0)


def about_drop(drop: Drop) -> dict[str, Any]:
    """Return what events say about a drop, JSON-ready."""
    return {
        "number": drop.number,
        "state": drop.state,
        "shot": drop.shot,
        "owner": drop.owner,
        "sphere": drop.request.sphere,
        "surface": drop.request.surface,
        "drop_height_m": drop.request.drop_height_m,
        "calibration": drop.calibration,
    }
