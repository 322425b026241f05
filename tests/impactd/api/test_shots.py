"""Shots over HTTP: found, shown, downloaded, drawn."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx2
import numpy as np
import pytest

from analysis import fit_campaign
from impactd.console.stored_shots import campaign_of_files

from .conftest import Rig, run_daemon, simulated_settings, until


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A daemon of this file's own: others calibrate theirs and choose its model."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("shots")))


@pytest.fixture(scope="module")
def shot(rig: Rig) -> dict[str, object]:
    """One stored and analysed shot."""
    return rig.analysed_shot()


def test_a_shot_tells_what_it_is_and_what_to_do_with_it(shot):
    """A shot brings its fits and one word of advice."""
    assert shot["sphere"] == "acetal"
    assert {fit["model"] for fit in shot["fits"]} == {"hsd", "kv", "kv2"}
    assert shot["advice"] in ("use", "check", "repeat")
    assert "file" not in shot


def test_the_download_is_what_the_etag_says(rig, shot):
    """ETag is the SHA-256 of the bytes."""
    answer = rig.reader.get(shot["links"]["file"])
    assert answer.status_code == 200
    assert answer.headers["etag"] == f'"{hashlib.sha256(answer.content).hexdigest()}"'
    assert answer.headers["etag"] == f'"{shot["sha256"]}"'
    assert answer.headers["content-type"] == "application/x-hdf5"
    assert answer.content[:8] == b"\x89HDF\r\n\x1a\n"


def test_a_download_can_be_continued(rig, shot):
    """A range gives its part of the file."""
    whole = rig.reader.get(shot["links"]["file"]).content
    part = rig.reader.get(shot["links"]["file"], headers={"Range": "bytes=100-199"})
    assert part.status_code == 206
    assert part.content == whole[100:200]


def test_a_range_outside_the_file_is_a_problem(rig, shot):
    """416 says how long the file is."""
    answer = rig.reader.get(shot["links"]["file"], headers={"Range": "bytes=999999999-"})
    assert answer.status_code == 416
    assert answer.json()["type"] == "urn:impactd:problem:range-not-satisfiable"
    assert answer.headers["content-range"] == f"bytes */{shot['size_bytes']}"


def test_a_known_file_is_not_sent_again(rig, shot):
    """If-None-Match with the ETag answers 304."""
    etag = {"If-None-Match": f'"{shot["sha256"]}"'}
    answer = rig.reader.get(shot["links"]["file"], headers=etag)
    assert answer.status_code == 304
    assert answer.content == b""


def test_the_head_of_a_file_tells_its_size(rig, shot):
    """HEAD answers as GET does, without the bytes."""
    answer = rig.reader.head(shot["links"]["file"])
    assert answer.status_code == 200
    assert int(answer.headers["content-length"]) == shot["size_bytes"]


def test_a_damaged_file_is_not_handed_out(rig, shot):
    """One flipped bit on the disk is told, not downloaded."""
    path = rig.daemon.archive.shot_path(shot["number"])
    good = path.read_bytes()
    mode = path.stat().st_mode
    path.chmod(0o600)
    path.write_bytes(good[:5000] + bytes([good[5000] ^ 1]) + good[5001:])
    try:
        answers = [rig.reader.get(shot["links"][name]) for name in ("file", "trace")]
    finally:
        path.write_bytes(good)
        path.chmod(mode)
    assert [answer.status_code for answer in answers] == [500, 500]
    assert {answer.json()["type"] for answer in answers} == {"urn:impactd:problem:damaged"}


@pytest.mark.parametrize("points", [2, 100, 4000])
def test_a_trace_has_at_most_so_many_points_and_keeps_the_peak(rig, shot, points):
    """However coarse, the largest sample is drawn."""
    trace = rig.reader.get(shot["links"]["trace"], params={"points": points}).json()
    full = rig.daemon.archive.read_shot(shot["number"]).recording.signal
    assert len(trace["signal"]) == len(trace["time_s"]) <= points
    assert max(trace["signal"]) == pytest.approx(full.max())
    assert trace["decimated"]
    assert trace["unit"] == "V"
    assert np.all(np.diff(trace["time_s"]) >= 0)


def test_a_part_of_a_trace_is_drawn_in_full(rig, shot):
    """A short stretch around the impact is not thinned, and time is 0 at the trigger."""
    trace = rig.reader.get(
        shot["links"]["trace"], params={"start_s": -0.0005, "stop_s": 0.0005, "points": 4000}
    ).json()
    assert not trace["decimated"]
    assert len(trace["signal"]) == trace["samples"] == pytest.approx(1001, abs=20)
    assert trace["start_s"] == pytest.approx(-0.0005, abs=2e-6)


def test_a_part_outside_the_trace_is_refused(rig, shot):
    """A stretch without samples says how long the record is."""
    answer = rig.reader.get(shot["links"]["trace"], params={"start_s": 100})
    assert answer.status_code == 422
    assert "lasts from" in answer.json()["detail"]


def test_shots_are_filtered_by_pair_and_time(rig, shot):
    """Filters narrow the list; a moment that is none is named."""

    def numbers(**query: str) -> list[int]:
        return [
            item["number"] for item in rig.reader.get("/v1/shots", params=query).json()["items"]
        ]

    assert shot["number"] in numbers(sphere="acetal", surface="aluminium")
    assert numbers(sphere="hdpe") == []
    assert shot["number"] in numbers(since=str(shot["started_utc"]))
    assert shot["number"] not in numbers(until=str(shot["started_utc"]))
    answer = rig.reader.get("/v1/shots", params={"since": "yesterday"})
    assert answer.status_code == 422
    assert "yesterday" in answer.json()["detail"]


def test_the_fit_can_be_asked_for_again(rig, shot):
    """POST /fits answers 202 and a place where the result will be."""
    answer = rig.operator.post("/v1/fits", json={"shots": [shot["number"]], "model": "kv"})
    assert answer.status_code == 202, answer.text
    job = until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed"),
    )
    assert job["state"] == "done", job
    assert job["fits"]


def test_a_fit_of_a_model_or_shot_that_is_not_there_is_refused(rig, shot):
    """Nothing wrong gets into the queue."""
    wrong_model = rig.operator.post("/v1/fits", json={"shots": [shot["number"]], "model": "magic"})
    assert wrong_model.status_code == 422
    assert "kv" in wrong_model.json()["detail"]
    wrong_shot = rig.operator.post("/v1/fits", json={"shots": [4711], "model": "kv"})
    assert wrong_shot.status_code == 404


def test_moduli_hold_value_unit_and_uncertainty(rig, shot):
    """A modulus is a measurand, never a bare number."""
    answer = rig.reader.get("/v1/moduli")
    assert answer.status_code == 200, answer.text
    assert "acetal" in answer.text
    assert rig.reader.get("/v1/moduli", params={"specimen": "nothing such"}).status_code == 200


def test_unchanged_moduli_are_not_sent_again(rig, shot):
    """A client that has the answer gets 304 without a body, until a shot changes it."""
    answer = rig.reader.get("/v1/moduli")
    numbers = [one["number"] for one in answer.json()["shots"] + answer.json()["excluded"]]
    assert answer.headers["content-type"] == "application/json"
    known = {"If-None-Match": answer.headers["etag"]}
    repeated = rig.reader.get("/v1/moduli", headers=known)
    assert shot["number"] in numbers
    assert (repeated.status_code, repeated.content) == (304, b"")
    assert rig.reader.get("/v1/moduli", params={"model": "hsd"}, headers=known).status_code == 200


def test_a_downloaded_shot_is_fitted_as_the_daemon_fitted_it(rig, shot, tmp_path):
    """A picture and the answer to a drop give one modulus: both take the bounce into account."""
    number = shot["number"]
    file = tmp_path / "shot.h5"
    file.write_bytes(rig.reader.get(f"/v1/shots/{number}.h5").content)
    campaign = campaign_of_files([file])
    assert campaign.shots[0].restitution is not None
    (pair,) = fit_campaign(campaign, "hsd", by_pair=True).to_json()["pairs"].values()
    now = rig.reader.get(f"/v1/shots/{number}").json()
    fitted = next(fit["result"] for fit in now["fits"] if fit["model"] == "hsd")
    value = fitted["reduced_modulus_Pa"]["value"]
    assert pair["reduced_modulus_Pa"]["value"] == pytest.approx(value, rel=1e-4)


def test_readers_that_wait_for_the_moduli_hold_nobody_up(rig, shot):
    """However many wait for one computation, lists and abort are answered meanwhile."""
    with ThreadPoolExecutor(60) as pool:
        with rig.daemon._moduli._lock:  # as a computation holds it
            asked = [pool.submit(httpx2.get, f"{rig.url}/v1/moduli", **_as(rig)) for _ in range(60)]
            until(lambda: rig.reader.get("/v1/drops").status_code, lambda code: code == 200)
            assert rig.operator.post("/v1/abort").status_code == 200
            assert not any(one.done() for one in asked)
        assert {one.result().status_code for one in asked} == {200}


def _as(rig):
    return {
        "headers": {"Authorization": rig.reader.headers["Authorization"]},
        "timeout": 60,
        "trust_env": False,
    }
