"""The service over the whole simulated rig: drops, admission, aborts, restarts."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest

from drivers.valve import ValveReport
from impactd.acquisition.errors import BusyError, DropHeightError, NotReadyError
from impactd.acquisition.transitions import State
from impactd.settings.materials import UnknownMaterialError
from impactd.storage.archive import Drop, DropRequest, IdempotencyConflictError

from .conftest import REQUEST, Laboratory, request

LIMIT_S = 2.0  # the promise is 0.1 s; a loaded test machine is given more, the figure is printed


def test_a_drop_becomes_a_stored_shot(laboratory: Laboratory) -> None:
    """A request ends as a shot with everything a reader must know, and a fit is queued."""
    drop = laboratory.drop()
    assert (drop.state, drop.shot, drop.problem) == ("stored", drop.number, None)
    stored = laboratory.archive.read_shot(drop.number)
    metadata, recording = stored.metadata, stored.recording
    assert metadata.sphere is not None
    assert metadata.sphere.name == "acetal"
    assert metadata.valve_confirmed is True
    assert metadata.vacuum_v == pytest.approx(3.2, abs=0.01)
    assert metadata.digitizer is not None
    assert "untested on a 3500" in metadata.digitizer.note
    assert metadata.valve_monotonic_ns is not None
    assert recording.trigger_monotonic_ns is not None
    assert recording.trigger_monotonic_ns > metadata.valve_monotonic_ns
    assert metadata.noise_rms_v == pytest.approx(1.5e-3, rel=0.2)
    assert recording.samples.size == 400_000
    assert recording.trigger_index == 20_000
    assert np.ptp(recording.signal) > 1.0
    assert metadata.configuration["simulated"] is True
    assert "simulation" not in metadata.configuration
    compared = laboratory.archive.jobs.claim(prompt=True)
    assert compared is not None
    assert (compared.kind, compared.payload) == ("compare_shot", {"shot": drop.number})
    job = laboratory.archive.jobs.claim()
    assert job is not None
    assert (job.kind, job.payload) == ("fit_shot", {"shot": drop.number})
    timing = next(data for kind, data in laboratory.events if kind == "drop.stored")
    print(f"impact to stored {timing['impact_to_stored_s']:.3f} s")


def test_the_row_is_there_before_the_valve_opens(laboratory: Laboratory) -> None:
    """When the valve opens, the index already says that this drop is armed."""
    seen: list[str] = []
    release = laboratory.rig.valve.release

    def spy(*permitted: Callable[[], bool]) -> object:
        seen.append(laboratory.archive.drop(1).state)
        return release(*permitted)

    laboratory.rig.valve.release = spy  # type: ignore[method-assign, assignment]
    assert laboratory.drop().state == "stored"
    assert seen == ["armed"]


def test_a_clock_that_is_read_late_makes_no_early_trigger(laboratory: Laboratory) -> None:
    """A busy host notes the command when the sphere has half fallen: a drop like any other."""
    release = laboratory.rig.valve.release

    def noted_late(*permitted: Callable[[], bool]) -> ValveReport:
        report = release(*permitted)
        return replace(report, sent_monotonic_ns=report.sent_monotonic_ns + 50_000_000)

    laboratory.rig.valve.release = noted_late  # type: ignore[method-assign, assignment]
    assert laboratory.drop().state == "stored"


def test_fifty_requests_with_one_key_make_one_drop(laboratory: Laboratory) -> None:
    """The same key at the same time from fifty threads fires once."""
    found: list[Drop] = []
    barrier = threading.Barrier(50)

    def ask() -> None:
        barrier.wait()
        found.append(laboratory.service.request_drop(REQUEST, owner="ab", idempotency_key="k"))

    threads = [threading.Thread(target=ask) for _ in range(50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [drop.number for drop in found] == [1] * 50
    assert laboratory.service.wait(1, 20.0).state == "stored"
    again = laboratory.service.request_drop(REQUEST, owner="ab", idempotency_key="k")
    assert (again.number, again.state) == (1, "stored")
    assert len(laboratory.archive.drops()) == 1
    truth = laboratory.world.truth()["shots"]
    assert isinstance(truth, list)
    assert len(truth) == 1


def test_a_second_client_is_told_who_holds_the_rig(laboratory: Laboratory) -> None:
    """Another drop while one runs is refused with owner and number; nothing is queued."""
    laboratory.world.faults.no_sphere = True
    first = laboratory.service.request_drop(REQUEST, owner="ab")
    with pytest.raises(BusyError) as raised:
        laboratory.service.request_drop(request(operator="cd"), owner="cd")
    assert (raised.value.owner, raised.value.number) == ("ab", first.number)
    status = laboratory.service.status()
    assert (status.ready, status.owner, status.drop) == (False, "ab", first.number)
    assert status.sentence.startswith("NOT READY: drop 1, for ab, ")
    laboratory.service.abort(by="test")
    assert len(laboratory.archive.drops()) == 1


def test_one_key_for_two_requests_is_refused(laboratory: Laboratory) -> None:
    """A key that belongs to another body is a client's mistake, said before anything moves."""
    laboratory.drop(idempotency_key="k")
    with pytest.raises(IdempotencyConflictError):
        laboratory.service.request_drop(
            request(drop_height_m=0.02), owner="ab", idempotency_key="k"
        )


