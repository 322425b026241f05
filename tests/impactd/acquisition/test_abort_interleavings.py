"""An abort at every place where a drop or a series can be: nothing falls after its answer.

A run calls the archive, the valve and the digitizer a few dozen times. The same run is repeated and
an abort is answered before the first of these calls, then before the second, and so on to the last.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from impactd.acquisition.devices import hold
from impactd.acquisition.errors import RequestRefusedError
from impactd.calibration.run import CalibrationRunner
from impactd.storage.archive import FINAL_STATES

from .conftest import REQUEST, Laboratory

SEAMS = {
    "archive": ("drop_by_key", "begin_drop", "set_drop_state", "free_bytes", "store_shot"),
    "valve": ("vacuum", "release", "hold"),
    "port": ("write",),
    "digitizer": ("sample_baseline", "arm", "wait_trigger", "wait_record"),
    "calibrations": ("begin", "set_state", "fail", "current"),
    "jobs": ("enqueue",),
}
PLAN = [{"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "repeats": 2}]
NOWHERE = -1
"""The seam of a run that nobody aborts."""
ANSWER_S = 0.6
"""How long a seam waits for the abort: one that holds the relay's line makes it wait 0.3 s."""


class Seams:
    """Calls an abort from another thread as one of the wrapped calls is made."""

    def __init__(self, laboratory: Laboratory) -> None:
        self._laboratory = laboratory
        self._lock = threading.Lock()
        self.calls: list[str] = []
        self.target = -1
        self.pause_s = 0.0
        self.answered_ns = 0
        self.sentence = ""
        self._answered = threading.Event()
        self._answered.set()  # nobody has aborted yet

    def at(self, name: str) -> None:
        """Note a call; abort when it is the one that was chosen."""
        with self._lock:
            self.calls.append(name)
            here = len(self.calls) - 1 == self.target
            if here:
                self._answered.clear()
        if here:
            threading.Thread(target=self._abort, daemon=True).start()
            self._answered.wait(ANSWER_S)
        if self.pause_s and name.startswith("archive"):
            time.sleep(self.pause_s)

    def _abort(self) -> None:
        try:
            report = self._laboratory.service.abort(by="cd")
            self.sentence = report.sentence
            self.answered_ns = time.monotonic_ns()
        finally:
            self._answered.set()

    def wait(self) -> None:
        """Wait for the abort's answer, if one was asked for."""
        self._answered.wait()

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Wrap the calls of this laboratory."""
        one = self._laboratory
        owners = {
            "archive": one.archive,
            "valve": one.rig.valve,
            "port": one.rig.valve._port,  # type: ignore[attr-defined]
            "digitizer": one.rig.digitizer,
            "calibrations": one.archive.calibrations,
            "jobs": one.archive.jobs,
        }
        with ExitStack() as stack:
            for kind, names in SEAMS.items():
                for name in names:
                    owner, whole = owners[kind], f"{kind}.{name}"
                    inner = getattr(owner, name)
                    setattr(owner, name, self._wrapped(whole, inner))
                    stack.callback(setattr, owner, name, inner)
            yield

    def _wrapped(self, name: str, inner: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **keywords: Any) -> Any:
            self.at(name)
            return inner(*arguments, **keywords)

        return call


class Bench:
    """A laboratory that runs one thing again and again."""

    def __init__(self, directory: Path) -> None:
        self.laboratory = Laboratory(
            directory,
            simulation={"clock_speed": float("inf")},
            timeouts={"recover_every_s": 0.02, "idle_check_every_s": 60.0},
        ).start()
        self.runs = 0
        self.asked_ns = 0

    def drop(self) -> None:
        """Ask for a drop and wait for its end."""
        one = self.laboratory
        with suppress(RequestRefusedError):
            self.asked_ns = time.monotonic_ns()
            drop = one.service.request_drop(REQUEST, owner="ab", idempotency_key=f"k{self.runs}")
            one.service.wait(drop.number, 20.0)

    def locked_drop(self) -> None:
        """Ask for a drop while another program holds the index for a while."""
        path = self.laboratory.archive.directory / "index.sqlite"
        other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        other.execute("BEGIN IMMEDIATE")
        timer = threading.Timer(0.15, lambda: (other.execute("ROLLBACK"), other.close()))
        timer.start()
        try:
            self.drop()
        finally:
            timer.join()

    def series(self) -> None:
        """Run a calibration of two drops and wait for its end."""
        one = self.laboratory
        runner = CalibrationRunner(one.service, one.archive, one.settings)
        with suppress(RequestRefusedError):
            self.asked_ns = time.monotonic_ns()
            run = runner.request(PLAN, slot=f"s{self.runs}", owner="ab")
            table = one.archive.calibrations
            one.wait_for(lambda: table.get(run.number).state in ("fitting", "failed"))
        runner.stop()

    def aborted_at(self, what: Callable[[], None], target: int, pause_s: float) -> Seams:
        """Do something with an abort at a seam; return what was seen."""
        one = self.laboratory
        seams = Seams(one)
        seams.target, seams.pause_s = target, pause_s
        self.runs += 1
        with seams.installed():
            what()
            one.wait_for(lambda: one.service._loop.run is None)
        seams.wait()  # on a busy machine longer than the seam did
        one.wait_for(lambda: not one.service._loop.run and one.service.wait_ready(1.0))
        return seams

    def check(self, seams: Seams, kind: str) -> None:
        """Look into the rig's own log: no opening behind the answer, and nothing left open."""
        one = self.laboratory
        late = [ns for ns in one.world.openings_ns if self.asked_ns < seams.answered_ns < ns]
        # A thread that stands still with the line in its hands makes the answer say so.
        assert not late or "NOT MADE SAFE" in seams.sentence, (
            f"{kind}: the valve opened {(late[0] - seams.answered_ns) * 1e-6:.1f} ms after the "
            f"answer to an abort at {seams.calls[seams.target]}: {seams.sentence}"
        )
        assert one.world._vacuum_on
        for drop in one.archive.drops(limit=3):
            assert drop.state in FINAL_STATES, drop


