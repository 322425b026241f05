"""Anything in any order: nothing falls unless armed, and no drop is left without an end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.valve import ValveReport
from impactd.acquisition.errors import RequestRefusedError
from impactd.acquisition.transitions import State
from impactd.storage.archive import FINAL_STATES, IdempotencyConflictError

from ...impactd.acquisition.conftest import Laboratory, request

EVENTS_PER_RUN = 50
# Devices that break and heal, people who ask and abort, and time that passes.
EVENTS = (
    *("ask", "ask", "ask", "ask", "ask again", "ask another", "abort", "abort this"),
    *("acknowledge", "acknowledge", "look", "reserve", "give back", "give back", "give back"),
    *("wait", "wait", "wait long", "wait long", "wait long", "wait long"),
    *("unplug", "stall", "stick", "silence", "garbage", "empty hand", "overrun"),
    *("heal", "heal", "heal", "heal", "heal", "heal"),
)
FAULTS = {
    "unplug": ("usb_unplugged", True),
    "stall": ("stall_endpoint", True),
    "stick": ("relay_stuck", True),
    "silence": ("serial_silent", True),
    "garbage": ("serial_garbage", b"\x00\xff>zz\r\n"),
    "empty hand": ("no_sphere", True),
    "overrun": ("overrun_at_sample", 100_000),
}
events = st.lists(st.sampled_from(EVENTS), min_size=EVENTS_PER_RUN, max_size=EVENTS_PER_RUN)
figures = {"runs": 0, "fires": 0}


class Watched:
    """A laboratory whose every release is looked at as it happens."""

    def __init__(self, directory: Path) -> None:
        self.laboratory = Laboratory(
            directory,
            # As fast as the host reads: a drop takes some twenty milliseconds.
            simulation={"clock_speed": float("inf")},
            valve={"timeout_s": 0.1},
            timeouts={
                "loading_s": 0.3,
                "recover_every_s": 0.02,
                "idle_check_every_s": 0.02,
                "settle_s": 0.1,
            },
        )
        self.wrong: list[str] = []
        self.keys = 0
        self.reservation = None
        self._release = self.laboratory.rig.valve.release
        self.laboratory.rig.valve.release = self._watched  # type: ignore[method-assign]
        self.laboratory.start()

    def _watched(self, permitted: Callable[[], bool]) -> ValveReport:
        figures["fires"] += 1
        loop = self.laboratory.service._loop
        run = loop.run
        if loop.machine.state is not State.ARMED and not (run and run.aborting.is_set()):
            self.wrong.append(f"fired in {loop.machine.state}")
        row = self.laboratory.archive.drop(run.drop.number).state if run else "no drop"
        if row != "armed":
            self.wrong.append(f"fired with a row that says {row}")
        return self._release(permitted)

    def happen(self, event: str) -> None:
        """Let one thing happen."""
        service, faults = self.laboratory.service, self.laboratory.world.faults
        with contextlib.suppress(RequestRefusedError, IdempotencyConflictError):
            if event == "ask":
                self.keys += 1
                service.request_drop(request(), owner="ab", idempotency_key=f"k{self.keys}")
            elif event == "ask again" and self.keys:
                service.request_drop(request(), owner="ab", idempotency_key=f"k{self.keys}")
            elif event == "ask another":
                service.request_drop(request(operator="cd"), owner="cd", idempotency_key="k1")
            elif event == "abort":
                service.abort(by="cd")
            elif event == "abort this" and self.laboratory.archive.drops(limit=1):
                service.abort(by="ab", number=self.laboratory.archive.drops(limit=1)[0].number)
            elif event == "acknowledge":
                service._loop.acknowledge()
            elif event == "look":
                service._loop.look_again()
            elif event == "reserve" and self.reservation is None:
                self.reservation = service.reserve("series of cd")
            elif event == "give back" and self.reservation is not None:
                service.give_back(self.reservation)
                self.reservation = None
            elif event == "heal":
                faults.clear()
            elif event in FAULTS:
                setattr(faults, *FAULTS[event])
        time.sleep({"wait": 0.005, "wait long": 0.12}.get(event, 0.0))

    def settle(self) -> None:
        """Heal everything; the rig must become ready and every row must have ended."""
        laboratory = self.laboratory
        laboratory.world.faults.clear()
        if self.reservation is not None:
            laboratory.service.give_back(self.reservation)
            self.reservation = None

        def well() -> bool:
            laboratory.service._loop.acknowledge()
            time.sleep(0.01)
            return laboratory.service.wait_ready(0.2) and laboratory.service._loop.run is None

        laboratory.wait_for(well, 60.0)
        assert not self.wrong
        drops = laboratory.archive.drops(limit=1000)
        for drop in drops:
            assert drop.state in FINAL_STATES, drop
            assert drop.state in ("stored", "analysed") or drop.problem, drop
        assert laboratory.world._vacuum_on


def _runs(directory: Path, runs: int) -> None:
    watched = Watched(directory)
    figures.update(runs=0, fires=0)

    @settings(
        max_examples=runs,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(what=events)
    def run(what: list[str]) -> None:
        for event in what:
            watched.happen(event)
        watched.settle()
        figures["runs"] += 1

    try:
        run()
        archive = watched.laboratory.archive
        numbers = archive.drops(limit=1)
        total = numbers[0].number if numbers else 0
        print(
            f"{figures['runs']} runs x {EVENTS_PER_RUN} events: {total} drops, "
            f"{figures['fires']} releases, {len(archive.shots(limit=1000))} shots; "
            "each release armed and behind its row, every row ended"
        )
        assert 0 < figures["fires"] <= total  # at most one release a row
    finally:
        watched.laboratory.close()


@pytest.mark.parametrize(
    "runs",
    [
        20,
        pytest.param(100, marks=pytest.mark.slow),
        pytest.param(1000, marks=[pytest.mark.slow, pytest.mark.soak]),
    ],
)
@pytest.mark.timeout(0)
def test_random_events_fire_only_when_armed_and_end_every_row(tmp_path: Path, runs: int) -> None:
    """Runs of fifty events on a rig that breaks and heals."""
    _runs(tmp_path / "data", runs)
