"""Calibration runs over the whole simulated rig, without the fit (the job runner's part)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from impactd.acquisition.errors import BusyError, CalibrationRefusedError, DropHeightError
from impactd.acquisition.preflight import calibration_state
from impactd.calibration.run import CalibrationRunner
from impactd.settings.materials import UnknownMaterialError
from impactd.settings.sections import CalibrationSection
from impactd.storage.archive import Calibration, DropRequest, IdempotencyConflictError

from ..acquisition.conftest import Laboratory

PLAN = [
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.02, "repeats": 2},
    {"sphere": "steel", "surface": "aluminium", "drop_height_m": 0.005, "repeats": 1},
]


class Bench:
    """A laboratory with a calibration runner."""

    def __init__(self, directory: Path, **changes: dict[str, Any]) -> None:
        self.laboratory = Laboratory(directory, **changes).start()
        self.runner = self.new_runner()

    def new_runner(self) -> CalibrationRunner:
        """Return a runner on this laboratory, as after a restart."""
        one = self.laboratory
        return CalibrationRunner(one.service, one.archive, one.settings)

    def wait(self, run: Calibration, *states: str) -> Calibration:
        """Wait until a run is in one of these states."""
        table = self.laboratory.archive.calibrations
        self.laboratory.wait_for(lambda: table.get(run.number).state in states)
        return table.get(run.number)

    def close(self) -> None:
        """End everything."""
        self.laboratory.service.stop()
        self.runner.stop()
        self.laboratory.close()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A bench that is ready."""
    made = Bench(tmp_path / "data")
    yield made
    made.close()


@pytest.fixture
def build_bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    """A maker of benches with changed settings."""
    made: list[Bench] = []

    def make(**changes: dict[str, Any]) -> Bench:
        made.append(Bench(tmp_path / "data", **changes))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_run_drops_its_plan_in_order_and_asks_for_the_fit(bench: Bench) -> None:
    """Each planned drop is made once, belongs to the run, and the joint fit is queued."""
    run = bench.runner.request(PLAN, slot="2026-W09", owner="timer", unattended=True)
    ended = bench.wait(run, "fitting", "failed")
    assert ended.state == "fitting", ended.problem
    archive = bench.laboratory.archive
    drops = [archive.drop(number) for number in ended.drops]
    assert [(drop.request.sphere, drop.state) for drop in drops] == [
        ("acetal", "stored"), ("acetal", "stored"), ("steel", "stored"),
    ]  # fmt: skip
    kinds = [archive.jobs.claim() for _ in range(4)]
    assert [(job.kind, job.payload) for job in kinds if job][-1] == (
        "calibrate", {"calibration": run.number},
    )  # fmt: skip
    steps = [data for kind, data in bench.laboratory.events if kind == "calibration.progress"]
    assert [step["done"] for step in steps] == [0, 1, 2]
    assert steps[0]["remaining_s"] is None
    assert steps[1]["remaining_s"] > 0
    bench.laboratory.wait_for(lambda: bench.laboratory.service.status().ready)


def test_the_same_slot_never_runs_twice(bench: Bench) -> None:
    """A timer that fires again gets the first run, also after a restart and after its end."""
    run = bench.runner.request(PLAN, slot="s", owner="timer")
    again = bench.runner.request(PLAN, slot="s", owner="timer")
    assert again.number == run.number
    bench.wait(run, "fitting")
    later = bench.new_runner().request(PLAN, slot="s", owner="timer")
    assert (later.number, len(later.drops)) == (run.number, 3)
    with pytest.raises(IdempotencyConflictError):
        bench.runner.request(PLAN[:1], slot="s", owner="timer")
    assert len(bench.laboratory.archive.drops()) == 3


def test_nobody_gets_between_two_drops_of_a_run(bench: Bench) -> None:
    """While a run holds the rig, drops and other runs are refused with its name."""
    run = bench.runner.request(PLAN, slot=None, owner="ab")
    with pytest.raises(BusyError, match=f"calibration {run.number} of ab"):
        bench.laboratory.service.request_drop(
            DropRequest("acetal", "aluminium", 0.02, "cd"), owner="cd"
        )
    with pytest.raises(BusyError):
        bench.runner.request(PLAN, slot=None, owner="cd")
    assert bench.wait(run, "fitting", "failed").state == "fitting"


