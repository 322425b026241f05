"""What breaks, what is said about it, and that the next drop works once it is mended."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from impactd.acquisition.errors import NotReadyError
from impactd.acquisition.transitions import State
from impactd.storage.archive import Drop, StorageFullError

from .conftest import REQUEST, Laboratory, request


def _problem(drop: Drop, kind: str, *words: str) -> None:
    assert drop.state == "failed", drop
    assert drop.problem is not None
    assert drop.problem.type == kind, drop.problem
    assert drop.problem.remedy
    for word in words:
        assert word in drop.problem.detail


def _works_again(laboratory: Laboratory) -> None:
    assert laboratory.service.wait_ready(20.0), laboratory.service.status().sentence
    drop = laboratory.drop()
    assert drop.state == "stored", drop.problem


def test_a_sphere_that_is_never_held_times_out_with_a_reason(
    build: Callable[..., Laboratory],
) -> None:
    """Nobody hung a sphere: the drop says so with the gauge's reading, the rig stays sound."""
    laboratory = build(timeouts={"loading_s": 0.3}).start()
    laboratory.world.faults.no_sphere = True
    _problem(laboratory.drop(), "sphere-not-held", "0.3 s", "1.40 V")
    assert laboratory.service.wait_ready(5.0)
    laboratory.world.faults.no_sphere = False
    _works_again(laboratory)


def test_an_unplugged_digitizer_is_a_fault_that_mends_itself(laboratory: Laboratory) -> None:
    """Unplugged during a drop: FAULT with a clear sentence; plugged in again: ready by itself."""
    laboratory.world.faults.no_sphere = True
    drop = laboratory.service.request_drop(REQUEST, owner="ab")
    laboratory.world.faults.usb_unplugged = True
    laboratory.world.faults.no_sphere = False
    laboratory.world.load("acetal", "aluminium", 0.03)
    _problem(laboratory.service.wait(drop.number, 20.0), "device-lost")
    laboratory.wait_for(lambda: laboratory.state in (State.FAULT, State.CONNECTING))
    status = laboratory.service.status()
    assert not status.ready
    assert status.sentence.startswith("NOT READY")
    with pytest.raises(NotReadyError):
        laboratory.service.request_drop(REQUEST, owner="ab")
    laboratory.world.faults.usb_unplugged = False
    _works_again(laboratory)


def test_a_digitizer_unplugged_while_idle_is_noticed(laboratory: Laboratory) -> None:
    """READY is not said for a rig that is gone."""
    laboratory.world.faults.usb_unplugged = True
    laboratory.service._loop.look_again()
    laboratory.wait_for(lambda: not laboratory.service.status().ready)
    laboratory.world.faults.usb_unplugged = False
    _works_again(laboratory)


def test_a_stuck_relay_calls_for_a_person(laboratory: Laboratory) -> None:
    """The valve did not obey: nothing moves until somebody has looked and says so."""
    laboratory.world.faults.relay_stuck = True
    _problem(laboratory.drop(), "device-protocol", "reads back")
    laboratory.wait_for(lambda: laboratory.state is State.FAULT)
    assert "acknowledge" in laboratory.service.status().sentence
    with pytest.raises(NotReadyError):
        laboratory.service.request_drop(REQUEST, owner="ab")
    laboratory.world.faults.relay_stuck = False
    laboratory.service.acknowledge_fault(by="ab")
    _works_again(laboratory)


def test_lost_samples_fail_the_record_and_are_kept_as_evidence(laboratory: Laboratory) -> None:
    """An overrun is no shot; what there is of the record lies in partial/, the rig is sound."""
    laboratory.wait_for(lambda: laboratory.state is State.IDLE)
    arm = laboratory.rig.digitizer.arm

    def arm_then_break(trigger: object) -> None:
        arm(trigger)  # type: ignore[arg-type]
        laboratory.world.faults.overrun_at_sample = 150_000

    laboratory.rig.digitizer.arm = arm_then_break  # type: ignore[method-assign, assignment]
    drop = laboratory.drop()
    _problem(drop, "overrun")
    assert laboratory.archive.shots() == []
    assert list((laboratory.directory / "partial").glob("*.h5"))
    laboratory.rig.digitizer.arm = arm  # type: ignore[method-assign]
    laboratory.world.faults.overrun_at_sample = None
    assert laboratory.service.wait_ready(5.0)
    _works_again(laboratory)


def test_an_impact_below_the_level_is_no_impact(build: Callable[..., Laboratory]) -> None:
    """The sphere fell and nothing crossed the level: the message names level and fall time."""
    laboratory = build(trigger={"level_v": 9.9}, timeouts={"impact_margin_s": 0.3}).start()
    _problem(laboratory.drop(), "no-impact", "9900 mV", "0.078 s")
    assert laboratory.service.wait_ready(5.0)