@pytest.mark.parametrize("height_m", [0.0, -0.01, 4.7, math.nan, math.inf])
def test_a_height_the_stand_does_not_allow_is_refused(
    laboratory: Laboratory, height_m: float
) -> None:
    """The message gives what was asked and what is allowed."""
    with pytest.raises(DropHeightError, match=r"to 0\.15 m"):
        laboratory.service.request_drop(request(drop_height_m=height_m), owner="ab")
    assert laboratory.archive.drops() == []


def test_an_unknown_material_is_answered_with_the_known_ones(laboratory: Laboratory) -> None:
    """A slip of the pen gets the near name and the list."""
    with pytest.raises(UnknownMaterialError, match="Did you mean 'acetal'") as raised:
        laboratory.service.request_drop(request(sphere="acetl"), owner="ab")
    assert "steel" in raised.value.known


ABORTABLE = [
    State.LOADING,
    State.CHECKING,
    State.ARMING,
    State.ARMED,
    State.RELEASED,
    State.CAPTURING,
]


@pytest.mark.parametrize("state", ABORTABLE, ids=lambda state: state.value)
def test_an_abort_ends_a_drop_in_every_state(laboratory: Laboratory, state: State) -> None:
    """Valve safe, aborted by whom, what to look at before the next drop, and that one works."""
    reached = threading.Event()
    machine = laboratory.service._loop.machine

    def watch(_before: State, _event: object, after: State) -> None:
        if after is state and not reached.is_set():
            reached.set()

    machine._listener = watch
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    assert reached.wait(20.0)
    report = laboratory.service.abort(by="cd")
    print(f"abort in {state.value}: {report.took_s * 1e3:.1f} ms")
    assert report.took_s < LIMIT_S
    assert report.drop == drop.number
    assert report.aborted
    ended = laboratory.service.wait(drop.number, 20.0)
    assert ended.state == "aborted"
    assert ended.problem is not None
    assert "Drop 1 was aborted by cd" in ended.problem.detail
    reading = laboratory.rig.valve.vacuum()
    assert reading is not None
    assert reading.volts > 1.0  # the pump is connected again
    assert laboratory.service.wait_ready(10.0)
    look = "Look at the coupon first" in ended.problem.remedy
    assert look or ended.problem.remedy == "The sphere was not released; request a new drop."
    if state is not State.ARMED:  # where it is released at once
        assert look == (state in {State.RELEASED, State.CAPTURING})
    said = "drop 1 ended after its release: look at the coupon first" if look else ""
    status = laboratory.service.status()
    assert status.attention == said
    assert said in status.sentence
    assert laboratory.drop().state == "stored"
    assert laboratory.service.status().attention == ""


def test_a_shot_that_is_being_stored_survives_an_abort(laboratory: Laboratory) -> None:
    """Whole data is kept; the report says that it came too late."""
    storing = threading.Event()
    store = laboratory.archive.store_shot

    def slow(*arguments: object) -> object:
        storing.set()
        time.sleep(0.3)
        return store(*arguments)  # type: ignore[arg-type]

    laboratory.archive.store_shot = slow  # type: ignore[method-assign, assignment]
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    assert storing.wait(20.0)
    report = laboratory.service.abort(by="cd")
    assert not report.aborted
    assert "its shot is kept" in report.sentence
    assert laboratory.service.wait(drop.number, 20.0).state == "stored"
    assert laboratory.service.wait_ready(10.0)


def test_an_abort_of_another_drop_touches_nothing(laboratory: Laboratory) -> None:
    """DELETE of an old number does not end somebody else's drop."""
    laboratory.world.faults.no_sphere = True
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    assert not laboratory.service.abort(by="cd", number=drop.number + 1).aborted
    laboratory.world.faults.no_sphere = False
    assert laboratory.state in (State.LOADING, State.CHECKING)
    laboratory.service.abort(by="cd", number=drop.number)
    assert laboratory.service.wait(drop.number, 20.0).state == "aborted"


def test_an_abort_without_a_drop_makes_the_rig_safe(laboratory: Laboratory) -> None:
    """The button works when nothing runs, and the rig stays ready."""
    laboratory.rig.valve.release()
    report = laboratory.service.abort(by="cd")
    assert not report.aborted
    assert "The vacuum is on" in report.sentence
    assert laboratory.service.wait_ready(10.0)


