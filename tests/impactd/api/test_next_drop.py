"""The drop that a diagnosis asks for, made on request."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import uuid

import pytest

from impactd.storage.jobs import DIAGNOSE

from .conftest import until

PROPOSED = {
    "sphere": "acetal",
    "surface": "polycarbonate",
    "drop_height_m": 0.0412,
    "separates": ["hunt_crossley_damping", "viscoelastic_damping"],
    "expected_distance": 7.1,
    "repeats": 1,
}


def ended_diagnosis(rig, next_drop) -> int:
    """Return the number of a diagnosis that found a family, with this proposal."""
    found = {"verdict": "family", "sentence": "One of two.", "next_drop": next_drop}
    jobs = rig.daemon.archive.jobs
    with rig.daemon.archive.transaction():  # no worker sees it waiting
        job = jobs.enqueue(DIAGNOSE, {"shots": [1], "base": "kv"}, "1 shot(s) from the base kv")
        jobs.finish(job.id, {"diagnosis": found, "report_html": "", "model": None})
    return job.id


@pytest.fixture
def diagnosis(rig, shot) -> int:
    """A diagnosis that knows a drop, on a rig that is ready."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    return ended_diagnosis(rig, PROPOSED)


def ask(rig, number, key=None, body=None):
    """Ask for the drop as the operator."""
    headers = {} if key == "" else {"Idempotency-Key": key or str(uuid.uuid4())}
    return rig.operator.post(
        f"/v1/diagnoses/{number}/next-drop", json=body or {"operator": "ab"}, headers=headers
    )


def test_the_proposed_drop_is_made_once_and_answered_like_any_drop(rig, diagnosis):
    """202 with the drop's Location; the same key again is the same drop; its shot is stored."""
    shown = rig.reader.get(f"/v1/diagnoses/{diagnosis}").json()
    assert shown["links"]["next_drop"] == f"/v1/diagnoses/{diagnosis}/next-drop"
    key = str(uuid.uuid4())
    answer = ask(rig, diagnosis, key)
    assert answer.status_code == 202, answer.text
    drop = answer.json()
    assert answer.headers["location"] == f"/v1/drops/{drop['number']}"
    assert ask(rig, diagnosis, key).json()["number"] == drop["number"]
    ended = rig.ended(drop["number"], ("analysed", "failed", "aborted", "interrupted"))
    assert ended["state"] == "analysed", ended
    assert ended["operator"] == "ab"
    made = rig.reader.get(f"/v1/shots/{ended['shot']}").json()
    assert {name: made[name] for name in ("sphere", "surface", "drop_height_m")} == {
        name: PROPOSED[name] for name in ("sphere", "surface", "drop_height_m")
    }


def test_a_diagnosis_that_proposes_nothing_is_a_conflict(rig, shot):
    """409 says what it found instead, and nothing moves."""
    number = ended_diagnosis(rig, None)
    assert rig.reader.get(f"/v1/diagnoses/{number}").json()["links"]["next_drop"] is None
    before = len(rig.daemon.archive.drops(limit=200))
    answer = ask(rig, number)
    assert answer.status_code == 409
    problem = answer.json()
    assert problem["type"] == "urn:impactd:problem:conflict"
    assert "'family'" in problem["detail"]
    assert "POST /v1/drops" in problem["remedy"]
    assert len(rig.daemon.archive.drops(limit=200)) == before
    assert ask(rig, 999999).status_code == 404


def test_what_moves_needs_a_key_a_scope_and_a_name(rig, diagnosis):
    """Without key 400, as a reader 403, without operator 422, outside the rig's range 422."""
    assert ask(rig, diagnosis, "").status_code == 400
    at = f"/v1/diagnoses/{diagnosis}/next-drop"
    refused = rig.reader.post(at, json={"operator": "ab"}, headers={"Idempotency-Key": "k"})
    assert refused.status_code == 403
    assert ask(rig, diagnosis, body={"sphere": "acetal"}).status_code == 422
    high = ended_diagnosis(rig, {**PROPOSED, "drop_height_m": 4.9})
    answer = ask(rig, high)
    assert answer.status_code == 422, answer.text
    assert "4.9" in answer.json()["detail"]


def command(rig, *words):
    """Run `impactd drop` against the daemon as the operator."""
    return subprocess.run(
        [sys.executable, "-m", "impactd", "drop", *map(str, words)],
        env={**os.environ, "IMPACTD_URL": rig.url, "IMPACTD_TOKEN": rig.token("operate")},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_the_command_line_makes_it_too(rig, diagnosis):
    """`impactd drop --proposed-by N` needs no sphere and refuses one."""
    made = command(rig, "--proposed-by", diagnosis, "-o", "cd", "--json")
    assert made.returncode == 0, made.stderr
    drop = json.loads(made.stdout)
    assert (drop["operator"], drop["drop_height_m"]) == ("cd", PROPOSED["drop_height_m"])
    assert command(rig, "acetal", "--proposed-by", diagnosis).returncode == 2
    assert command(rig, "acetal").returncode == 2
    none = command(rig, "--proposed-by", ended_diagnosis(rig, None))
    assert none.returncode == 1
    assert "proposes no drop" in none.stderr
