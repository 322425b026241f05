"""Calibrations over HTTP: a series of drops, once per slot."""

from __future__ import annotations

import pytest

from impactd.data_lock import read_holder

from .conftest import until

PLAN = [
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.025, "repeats": 1},
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.045, "repeats": 1},
]


@pytest.fixture(scope="module")
def calibration(rig):
    """One calibration run that has ended."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    answer = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "test-slot"})
    assert answer.status_code == 202, answer.text
    until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed"),
    )
    return rig.reader.get(answer.headers["location"]).json()


def test_a_calibration_runs_its_plan_and_becomes_the_current_one(rig, calibration):
    """Every planned drop is made and belongs to the run; the result is in force with a date."""
    assert calibration["state"] == "done", calibration["problem"]
    assert len(calibration["drops"]) == 2
    for number in calibration["drops"]:
        drop = rig.reader.get(f"/v1/drops/{number}").json()
        assert drop["calibration"] == calibration["number"]
    current = rig.reader.get("/v1/calibrations/current").json()
    assert current["number"] == calibration["number"]
    assert current["valid_until_utc"] > current["finished_utc"]
    assert rig.reader.get("/v1/calibrations").json()["items"][0] == calibration


def test_a_slot_never_runs_twice(rig, calibration):
    """The timer may ring again: the same slot gives the old run; another plan is a conflict."""
    again = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "test-slot"})
    assert again.status_code == 202
    assert again.json()["number"] == calibration["number"]
    other = rig.operator.post("/v1/calibrations", json={"plan": PLAN[:1], "slot": "test-slot"})
    assert other.status_code == 409
    assert other.json()["type"] == "urn:impactd:problem:idempotency-conflict"


def test_a_run_without_slot_or_key_is_refused(rig):
    """A series of drops is physical: something must say that it was asked for once."""
    answer = rig.operator.post("/v1/calibrations", json={})
    assert answer.status_code == 400
    assert answer.json()["type"] == "urn:impactd:problem:idempotency-key-missing"


def test_only_references_calibrate(rig, calibration):
    """A specimen of unknown modulus cannot carry a calibration."""
    plan = [{"sphere": "acetal", "surface": "specimen", "drop_height_m": 0.03, "repeats": 1}]
    answer = rig.operator.post("/v1/calibrations", json={"plan": plan, "slot": "wrong"})
    assert answer.status_code == 409
    assert answer.json()["type"] == "urn:impactd:problem:not-ready"
    assert "specimen" in answer.json()["detail"]


def test_the_data_directory_says_who_serves_it(rig):
    """The lock names process and address while the daemon runs."""
    holder = read_holder(rig.daemon.archive.directory)
    assert holder["url"] == rig.url