def test_an_abort_ends_the_whole_run(bench: Bench) -> None:
    """Whoever aborts wants the rig still: no further drop begins."""
    bench.laboratory.world.faults.no_sphere = True
    run = bench.runner.request(PLAN, slot="s", owner="ab")
    bench.laboratory.wait_for(lambda: bool(bench.laboratory.archive.drops()))
    assert bench.laboratory.service.abort(by="cd").aborted
    ended = bench.wait(run, "failed")
    assert ended.problem is not None
    assert ended.problem.type == "aborted"
    assert "cd" in ended.problem.detail
    assert len(bench.laboratory.archive.drops()) == 1
    bench.laboratory.world.faults.no_sphere = False
    bench.laboratory.wait_for(lambda: bench.laboratory.service.status().ready)


def test_a_sphere_that_never_comes_fails_the_run_with_the_reason(
    build_bench: Callable[..., Bench],
) -> None:
    """One more try is made, then the run ends with what the drop said."""
    bench = build_bench(timeouts={"loading_s": 0.2})
    bench.laboratory.world.faults.no_sphere = True
    run = bench.runner.request(PLAN, slot="s", owner="ab")
    ended = bench.wait(run, "failed")
    assert ended.problem is not None
    assert "No sphere was held" in ended.problem.detail
    assert len(ended.drops) == 2


def test_unattended_runs_need_somebody_who_answered_for_them(
    build_bench: Callable[..., Bench],
) -> None:
    """Refused with the reason and the two ways out; attended, the same rig runs."""
    bench = build_bench(rig={"unattended_safe": False})
    with pytest.raises(CalibrationRefusedError, match="unattended") as raised:
        bench.runner.request(PLAN, slot="s", owner="timer", unattended=True)
    assert "unattended_safe = true" in raised.value.remedy
    assert bench.laboratory.archive.calibrations.list() == []
    run = bench.runner.request(PLAN[1:], slot="s", owner="ab", unattended=False)
    assert bench.wait(run, "fitting", "failed").state == "fitting"


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"sphere": "hdpe"}, CalibrationRefusedError),
        ({"surface": "specimen"}, CalibrationRefusedError),
        ({"sphere": "glass"}, UnknownMaterialError),
        ({"drop_height_m": 3.0}, DropHeightError),
        ({"repeats": 0}, CalibrationRefusedError),
    ],
)
def test_a_plan_that_cannot_calibrate_is_refused_before_anything_moves(
    bench: Bench, change: dict[str, Any], error: type[Exception]
) -> None:
    """Unknown or unmarked materials, impossible heights, and empty plans."""
    with pytest.raises(error):
        bench.runner.request([{**PLAN[0], **change}], slot="s", owner="ab")
    assert bench.laboratory.archive.drops() == []
    assert bench.laboratory.service.status().ready


def test_a_run_that_a_dead_daemon_left_is_failed_not_continued(bench: Bench) -> None:
    """The slot stays used; nobody drops spheres because a process came back."""
    run, _ = bench.laboratory.archive.calibrations.begin("s", PLAN, "timer")
    (ended,) = bench.new_runner().interrupt_unfinished()
    assert (ended.number, ended.state) == (run.number, "failed")
    assert bench.runner.request(PLAN, slot="s", owner="timer").state == "failed"
    assert bench.laboratory.archive.drops() == []


def test_the_due_date_goes_from_valid_to_overdue(bench: Bench) -> None:
    """Words and fields follow the date; drift beyond the limit raises an alarm."""
    table = bench.laboratory.archive.calibrations
    run, _ = table.begin("s", PLAN, "timer")
    ends = datetime.now(UTC) + timedelta(days=30)
    result = {"drift": {"largest_in_u": 4.2}}
    done = table.finish(run.number, result, ends.isoformat())
    section = CalibrationSection(validity_days=30, remind_days=3)
    words = {
        days: calibration_state(done, section, ends - timedelta(days=days)).word
        for days in (10, 2, -1)
    }
    assert words == {10: "valid", 2: "due", -1: "overdue"}
    overdue = calibration_state(done, section, ends + timedelta(days=2))
    assert overdue.days_left == pytest.approx(-2)
    assert not overdue.valid
    assert dataclasses.asdict(overdue)["drift_sigmas"] == 4.2
    assert any("drifted by 4.2" in alarm for alarm in bench.laboratory.service.status().alarms)