def test_a_knock_before_the_sphere_can_land_is_no_impact(
    build: Callable[..., Laboratory],
) -> None:
    """A trigger earlier than the fall time is refused and kept as evidence."""
    # At a fifth of its pace: the check is on the careful side, so a host that lags by most of a
    # fall hides a knock, and a fall takes most of a second then.
    laboratory = build(simulation={"clock_speed": 0.2}).start()
    release = laboratory.rig.valve.release

    def knock(*permitted: Callable[[], bool]) -> object:
        # A sphere hung far too low stands for the elbow that hits the bench.
        laboratory.world.load("acetal", "aluminium", 0.002)
        return release(*permitted)

    laboratory.rig.valve.release = knock  # type: ignore[method-assign, assignment]
    drop = laboratory.drop(request(drop_height_m=0.15))
    _problem(drop, "early-trigger", "that was not the sphere")
    assert list((laboratory.directory / "partial").glob("*.h5"))
    assert laboratory.archive.shots() == []


def test_a_baseline_that_sets_off_the_trigger_costs_no_drop(
    build: Callable[..., Laboratory],
) -> None:
    """The input wanders through the level in flight: the shot's trigger is moved to the impact."""
    rig = {"effect": "x_wandering_baseline", "seed": 11}
    laboratory = build(simulation=rig, trigger={"level_v": 0.03, "hysteresis_v": 0.01}).start()
    assert laboratory.drop().state == "stored"
    stored = laboratory.archive.read_shot(1)
    trigger, samples = stored.recording.trigger_index, stored.recording.samples
    assert trigger > 20_000 + 5000
    assert abs(int(np.argmax(np.abs(samples))) - trigger) < 100
    assert any("set off the trigger" in note for note in stored.metadata.notes)
    (told,) = [data for kind, data in laboratory.events if kind == "trigger.early"]
    assert told["early_s"] == pytest.approx((trigger - 20_000) * 1e-6, rel=1e-3)


def test_a_silent_relay_board_is_a_fault_that_mends_itself(
    build: Callable[..., Laboratory],
) -> None:
    """A board that does not answer any more is asked again until it does."""
    laboratory = build(valve={"timeout_s": 0.1}).start()
    laboratory.world.faults.serial_silent = True
    laboratory.wait_for(lambda: laboratory.state is State.FAULT)
    assert laboratory.service.status().sentence.startswith("NOT READY")
    laboratory.world.faults.serial_silent = False
    _works_again(laboratory)


def test_serial_garbage_is_tolerated_and_noted(laboratory: Laboratory) -> None:
    """Stray bytes do not fail a drop; the shot says that there were some."""
    laboratory.world.faults.serial_garbage = b"\x00\xff"
    drop = laboratory.drop()
    assert drop.state == "stored", drop.problem
    notes = laboratory.archive.read_shot(drop.number).metadata.notes
    assert any("garbage" in note for note in notes)


def test_a_noisy_input_refuses_the_drop_before_the_valve(
    build: Callable[..., Laboratory],
) -> None:
    """Pre-flight names the noise, its limit and what to look for; no sphere falls."""
    laboratory = build(
        preflight={"noise_max_v": 1e-3}, timeouts={"settle_s": 0.2, "idle_check_every_s": 60.0}
    ).start()
    _problem(laboratory.drop(), "preflight-input", "mV rms", "below 1 mV")
    assert laboratory.world.truth()["shots"] == []
    laboratory.wait_for(lambda: not laboratory.service.status().ready)
    assert "noise" in laboratory.service.status().sentence


def test_a_full_disk_refuses_before_anything_moves(build: Callable[..., Laboratory]) -> None:
    """Inside the reserve no drop begins, and the sentence says what is missing."""
    laboratory = build().start()
    laboratory.archive.reserve_bytes = 1 << 60
    with pytest.raises(StorageFullError, match="are needed"):
        laboratory.service.request_drop(REQUEST, owner="ab")
    assert "lacks" in laboratory.service.status().sentence
    assert laboratory.archive.drops() == []
    laboratory.archive.reserve_bytes = 0
    _works_again(laboratory)


def test_a_rig_that_is_not_there_at_start_is_waited_for(
    build: Callable[..., Laboratory],
) -> None:
    """The daemon comes up without its digitizer and says what is missing."""
    laboratory = build()
    laboratory.world.faults.usb_unplugged = True
    laboratory.service.start()
    laboratory.wait_for(lambda: laboratory.state is State.FAULT)
    assert "tried again every 0.2 s" in laboratory.service.status().sentence
    laboratory.world.faults.usb_unplugged = False
    _works_again(laboratory)


def test_a_listener_that_fails_stops_no_drop(laboratory: Laboratory) -> None:
    """Clients are told; whoever tells them cannot break the rig."""

    def broken(kind: str, data: object) -> None:
        raise RuntimeError(kind)

    laboratory.service._tell = broken  # type: ignore[assignment]
    assert laboratory.drop().state == "stored"