def _at_every_seam(bench: Bench, kind: str, pause_s: float, step: int = 1) -> int:
    what = getattr(bench, kind)
    seams = len(bench.aborted_at(what, NOWHERE, pause_s).calls)
    for target in range(0, seams, step):
        seen = bench.aborted_at(what, target, pause_s)
        if seen.answered_ns < bench.asked_ns:
            # nobody asked it: refused, as a device was still lost from the run before; or answered
            # before the drop was asked for, at a call by which the rig became ready
            seen = bench.aborted_at(what, target, pause_s)
        bench.check(seen, kind)
    return seams


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A bench that is ready."""
    made = Bench(tmp_path / "data")
    yield made
    made.laboratory.close()


@pytest.mark.parametrize(("kind", "step"), [("drop", 4), ("locked_drop", 8), ("series", 24)])
def test_nothing_falls_after_an_abort_at_any_seam(bench: Bench, kind: str, step: int) -> None:
    """The valve's own log has no opening behind the answer, and the next drop works."""
    seams = _at_every_seam(bench, kind, 0.0, step)
    assert seams > 10
    after = bench.laboratory.drop()
    assert after.state == "stored", after.problem


def test_an_abort_that_finds_the_line_held_does_not_abort_the_next_drop(bench: Bench) -> None:
    """The idle check holds the line for longer than an abort waits, then makes the valve safe."""
    one = bench.laboratory
    seams, port = Seams(one), one.rig.valve._port  # type: ignore[attr-defined]
    seams.target, write = 0, port.write
    port.write = seams._wrapped("port.write", write)
    one.service._loop.look_again()
    one.wait_for(lambda: seams.sentence)
    port.write = write
    assert "NOT MADE SAFE" in seams.sentence
    assert (after := one.drop()).state == "stored", after.problem


def test_a_hold_that_an_abort_cuts_short_waits_for_it(bench: Bench) -> None:
    """An abort that wants the line would cut the second command, too: that is no fault."""
    rig = bench.laboratory.rig
    valve: Any = rig.valve
    with ThreadPoolExecutor(1) as pool:
        with valve._making_safe:
            valve._hurry.set()
            held = pool.submit(hold, rig)
            time.sleep(0.2)
            valve._hurry.clear()
        assert held.result(20.0).confirmed


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("kind", ["drop", "locked_drop", "series"])
@pytest.mark.parametrize("pause_s", [0.0, 0.02], ids=["quick disk", "slow disk"])
@pytest.mark.parametrize("fault", ["sound", "digitizer lost", "valve silent"])
def test_nothing_falls_after_an_abort_at_every_seam(
    bench: Bench, kind: str, pause_s: float, fault: str
) -> None:
    """The same at every seam, with a slow disk and with a device that is lost as it aborts."""
    service, faults = bench.laboratory.service, bench.laboratory.world.faults
    abort = service.abort

    def abort_and_lose(**keywords: Any) -> Any:
        faults.usb_unplugged = fault == "digitizer lost"
        faults.serial_silent = fault == "valve silent"
        report = abort(**keywords)
        faults.clear()
        return report

    service.abort = abort_and_lose  # type: ignore[method-assign]
    seams = _at_every_seam(bench, kind, pause_s)
    service.abort = abort  # type: ignore[method-assign]
    print(f"{kind}, {fault}, pause {pause_s} s: {seams} seams, 0 openings after an answer")
    assert seams > 10
