"""Drops over HTTP: one request, one drop, however often it is sent."""

from __future__ import annotations

import threading
import uuid
from concurrent.futures import ThreadPoolExecutor

import pytest

from .conftest import ACETAL_ON_ALUMINIUM, ENDED, until


def test_a_drop_is_accepted_stored_and_analysed(rig):
    """202 with a Location at once; stored and analysed without another request."""
    answer = rig.drop()
    assert answer.status_code == 202, answer.text
    drop = answer.json()
    assert answer.headers["location"] == f"/v1/drops/{drop['number']}" == drop["links"]["self"]
    assert drop["shot"] is None
    ended = rig.ended(drop["number"], ("analysed", "failed", "aborted", "interrupted"))
    assert ended["state"] == "analysed", ended
    assert ended["shot"] == drop["number"]
    assert ended["problem"] is None
    assert ended["operator"] == "ab"


def test_fifty_posts_with_one_key_make_one_drop(rig):
    """A double click, or fifty, drops one sphere."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    before = len(rig.daemon.archive.drops(limit=200))
    key = str(uuid.uuid4())
    with ThreadPoolExecutor(50) as pool:
        answers = list(pool.map(lambda _: rig.drop(key=key), range(50)))
    assert {answer.status_code for answer in answers} == {202}
    numbers = {answer.json()["number"] for answer in answers}
    assert len(numbers) == 1
    assert len(rig.daemon.archive.drops(limit=200)) == before + 1
    rig.ended(numbers.pop())


def test_a_key_with_another_body_is_a_conflict(rig, shot):
    """A key belongs to one request for ever."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    key = str(uuid.uuid4())
    number = rig.drop(key=key).json()["number"]
    answer = rig.drop(ACETAL_ON_ALUMINIUM | {"drop_height_m": 0.031}, key=key)
    assert answer.status_code == 409
    assert answer.json()["type"] == "urn:impactd:problem:idempotency-conflict"
    assert answer.json()["number"] == number
    rig.ended(number)


def test_a_second_drop_is_refused_with_the_owner_of_the_first(rig):
    """409 names who holds the rig and which drop it is."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    first = rig.drop().json()
    with rig.client("operate", "other bench") as other:
        answer = other.post(
            "/v1/drops",
            json=ACETAL_ON_ALUMINIUM | {"operator": "cd"},
            headers={"Idempotency-Key": str(uuid.uuid4())},
        )
    assert answer.status_code == 409
    problem = answer.json()
    assert problem["type"] == "urn:impactd:problem:busy"
    assert problem["owner"] == "ab (operate token)"
    assert problem["drop"] == first["number"]
    assert "ab" in problem["detail"]
    rig.ended(first["number"])


def test_a_running_drop_can_be_deleted_and_an_ended_one_not(rig):
    """DELETE aborts what is under way; afterwards it is a conflict."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    number = rig.drop().json()["number"]
    answer = rig.operator.delete(f"/v1/drops/{number}")
    assert answer.status_code == 200, answer.text
    ended = rig.ended(number)
    assert ended["state"] == "aborted"
    assert ended["problem"]["type"] == "urn:impactd:problem:aborted"
    again = rig.operator.delete(f"/v1/drops/{number}")
    assert again.status_code == 409
    assert again.json()["type"] == "urn:impactd:problem:conflict"


def test_drops_come_in_pages_newest_first(rig, shot):
    """Following `next` shows every drop once."""
    seen, path = [], "/v1/drops?limit=2"
    while path:
        page = rig.reader.get(path).json()
        seen += [drop["number"] for drop in page["items"]]
        path = page["next"]
    assert seen == sorted(set(seen), reverse=True)
    assert seen[-1] == 1
    assert all(rig.reader.get(f"/v1/drops/{n}").json()["state"] in ENDED for n in seen)


def test_an_abort_does_not_queue_behind_slow_requests(rig, monkeypatch):
    """With every shared thread taken, an abort is still answered."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    done, waiting, list_shots = threading.Event(), threading.Semaphore(0), rig.daemon.archive.shots

    def slow(**filters):
        waiting.release()
        assert done.wait(60)
        return list_shots(**filters)

    monkeypatch.setattr(rig.daemon.archive, "shots", slow)
    with ThreadPoolExecutor(45) as pool:
        try:
            answers = [pool.submit(rig.reader.get, "/v1/shots") for _ in range(45)]
            for _ in range(40):
                assert waiting.acquire(timeout=30)
            assert rig.operator.post("/v1/abort").status_code == 200
            assert not any(answer.done() for answer in answers)
        finally:
            done.set()
        assert {answer.result().status_code for answer in answers} == {200}


def test_an_abort_with_nothing_to_abort_says_so(rig):
    """Abort works in any state and reports what it found."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    answer = rig.operator.post("/v1/abort")
    assert answer.status_code == 200
    assert answer.json()["drop"] is None
    assert answer.json()["sentence"]
    assert answer.json()["took_ms"] >= 0
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])


def test_a_rebound_height_is_entered_after_the_drop(rig, shot):
    """A height that fits the bounce is kept and checked; a wrong one flags the shot's fits."""
    number, h = shot["number"], shot["drop_height_m"]
    ratio = shot["fits"][0]["result"]["restitution_prior"]["value"]
    for height, flagged in ((h * ratio**2, False), (h * ratio**2 * 0.5, True)):
        before = max(fit["id"] for fit in rig.reader.get(f"/v1/shots/{number}").json()["fits"])
        body = {"rebound_height_m": height, "u_rebound_height_m": 0.02 * height}
        answer = rig.operator.patch(f"/v1/drops/{number}", json=body)
        assert answer.status_code == 200, answer.text
        assert rig.reader.get(f"/v1/drops/{number}").json()["rebound_height_m"] == height
        fits = until(
            lambda: rig.reader.get(f"/v1/shots/{number}").json()["fits"],
            lambda found, before=before: all(fit["id"] > before for fit in found),
        )
        kv = next(fit["result"] for fit in fits if fit["model"] == "kv2")
        assert ("rebound_height_disagrees" in kv["flags"]) is flagged, kv["rebound_height_check"]


def test_an_impossible_rebound_is_refused(rig, shot):
    """No sphere comes back higher than it fell from; nor without a stated uncertainty."""
    for body in (
        {"rebound_height_m": 2 * shot["drop_height_m"], "u_rebound_height_m": 0.001},
        {"rebound_height_m": 0.01},
    ):
        answer = rig.operator.patch(f"/v1/drops/{shot['number']}", json=body)
        assert answer.status_code in {400, 422}, answer.text
        assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    ("operator", "said"),
    [
        ("ab\u202ecd", "U+202E RIGHT-TO-LEFT OVERRIDE"),
        ("a\x1b[31m", "U+001B control character"),
        ("a\x85b", "U+0085 control character"),
        ("\u2066ab", "U+2066 LEFT-TO-RIGHT ISOLATE"),
    ],
)
def test_an_operator_of_control_or_bidi_characters_is_refused(rig, operator, said):
    """422 with the character's name; nothing is dropped."""
    body = {"sphere": "acetal", "surface": "polycarbonate", "drop_height_m": 0.04}
    answer = rig.operator.post(
        "/v1/drops", json={**body, "operator": operator}, headers={"Idempotency-Key": "deceit"}
    )
    assert answer.status_code == 422, answer.text
    assert said in answer.json()["detail"]