def test_a_drop_interrupted_by_a_restart_is_shown_and_not_repeated(
    build: Callable[..., Laboratory],
) -> None:
    """What a dead daemon left is interrupted; its key gives it back, and nothing falls."""
    first = build()
    first.archive.begin_drop(REQUEST, owner="ab", idempotency_key="k")
    first.archive.set_drop_state(1, "released")
    first.close()
    second = build().start()
    drop = second.archive.drop(1)
    assert drop.state == "interrupted"
    assert drop.problem is not None
    assert "released" in drop.problem.detail
    again = second.service.request_drop(REQUEST, owner="ab", idempotency_key="k")
    assert (again.number, again.state) == (1, "interrupted")
    second.wait_told()
    assert ("drop.interrupted", 1) in [(kind, told.get("number")) for kind, told in second.events]
    assert second.world.truth()["shots"] == []
    assert second.drop().number == 2


@pytest.mark.parametrize("ends", ["stop", "abort"])
def test_what_ends_a_test_of_the_devices_is_no_fault(
    build: Callable[..., Laboratory], ends: str
) -> None:
    """A shutdown or an abort while the rig is connected raises no alarm, and the rig gets ready."""
    laboratory = build()
    laboratory.service.start()
    for _ in range(20):
        if ends == "abort":
            laboratory.service.abort(by="cd")
        time.sleep(0.01)
    if ends == "abort":
        assert laboratory.service.wait_ready(10.0)
    laboratory.service.stop()
    assert "rig.fault" not in [kind for kind, _ in laboratory.events]


def test_shutdown_during_a_drop_leaves_a_safe_valve_and_a_reason(
    build: Callable[..., Laboratory],
) -> None:
    """Stopping the daemon aborts, closes the row, and refuses what comes after."""
    laboratory = build().start()
    laboratory.world.faults.no_sphere = True
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    laboratory.service.stop()
    assert laboratory.archive.drop(drop.number).state == "aborted"
    assert laboratory.state is State.STOPPED
    assert not laboratory.service.alive()
    with pytest.raises(NotReadyError, match="not running"):
        laboratory.service.request_drop(REQUEST, owner="ab")


def test_a_required_calibration_forbids_drops_but_not_its_own(
    build: Callable[..., Laboratory],
) -> None:
    """Without a valid calibration only the drops of a calibration run are let through."""
    laboratory = build(preflight={"require_valid_calibration": True}).start()
    assert "never calibrated" in laboratory.service.status().sentence
    with pytest.raises(NotReadyError, match="never calibrated"):
        laboratory.service.request_drop(REQUEST, owner="ab")
    run, _ = laboratory.archive.calibrations.begin("s", [], "ab")
    assert laboratory.drop(calibration=run.number).state == "stored"


def test_a_reservation_lets_only_its_own_series_through(laboratory: Laboratory) -> None:
    """Between two drops of a series nobody else gets in."""
    run, _ = laboratory.archive.calibrations.begin("s", [], "ab")
    held = laboratory.service.reserve("calibration 1 of ab", run.number)
    with pytest.raises(BusyError, match="calibration 1 of ab"):
        laboratory.service.request_drop(REQUEST, owner="cd")
    assert laboratory.drop(calibration=run.number).state == "stored"
    laboratory.service.give_back(held)
    assert laboratory.drop().state == "stored"


def test_the_status_is_json_ready_and_alive(laboratory: Laboratory) -> None:
    """One sentence, checks with remedies, calibration in words and fields."""
    status = laboratory.service.status()
    assert status.ready
    assert status.sentence.startswith("READY")
    assert {check.name for check in status.checks} == {
        "digitizer",
        "valve",
        "sphere",
        "input",
        "disk",
        "calibration",
    }
    assert asdict(status)["calibration"]["word"] == "none"
    assert laboratory.service.alive()


def test_without_a_gauge_the_file_says_that_nobody_can_tell(
    build: Callable[..., Laboratory],
) -> None:
    """On an LCUS-1 the sphere gets its time, and the shot says what is not known."""
    gauge = {
        "adc_channel": None,
        "adc_volts_per_code": None,
        "held_threshold_v": None,
        "held_above": None,
    }
    laboratory = build(valve={"driver": "lcus", **gauge}, timeouts={"blind_loading_s": 0.1}).start()
    drop = laboratory.drop(DropRequest("acetal", "aluminium", 0.03, "ab"))
    assert drop.state == "stored", drop.problem
    metadata = laboratory.archive.read_shot(drop.number).metadata
    assert metadata.valve_confirmed is False
    assert metadata.vacuum_v is None
    assert any("cannot tell" in note for note in metadata.notes)
    assert any("unconfirmed" in note for note in metadata.notes)
