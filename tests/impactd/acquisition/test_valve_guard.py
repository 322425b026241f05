"""The open valve: it waits for no disk, for no lock and for no thread that is stuck."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest

from drivers.errors import AbortedError
from impactd.acquisition.errors import RequestAbortedError

from .conftest import REQUEST, Laboratory


def test_a_locked_index_does_not_hold_the_valve_open(laboratory: Laboratory) -> None:
    """Another program locks the index as the sphere falls: the valve closes at the impact."""
    release = laboratory.rig.valve.release
    path = laboratory.archive.directory / "index.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as other:

        def lock_and_release(permitted: Callable[[], bool]) -> object:
            other.execute("BEGIN IMMEDIATE")
            return release(permitted)

        laboratory.rig.valve.release = lock_and_release  # type: ignore[method-assign, assignment]
        drop = laboratory.service.request_drop(REQUEST, owner="ab")
        laboratory.wait_for(lambda: len(laboratory.world.openings_ns) == 1)
        laboratory.wait_for(lambda: laboratory.world._vacuum_on)
        assert other.in_transaction
        assert laboratory.archive.drop(drop.number).state == "armed"
        other.execute("ROLLBACK")
    assert laboratory.service.wait(drop.number, 20.0).state == "stored"


def test_the_valve_closes_by_its_timer_where_the_drop_is_stuck(
    build: Callable[..., Laboratory],
) -> None:
    """A thread that hangs in the digitizer does not hold the vacuum off."""
    laboratory = build(timeouts={"impact_margin_s": 0.1}, valve={"timeout_s": 0.1}).start()
    hang = threading.Event()
    wait_trigger = laboratory.rig.digitizer.wait_trigger

    def stuck(*arguments: Any) -> object:
        hang.wait(60.0)
        return wait_trigger(*arguments)

    laboratory.rig.digitizer.wait_trigger = stuck  # type: ignore[method-assign, assignment]
    laboratory.service.request_drop(REQUEST, owner="ab")
    laboratory.wait_for(lambda: len(laboratory.world.openings_ns) == 1)
    laboratory.wait_for(lambda: laboratory.world._vacuum_on)
    assert not hang.is_set()
    hang.set()


def test_a_request_that_waited_through_an_abort_drops_nothing(laboratory: Laboratory) -> None:
    """The index is locked while a drop is asked for; the abort reaches it all the same."""
    path = laboratory.archive.directory / "index.sqlite"
    ended: list[object] = []

    def ask() -> None:
        try:
            ended.append(laboratory.service.request_drop(REQUEST, owner="ab").state)
        except RequestAbortedError as error:
            ended.append(str(error))

    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        thread = threading.Thread(target=ask)
        thread.start()
        laboratory.wait_for(lambda: laboratory.service._admission.entering == 1)
        time.sleep(0.2)  # until it waits for the lock
        report = laboratory.service.abort(by="cd")
        assert report.aborted
        assert "A request that was about to start is refused" in report.sentence
        other.execute("ROLLBACK")
    thread.join()
    assert ended == ["aborted"]
    drop = laboratory.archive.drop(1)
    assert drop.problem is not None
    assert "by cd" in drop.problem.detail
    assert laboratory.world.openings_ns == []
    assert laboratory.drop().state == "stored"


def test_a_request_of_an_older_epoch_is_refused_without_a_row(laboratory: Laboratory) -> None:
    """Received before an abort, looked at after it."""
    accepted = laboratory.service.epoch.now()
    laboratory.service.abort(by="cd")
    with pytest.raises(RequestAbortedError, match=r"accepted before the abort at .* by cd"):
        laboratory.service.request_drop(REQUEST, owner="ab", accepted=accepted)
    with pytest.raises(RequestAbortedError):
        laboratory.service.reserve("series of ab", accepted=accepted)
    assert laboratory.archive.drops() == []


def test_the_guard_opens_for_the_present_epoch_only(laboratory: Laboratory) -> None:
    """The comparison is made as the valve opens, whatever was checked before."""
    guard, epoch = laboratory.service._loop._guard, laboratory.service.epoch
    accepted = epoch.now()
    epoch.advance("cd")
    with pytest.raises(AbortedError):
        guard.open(accepted, 5.0)
    guard.is_closed()
    assert laboratory.world.openings_ns == []


def test_a_failure_of_any_kind_in_the_clean_up_ends_the_drop(laboratory: Laboratory) -> None:
    """An error that no driver raises leaves no rig that is busy until a restart."""
    laboratory.world.faults.no_sphere = True
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    stopped = laboratory.rig.digitizer.ensure_stopped

    def fails() -> None:
        raise ZeroDivisionError("not foreseen")

    laboratory.rig.digitizer.ensure_stopped = fails  # type: ignore[method-assign]
    report = laboratory.service.abort(by="cd")
    assert "NOT MADE SAFE" in report.sentence
    assert laboratory.service.wait(drop.number, 20.0).state == "aborted"
    laboratory.wait_for(lambda: laboratory.service._loop.run is None)
    laboratory.rig.digitizer.ensure_stopped = stopped  # type: ignore[method-assign]
    laboratory.world.faults.clear()
    laboratory.service.acknowledge_fault(by="cd")
    assert laboratory.drop().state == "stored"
