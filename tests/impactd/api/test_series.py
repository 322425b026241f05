"""A series of drops in the daemon: made to its end, paused, reordered, and void after one abort."""

from __future__ import annotations

import uuid

import pytest

from .conftest import run_daemon, simulated_settings, until

DROP = {"sphere": "acetal", "surface": "specimen", "drop_height_m": 0.02, "operator": "ab"}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A rig whose technician takes half a second for each sphere."""
    settings = simulated_settings(tmp_path_factory.mktemp("own"))
    assert settings.simulation is not None
    simulation = settings.simulation.model_copy(update={"technician_delay_s": 0.5})
    yield from run_daemon(settings.model_copy(update={"simulation": simulation}))


def ready(own):
    """Wait until the rig is ready."""
    until(lambda: own.anybody.get("/v1/status").json(), lambda status: status["ready"])


def begin(own, repeats, key=None, **more):
    """Begin a series of equal drops."""
    ready(own)
    answer = own.operator.post(
        "/v1/series",
        json={"drops": [DROP | {"repeats": repeats}], **more},
        headers={"Idempotency-Key": key or str(uuid.uuid4())},
    )
    assert answer.status_code == 202, answer.text
    return answer.json()


def series(own):
    """Return the series as it is now."""
    return own.reader.get("/v1/series").json()


def newest(own):
    """Return the number of the newest drop."""
    items = own.reader.get("/v1/drops").json()["items"]
    return items[0]["number"] if items else 0


def test_a_series_is_made_to_its_end_and_never_twice(own):
    """Each drop has its number; the same key again begins nothing."""
    before, key = newest(own), str(uuid.uuid4())
    begin(own, 2, key, note="first of the day")
    assert begin_again(own, key)["note"] == "first of the day"
    ended = until(lambda: series(own), lambda found: found["state"] == "ended")
    assert ended["reason"] == "All 2 drops are done."
    assert [one["drop"] for one in ended["drops"]] == [before + 1, before + 2]
    assert begin_again(own, key)["state"] == "ended"
    assert newest(own) == before + 2


def begin_again(own, key):
    """Ask once more with the same key."""
    return own.operator.post(
        "/v1/series",
        json={"drops": [DROP | {"repeats": 2}], "note": "first of the day"},
        headers={"Idempotency-Key": key},
    ).json()


def test_one_abort_voids_every_drop_that_is_left(own):
    """Also where it comes while the series is paused, and somebody resumes it afterwards."""
    begin(own, 5)
    until(lambda: series(own), lambda found: found["drops"][0]["drop"] is not None)
    own.operator.post("/v1/series/pause")
    number = newest(own)
    assert own.operator.post("/v1/abort").json()["aborted"]
    own.operator.post("/v1/series/resume")
    ended = until(lambda: series(own), lambda found: found["state"] == "ended")
    assert "aborted" in ended["reason"]
    ready(own)
    assert newest(own) == number
    assert own.reader.get(f"/v1/drops/{number}").json()["state"] == "aborted"


def test_a_paused_series_lets_nothing_fall_and_goes_on_in_a_new_order(own):
    """Reordered and shortened while it waits; nobody else gets the rig meanwhile."""
    begin(own, 3)
    assert own.operator.post("/v1/series/pause").json()["state"] == "paused"
    added = own.operator.post(
        "/v1/series/drops", json={"drops": [DROP | {"drop_height_m": 0.03}]}
    ).json()
    assert added["of"] == 4
    until(lambda: series(own), lambda found: found["drops"][0]["state"] == "done")
    number = newest(own)
    assert own.drop().status_code == 409
    answer = own.operator.put("/v1/series/order", json={"order": [4, 2]}).json()
    assert [one["id"] for one in answer["drops"]] == [1, 4, 2]
    assert own.operator.put("/v1/series/order", json={"order": [1]}).status_code == 409
    own.operator.post("/v1/series/resume")
    ended = until(lambda: series(own), lambda found: found["state"] == "ended")
    heights = [
        own.reader.get(f"/v1/drops/{one}").json()["drop_height_m"]
        for one in (number + 1, number + 2)
    ]
    assert heights == [0.03, 0.02]
    assert ended["done"] == 3


def test_a_series_that_is_ended_makes_no_further_drop(own):
    """The one under way goes on; what is planned stays planned."""
    begin(own, 4)
    until(lambda: series(own), lambda found: found["drops"][0]["drop"] is not None)
    own.operator.delete("/v1/series")
    ended = until(lambda: series(own), lambda found: found["state"] == "ended")
    assert ended["reason"] == "operate token ended it."
    assert [one["state"] for one in ended["drops"]] == ["done", *["planned"] * 3]
    assert own.operator.post("/v1/series/pause").status_code == 409


def test_a_series_that_the_rig_cannot_make_is_refused_as_a_whole(own):
    """Before anything moves: an unknown sphere, a height beyond the limits, no key."""
    ready(own)
    before = newest(own)
    for drop in (DROP | {"sphere": "marble"}, DROP | {"drop_height_m": 5.0}):
        answer = own.operator.post(
            "/v1/series", json={"drops": [DROP, drop]}, headers={"Idempotency-Key": "x"}
        )
        assert answer.status_code in (404, 422), answer.text
    assert own.operator.post("/v1/series", json={"drops": [DROP]}).status_code == 400
    assert newest(own) == before
