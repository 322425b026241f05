"""The thread that drives the devices: connect, watch while idle, run drops, clean up, recover.

Every failure of a drop and every abort ends in `RigLoop._clean_up`: vacuum on, digitizer stopped,
evidence kept, the drop's row closed with its reason, and then IDLE, or FAULT when the rig itself
is in doubt.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import structlog

from drivers.errors import AbortedError, DeviceTimeoutError, DriverError
from impactd.acquisition.abort_epoch import AbortEpoch
from impactd.acquisition.devices import confirm_safe, connect, make_safe
from impactd.acquisition.drop_run import DropRun
from impactd.acquisition.endings import (
    Rows,
    about_drop,
    aftermath_of,
    ending_of,
    keep_evidence,
    not_ready_problem,
    voided_problem,
    worst_of,
)
from impactd.acquisition.events import Event
from impactd.acquisition.failures import Doubt, Failure, RescuedError, failure_of
from impactd.acquisition.idle_watch import IdleWatch
from impactd.acquisition.progress_writer import ProgressWriter
from impactd.acquisition.transitions import Machine, State
from impactd.acquisition.valve_guard import ValveGuard
from impactd.rig.rig import Rig
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError, Drop, DropStateError, Shot
from impactd.storage.problem import Problem

_log = structlog.get_logger("impactd.acquisition")
_LOOP_S = 0.1
_SILENCES = 2
_SPHERE_AWAY = frozenset({State.RELEASED, State.CAPTURING, State.STORING})

Publish = Callable[[str, dict[str, Any]], None]


class RigLoop:
    """The service's thread and what it owns.

    Parameters
    ----------
    publish : callable
        Never raises and never waits.
    epoch : AbortEpoch
        What every movement is checked against.
    writer : ProgressWriter
        Writes what need not be waited for.

    Attributes
    ----------
    present : threading.Lock
        Guards which drop is the present one together with the machine's step into and out of it.
        Held for microseconds only, because an abort takes it.
    run : DropRun or None
        The present drop; read and written under `present`.
    fault : Failure or None
        Why the rig is in doubt.
    aftermath : str
        What to check after the last drop; empty once another one begins.
    beat_s : float
        When the loop was last seen alive, on the monotonic clock. [s]
    changed : threading.Condition
        Notified when a drop ended or the rig became idle.
    """

    def __init__(
        self,
        rig: Rig,
        archive: Archive,
        settings: Settings,
        materials: Materials,
        publish: Publish,
        *,
        epoch: AbortEpoch,
        writer: ProgressWriter,
    ) -> None:
        self.machine = Machine()
        self.present = threading.Lock()
        self.run: DropRun | None = None
        self.fault: Failure | None = None
        self.aftermath = ""
        self.watch = IdleWatch(rig, settings)
        self.beat_s = time.monotonic()
        self.changed = threading.Condition()
        self.ending = threading.Event()
        self._rig = rig
        self._archive = archive
        self._settings = settings
        self._materials = materials
        self._publish = publish
        self._epoch = epoch
        self._writer = writer
        self._guard = ValveGuard(rig.valve, epoch)
        self._queue: queue.SimpleQueue[DropRun] = queue.SimpleQueue()
        self._wake = threading.Event()
        self._acknowledged = threading.Event()
        self._rows = Rows(archive)
        self._silences = 0
        self._tried_s = -1e9
        self._thread: threading.Thread | None = None

    # For other threads

    def use_materials(self, materials: Materials) -> None:
        """Use these materials for drops that begin later; the one under way keeps its own."""
        self._materials = materials

    def start(self) -> None:
        """Open the devices in the loop's own thread."""
        self.ending.clear()
        self.machine.apply(Event.STARTED)
        self._thread = threading.Thread(target=self._loop, name="acquisition", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Wait for the loop's end; what runs must have been aborted after `ending` was set."""
        self.ending.set()
        self._wake.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(timeout=30.0)
        make_safe(self._rig)

    def is_running(self) -> bool:
        """Return whether the thread lives."""
        thread = self._thread
        return thread is not None and thread.is_alive()

    def begin(self, drop: Drop, accepted: int) -> bool:
        """Take a drop whose row is durable; return whether it begins.

        It does not when the rig has just gone into doubt, or something was aborted since the epoch
        ``accepted``: the row is closed with that reason and nothing moves.
        """
        run = DropRun(
            drop,
            accepted=accepted,
            guard=self._guard,
            rig=self._rig,
            archive=self._archive,
            settings=self._settings,
            materials=self._materials,
            machine=self.machine,
            moved=self._moved,
            tell=self._publish,
            beat=self._beat,
            ending=self.ending,
        )
        with self.present:
            void = not self._epoch.is_present(accepted)
            idle = self.machine.state is State.IDLE
            if idle and not void:
                self.machine.apply(Event.REQUESTED)
                self.run = run
        if void:
            self._refuse(drop, "aborted", voided_problem(self._epoch.refusal()))
            return False
        if not idle:
            self._refuse(drop, "failed", not_ready_problem(self.fault))
            return False
        self._queue.put(run)
        self._wake.set()
        return True

    def look_again(self) -> None:
        """Check the devices now, because a person may have repaired something."""
        self.watch.look_again()
        self._wake.set()

    def acknowledge(self) -> None:
        """Ask for the devices again although a person was called for."""
        self._acknowledged.set()
        self._wake.set()

    def tell_state(self) -> None:
        """Publish the state."""
        with self.present:
            run, state = self.run, self.machine.state
        self._publish(
            "rig.state",
            {
                "state": state.value,
                "drop": run.drop.number if run else None,
                "owner": run.drop.owner if run else None,
                "doing": run.doing if run else "",
            },
        )

    # The loop

    def _loop(self) -> None:
        while not self.ending.is_set():
            self._turn_safely()
            self._wake.wait(_LOOP_S)
            self._wake.clear()
        # A drop that was admitted in the last moment has been aborted by now: close its row.
        self._run_queued()
        with self.present:
            self.machine.apply(Event.SHUT_DOWN)
        self.tell_state()

    def _turn_safely(self) -> None:
        self._beat()
        try:
            self._turn()
        except Exception as error:  # a defect must not end the thread that closes the valve
            _log.exception("the acquisition loop failed unexpectedly")
            self._doubt(failure_of(error))

    def _turn(self) -> None:
        if self._run_queued():
            return
        state = self.machine.state
        if state is State.CONNECTING:
            self._connect()
        elif state is State.IDLE:
            if self.watch.is_due():
                self._look()
        elif state is State.FAULT and self._should_retry():
            self.machine.apply(Event.RETRIED)
            self.tell_state()
            self._connect()

    def _run_queued(self) -> bool:
        try:
            run = self._queue.get_nowait()
        except queue.Empty:
            return False
        self.aftermath = ""
        try:
            shot = run.run()
        except RescuedError as error:
            self._leave(run, error)
        except Exception as error:
            self._clean_up(run, error)
        else:
            self._stored(run, shot)
        run.finished.set()
        self._notify()
        self.look_again()
        return True

    def _should_retry(self) -> bool:
        if self._acknowledged.is_set():
            self._acknowledged.clear()
            return True
        if self.fault is not None and self.fault.doubt is Doubt.PERSON:
            return False
        pause_s = time.monotonic() - self._tried_s
        return pause_s >= self._settings.timeouts.recover_every_s

    def _connect(self) -> None:
        self._tried_s = time.monotonic()
        try:
            if not self._unless_aborted(self._connect_and_look):
                return  # that is no fault, and it is tried again
        except (DriverError, ArchiveError) as error:
            if self.ending.is_set():  # the shutdown stopped the devices: that is no fault
                return
            found = failure_of(error)
            doubt = Doubt.PERSON if found.doubt is Doubt.PERSON else Doubt.RETRY
            self.fault = Failure(found.problem, doubt)
            event = Event.FAILED
        else:
            self.fault = None
            event = Event.CONNECTED
        with self.present:
            self.machine.apply(event)
        if self.fault is not None:
            self._tell_fault(self.fault)
        self.tell_state()
        self._notify()

    def _connect_and_look(self) -> None:
        connect(self._rig)
        self._rows.write_all()
        self.watch.look_again()
        self.watch.look()

    # While idle

    def _look(self) -> None:
        try:
            if self._unless_aborted(self.watch.look):
                self._silences = 0
        except DriverError as error:
            # One answer that came too late is a busy host; two in a row are a silent device.
            self._silences += 1
            if isinstance(error, DeviceTimeoutError) and self._silences < _SILENCES:
                return
            found = failure_of(error)
            doubt = Doubt.RETRY if found.doubt is Doubt.NONE else found.doubt
            self._doubt(Failure(found.problem, doubt))

    def _unless_aborted(self, test: Callable[[], None]) -> bool:
        """Test the devices and return True; where somebody aborts, make the rig safe instead."""
        try:
            test()
        except AbortedError:
            # If this thread held the valve's line for longer than an abort waits, the vacuum is on
            # but unconfirmed, and the valve refuses all else until it is.
            self._rig.valve.ensure_safe()
            return False
        return True

    def _doubt(self, fault: Failure) -> None:
        """Go to FAULT; a drop that came in meanwhile is refused when its turn comes."""
        with self.present:
            state = self.machine.state
            if self.run is not None or state not in (State.IDLE, State.CONNECTING):
                return
            self.fault = fault
            self.machine.apply(Event.RIG_DOUBTED if state is State.IDLE else Event.FAILED)
        self._tell_fault(fault)

    # Ends of a drop

    def _refuse(self, drop: Drop, state: str, problem: Problem) -> None:
        """Close the row of a drop that may not begin any more."""
        self._rows.close(drop.number, state, problem)
        self._tell_end(drop.number, state, problem, None)
        self._notify()

    def _tell_end(self, number: int, state: str, problem: Problem, evidence: str | None) -> None:
        told = {
            "number": number,
            "type": problem.type,
            "detail": problem.detail,
            "remedy": problem.remedy,
            "evidence": evidence,
        }
        self._publish(f"drop.{state}", told)

    def _stored(self, run: DropRun, shot: Shot) -> None:
        number = run.drop.number
        stored_ns = time.monotonic_ns()
        fault = failure_of(run.hold_error) if run.hold_error is not None else None
        try:
            with self._archive.transaction():  # one sync for both: the next drop may wait
                for kind in ("compare_shot", "fit_shot"):
                    self._archive.jobs.enqueue(kind, {"shot": shot.number}, f"shot {shot.number}")
        except ArchiveError as error:
            # The shot is safe; `POST /fits` fits it later.
            _log.exception("the fit could not be queued", shot=shot.number)
            self._publish("job.lost", {"shot": shot.number, "detail": str(error)})
        with self.present:
            self.run = None
            self.fault = fault
            self.machine.apply(Event.STORED if fault is None else Event.RIG_DOUBTED)
        self._publish(
            "drop.stored",
            {**about_drop(self._archive.drop(number)), **run.seen.durations_s(stored_ns)},
        )
        if fault is not None:
            self._tell_fault(fault)
        self.tell_state()

    def _leave(self, run: DropRun, error: RescuedError) -> None:
        """Leave a drop's row open for the next start, which takes the record back."""
        number = run.drop.number
        with self.present:
            self.machine.apply(Event.FAILED)
        confirm_safe(self._rig)
        self._guard.is_closed()
        _log.warning("a record is kept outside the archive", drop=number, path=str(error.path))
        with self.present:
            self.run = None
            self.machine.apply(Event.MADE_SAFE)
        self._publish("drop.rescued", {"number": number, "path": str(error.path)})

    def _clean_up(self, run: DropRun, error: Exception) -> None:
        failure = failure_of(error)
        with self.present:
            self.machine.apply(Event.FAILED)
        unsafe = confirm_safe(self._rig)  # before anything is written or told
        self._guard.is_closed()
        self.tell_state()
        state, problem = ending_of(run, failure)
        if problem.type == "internal":
            _log.error("a drop failed unexpectedly", drop=run.drop.number, exc_info=error)
        number = run.drop.number
        kept = keep_evidence(self._archive, run, failure, problem.detail)
        stuck = self._rows.close(number, state, problem)
        fault = worst_of(failure, unsafe, stuck)
        with self.present:
            self.run = None
            self.aftermath = aftermath_of(run)
            self.fault = fault
            self.machine.apply(Event.MADE_SAFE if fault is None else Event.RIG_DOUBTED)
        self._tell_end(number, state, problem, kept)
        if fault is not None:
            self._tell_fault(fault)
        self.tell_state()

    # Small things

    def _moved(self, drop_state: str | None) -> None:
        """Write and publish each step of a drop."""
        self._beat()
        with self.present:
            run = self.run
        if drop_state is not None and run is not None:
            number = run.drop.number
            if self.machine.state in _SPHERE_AWAY:
                # The valve is open: nothing waits for the disk now.
                self._writer.put(lambda: self._write_step(number, drop_state))
            else:
                # A step that cannot be written stops a drop whose sphere still hangs.
                self._archive.set_drop_state(number, drop_state)
            self._publish(f"drop.{drop_state}", {"number": number})
        self.tell_state()

    def _write_step(self, number: int, drop_state: str) -> None:
        """Write a step of a drop, unless its end was written before: the end counts."""
        try:
            self._archive.set_drop_state(number, drop_state)
        except DropStateError:
            return
        except ArchiveError as error:
            _log.warning("a step could not be written", drop=number, why=error.what)

    def _tell_fault(self, fault: Failure) -> None:
        self._tried_s = time.monotonic()
        self._publish("rig.fault", {"detail": fault.problem.detail, "remedy": fault.problem.remedy})

    def _beat(self) -> None:
        self.beat_s = time.monotonic()

    def _notify(self) -> None:
        with self.changed:
            self.changed.notify_all()
