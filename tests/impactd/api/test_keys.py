"""Idempotency keys are each client's own, and none of them is the daemon's."""

from __future__ import annotations

import uuid

import pytest

from .conftest import ACETAL_ON_ALUMINIUM, until
from .test_calibrations import PLAN, WEIGHTS


@pytest.fixture
def ready(rig):
    """The rig, idle."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    return rig


def test_two_tokens_with_one_key_make_two_drops(ready):
    """Whoever guesses a key of somebody else gets a drop of his own."""
    headers = {"Idempotency-Key": str(uuid.uuid4())}
    numbers = []
    for client in (ready.operator, ready.admin, ready.operator):
        until(lambda: ready.anybody.get("/v1/status").json(), lambda status: status["ready"])
        answer = client.post("/v1/drops", json=ACETAL_ON_ALUMINIUM, headers=headers)
        assert answer.status_code == 202, answer.text
        numbers.append(answer.json()["number"])
        ready.ended(numbers[-1])
    assert numbers[0] == numbers[2] != numbers[1]


def test_a_client_cannot_take_a_calibrations_key(ready):
    """A drop under the name that the next calibration uses itself: the run makes all its drops."""
    items = ready.reader.get("/v1/calibrations?limit=1").json()["items"]
    number = items[0]["number"] + 1 if items else 1
    taken = ready.drop(key=f"calibration-{number}-0-0")
    ready.ended(taken.json()["number"])
    until(lambda: ready.anybody.get("/v1/status").json(), lambda status: status["ready"])
    headers = {"Idempotency-Key": str(uuid.uuid4())}
    run = ready.operator.post("/v1/calibrations", json={"plan": PLAN}, headers=headers)
    assert run.json()["number"] == number
    assert run.json()["slot"] == headers["Idempotency-Key"]
    ended = until(
        lambda: ready.reader.get(run.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed"),
    )
    assert ended["state"] == "done", ended["problem"]
    assert len(ended["drops"]) == len(PLAN)


def test_a_fit_and_a_diagnosis_may_have_the_same_key(ready, shot):
    """Each kind of job has its keys."""
    headers = {"Idempotency-Key": str(uuid.uuid4())}
    shots = [shot["number"]]
    fit = ready.operator.post("/v1/fits", json={"shots": shots, "model": "hsd"}, headers=headers)
    assert fit.status_code == 202
    diagnosis = ready.operator.post("/v1/diagnoses", json={"shots": shots}, headers=headers)
    assert diagnosis.status_code == 202, diagnosis.text
    ready.operator.delete(diagnosis.headers["location"])
    again = ready.operator.post("/v1/fits", json={"shots": shots, "model": "hsd"}, headers=headers)
    assert again.json()["id"] == fit.json()["id"]


def test_answers_show_a_clients_own_part_of_a_key(ready):
    """Nobody sees how keys are kept; the key of another token is another calibration."""
    headers = {"Idempotency-Key": str(uuid.uuid4())}
    first = ready.operator.post("/v1/calibrations", json=WEIGHTS, headers=headers)
    assert first.json()["slot"] == headers["Idempotency-Key"]
    second = ready.admin.post("/v1/calibrations", json=WEIGHTS, headers=headers)
    assert second.json()["number"] != first.json()["number"]
    other = WEIGHTS | {"readings": WEIGHTS["readings"][:-1]}
    conflict = ready.operator.post("/v1/calibrations", json=other, headers=headers)
    assert conflict.status_code == 409
    assert repr(headers["Idempotency-Key"]) in conflict.json()["detail"]


def test_a_slot_cannot_pretend_to_be_a_key(ready):
    """A slot is everybody's, so it may not look like the key of one."""
    body = {"slot": "token 1 calibration x", "plan": PLAN}
    assert ready.operator.post("/v1/calibrations", json=body).status_code == 422
