"""A mistake at the rig is heard right after the drop: real HTTP and files, simulated rig."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest

from impactd.console.shots import advice_words

from .conftest import Rig, run_daemon, simulated_settings, until

ACETAL = {
    "sphere": "acetal",
    "surface": "polycarbonate",
    "drop_height_m": 0.03,
    "operator": "ab",
}
HDPE = ACETAL | {"sphere": "hdpe"}
GOOD = 8
"""With four, chance brings another height into question beside the label in one run of nine."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """Two spheres, each dropped a few times as labelled."""
    for rig in run_daemon(simulated_settings(tmp_path_factory.mktemp("repetitions"))):
        for _ in range(GOOD):
            compared(rig, ACETAL)
            compared(rig, HDPE)
        yield rig


def compared(rig: Rig, body: dict[str, Any], **hung: Any) -> dict[str, Any]:
    """Return the shot of a drop once it is compared; the hand may hang something else."""
    world = rig.daemon.rig.world
    assert world is not None
    load = world.load

    def other(sphere: str, surface: str, drop_height_m: float) -> None:
        truly = {"sphere": sphere, "surface": surface, "drop_height_m": drop_height_m} | hung
        load(**truly)

    world.load = other  # type: ignore[method-assign]
    try:
        until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
        number = rig.drop(body).json()["number"]
        assert rig.ended(number)["state"] in ("stored", "analysed")
    finally:
        world.load = load  # type: ignore[method-assign]
    shot = until(
        lambda: rig.reader.get(f"/v1/shots/{number}").json(), lambda one: one["repetitions"]
    )
    assert isinstance(shot, dict)
    return shot


def events(rig: Rig, kind: str) -> list[dict[str, Any]]:
    """Return what was told of one kind."""
    return [one.data for one in rig.daemon.archive.events.since(0, 10_000) if one.kind == kind]


def test_good_shots_say_nothing(rig: Rig) -> None:
    """From the third on each is compared with those before it; no event is told of any."""
    found = [rig.reader.get(f"/v1/shots/{n}").json() for n in range(1, 2 * GOOD + 1)]
    counts = [len(shot["repetitions"]["shots"]) for shot in found]
    assert counts == [0, 0, 0, 0, *(n for n in range(2, GOOD) for _ in range(2))]
    assert not any(shot["repetitions"]["unlike"] for shot in found)
    assert {shot["repetitions"]["sentence"] for shot in found} == {""}
    assert events(rig, "shot.unlike") == []


def test_another_sphere_than_the_label_says_is_heard_at_once(rig: Rig) -> None:
    """JSON, event and advice name the sphere; nothing is blocked, and the next good one is good."""
    shot = compared(rig, ACETAL, sphere="hdpe")
    found = shot["repetitions"]
    assert found["unlike"]
    assert len(found["shots"]) == GOOD
    assert found["likely"] == [{"sphere": "hdpe"}]
    assert "look at the label" in found["sentence"]
    told = until(lambda: events(rig, "shot.unlike"), bool)  # after the shot can be read
    assert [one["sentence"] for one in told] == [found["sentence"]]
    assert (shot["advice"], shot["because"][0]) == ("check", found["sentence"])
    assert f"unlike its {GOOD} repetitions" in advice_words(shot)
    rig.ended(shot["number"], ("analysed",))
    good = compared(rig, ACETAL)["repetitions"]
    assert not good["unlike"]
    assert shot["number"] not in good["shots"]


def test_another_height_than_the_stated_one_is_told_in_millimetres(rig: Rig) -> None:
    """Size and duration follow the height; the number is about right."""
    found = compared(rig, HDPE, drop_height_m=0.042)["repetitions"]
    assert found["unlike"]
    assert found["likely"][0]["drop_height_m"] == pytest.approx(0.042, rel=0.1)
    assert "it fell from about" in found["sentence"].replace("It fell", "it fell")


def test_a_comparison_waits_for_no_fit(rig: Rig) -> None:
    """While the worker of the fits is busy, a shot is compared all the same, in under a second."""
    lane = rig.daemon.jobs._lanes[False]
    held = 0
    while lane.free.acquire(timeout=5.0):
        held += 1
        if held == rig.daemon.settings.jobs.workers:
            break
    try:
        began_s = time.perf_counter()
        shot = compared(rig, ACETAL)
        print(f"request to comparison {time.perf_counter() - began_s:.2f} s")
        job = rig.daemon.archive.jobs.list(kind="compare_shot", limit=1)[0]
    finally:
        for _ in range(held):
            lane.free.release()
    assert shot["repetitions"]["shots"]
    assert not shot["fits"]
    print(f"comparison {job.started_utc} to {job.finished_utc}")


def test_it_outlives_the_index(rig: Rig) -> None:
    """What was said of a shot is in the journal, and an import has none."""
    archive = rig.daemon.archive
    journal = (archive.directory / "journal.jsonl").read_text()
    assert '"comparisons"' in journal
    assert archive.comparisons.get(999) is None
