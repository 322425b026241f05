"""Many hands at once: one drop, the owner by name, an abort for anybody entitled."""

from __future__ import annotations

import socket
import threading
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx2
import pytest

from ...impactd.api.conftest import (
    ACETAL_ON_ALUMINIUM,
    Rig,
    run_daemon,
    simulated_settings,
    until,
)

# The promise is 100 ms; machines that run tests are noisy, so the figure is printed.
ABORT_LIMIT_S = 5.0
PARALLEL = 50


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A daemon of these tests' own, because they hold its rig."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("parallel")))


@pytest.fixture
def ready(rig: Rig) -> Iterator[Rig]:
    """The rig, idle before and after."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    yield rig
    assert rig.daemon.rig.world is not None
    rig.daemon.rig.world.faults.clear()
    rig.operator.post("/v1/abort")


def _falls(rig: Rig) -> int:
    assert rig.daemon.rig.world is not None
    shots = rig.daemon.rig.world.truth()["shots"]
    assert isinstance(shots, list)
    return len(shots)


def _together(ask: list, workers: int = PARALLEL) -> list[httpx2.Response]:
    """Send all requests at the same moment, each over a connection of its own."""
    barrier = threading.Barrier(len(ask))

    def go(one) -> httpx2.Response:
        barrier.wait()
        return one()

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(go, ask))


def _post(rig: Rig, token: str, key: str, operator: str = "ab") -> httpx2.Response:
    headers = {"Authorization": f"Bearer {token}", "Idempotency-Key": key}
    body = {**ACETAL_ON_ALUMINIUM, "operator": operator}
    with httpx2.Client(base_url=rig.url, timeout=60, trust_env=False) as client:
        return client.post("/v1/drops", json=body, headers=headers)


def test_fifty_parallel_posts_with_one_key_make_one_drop(ready: Rig) -> None:
    """All fifty are told of the same drop, and one sphere falls."""
    before, token, key = _falls(ready), ready.token("operate"), str(uuid.uuid4())
    answers = _together([lambda: _post(ready, token, key)] * PARALLEL)
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["number"] for answer in answers}) == 1
    ready.ended(answers[0].json()["number"])
    assert _falls(ready) == before + 1


def test_of_fifty_posts_with_keys_of_their_own_one_wins(ready: Rig) -> None:
    """The others are told who holds the rig and with which drop."""
    before, token = _falls(ready), ready.token("operate", "winner")
    answers = _together([lambda: _post(ready, token, str(uuid.uuid4()), "cd")] * PARALLEL)
    won = [answer for answer in answers if answer.status_code == 202]
    assert len(won) == 1
    number = won[0].json()["number"]
    for answer in answers:
        if answer.status_code != 202:
            assert answer.status_code == 409
            problem = answer.json()
            assert problem["type"] == "urn:impactd:problem:busy"
            assert (problem["owner"], problem["drop"]) == ("cd (winner)", number)
    assert ready.ended(number)["state"] in ("stored", "analysed")
    assert _falls(ready) == before + 1


def test_a_second_technician_is_told_of_the_first_and_may_abort_at_once(ready: Rig) -> None:
    """409 names the owner; any operate token aborts, a read token does not."""
    assert ready.daemon.rig.world is not None
    took_s = []
    for _ in range(20):
        until(lambda: ready.anybody.get("/v1/status").json(), lambda status: status["ready"])
        ready.daemon.rig.world.faults.no_sphere = True
        first = _post(ready, ready.token("operate", "tea"), str(uuid.uuid4()), "ab")
        number = first.json()["number"]
        second = _post(ready, ready.token("operate", "sam"), str(uuid.uuid4()), "cd")
        assert second.status_code == 409
        assert (second.json()["owner"], second.json()["drop"]) == ("ab (tea)", number)
        assert ready.reader.delete(f"/v1/drops/{number}").status_code == 403
        with ready.client("operate", "sam") as sam:
            sam.get("/v1/status")  # a page has its connection already
            began_s = time.perf_counter()
            ended = sam.delete(f"/v1/drops/{number}")
            took_s.append(time.perf_counter() - began_s)
        assert ended.status_code == 200
        assert ended.json()["state"] in ("aborted", "requested")
        dropped = ready.ended(number)
        assert dropped["state"] == "aborted"
        assert "was aborted by sam" in dropped["problem"]["detail"]
    print(f"abort over HTTP, slowest of {len(took_s)}: {max(took_s) * 1e3:.0f} ms")
    assert max(took_s) < ABORT_LIMIT_S


def _raw(
    rig: Rig, key: str, *, body: bytes, said_bytes: int, token: str | None = None
) -> socket.socket:
    host, port = rig.url.removeprefix("http://").split(":")
    head = (
        f"POST /v1/drops HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer "
        f"{token or rig.token('operate')}\r\nIdempotency-Key: {key}\r\n"
        f"Content-Type: application/json\r\nContent-Length: {said_bytes}\r\n\r\n"
    )
    connection = socket.create_connection((host, int(port)), timeout=10)
    connection.sendall(head.encode() + body)
    return connection


BODY = b'{"sphere":"acetal","surface":"aluminium","drop_height_m":0.03,"operator":"ab"}'


@pytest.mark.parametrize("sent", [0, 1, 40, len(BODY) - 1])
def test_a_client_that_goes_before_its_body_is_whole_makes_no_drop(ready: Rig, sent: int) -> None:
    """Half a request is none: no row, nothing falls."""
    rows, key = ready.daemon.archive.drops(limit=1), str(uuid.uuid4())
    _raw(ready, key, body=BODY[:sent], said_bytes=len(BODY)).close()
    time.sleep(0.1)
    assert ready.daemon.archive.drops(limit=1) == rows
    assert ready.anybody.get("/v1/status").json()["ready"]


def test_a_client_that_goes_before_its_answer_finds_its_drop_again(
    ready: Rig, tmp_path: Path
) -> None:
    """The request was whole: one drop, and the same key tells of it."""
    before, key, token = _falls(ready), str(uuid.uuid4()), ready.token("operate")
    _raw(ready, key, body=BODY, said_bytes=len(BODY), token=token).close()
    until(
        lambda: ready.daemon.archive.drops(limit=1),
        lambda drops: drops and drops[0].client_key == key,
    )
    again = _post(ready, token, key)
    assert again.status_code == 202
    assert ready.ended(again.json()["number"])["state"] in ("stored", "analysed")
    assert _falls(ready) == before + 1
