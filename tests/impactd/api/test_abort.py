"""Abort: nothing that was sent before its answer moves after it, and it waits for nobody."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlsplit

import pytest
from typer.testing import CliRunner

from impactd.api.sessions import CSRF_HEADER
from impactd.cli import app
from impactd.console import abort_socket
from impactd.console.abort_socket import abort_through_socket
from impactd.moduli.service import ModuliAnswer

from .conftest import ACETAL_ON_ALUMINIUM, until


@pytest.fixture
def ready(rig):
    """The rig, idle."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    return rig


@contextlib.contextmanager
def stuck_database(rig):
    """Hold the index as a disk that hangs does; whatever asks it waits."""
    index = rig.daemon.archive._index
    with index._lock, index._reading:
        yield


def _send(rig, method: str, path: str, body: object = None) -> socket.socket:
    """Send a whole request of the operator over a connection of its own."""
    client = socket.create_connection((urlsplit(rig.url).hostname, urlsplit(rig.url).port), 30)
    content = b"" if body is None else json.dumps(body).encode()
    lines = (
        f"{method} {path} HTTP/1.1",
        "Host: 127.0.0.1",
        f"Authorization: {rig.operator.headers['authorization']}",
        f"Idempotency-Key: {uuid.uuid4()}",
        "Content-Type: application/json",
        "Connection: close",
        f"Content-Length: {len(content)}",
    )
    client.sendall("\r\n".join(lines).encode() + b"\r\n\r\n" + content)
    return client


def _answer(client: socket.socket) -> tuple[int, dict]:
    with client, client.makefile("rb") as reader:
        head, _, body = reader.read().partition(b"\r\n\r\n")
    return int(head.split()[1]), json.loads(body)


def _falls(rig) -> int:
    return len(rig.daemon.rig.world.truth()["shots"])


@pytest.mark.parametrize("way", ["socket", "http"])
def test_what_the_kernel_held_at_an_abort_never_moves(ready, way):
    """A drop was sent, nobody had read it yet, somebody aborted: no sphere falls."""
    before, go_on = _falls(ready), threading.Event()
    ready.server._arrivals._loop.call_soon_threadsafe(go_on.wait, 30)
    asked = _send(ready, "POST", "/v1/drops", ACETAL_ON_ALUMINIUM)
    time.sleep(0.05)
    if way == "socket":
        answer = abort_through_socket(ready.url, "ab")
        go_on.set()
    else:
        aborting = _send(ready, "POST", "/v1/abort")
        go_on.set()
        answer = _answer(aborting)[1]
    assert "vacuum is on" in answer["sentence"]
    assert 0 <= answer["took_ms"] <= answer["safe_after_ms"]
    status, said = _answer(asked)
    if status == 202:  # it was read first, and the abort ended it
        assert way == "http"
        assert ready.ended(said["number"])["state"] == "aborted"
    else:
        assert (status, said["type"]) == (409, "urn:impactd:problem:aborted")
        assert "accepted before the abort at" in said["detail"]
    until(lambda: ready.anybody.get("/v1/status").json(), lambda status: status["ready"])
    assert _falls(ready) == before


def test_a_drop_that_is_asked_for_after_an_abort_is_made(ready):
    """An abort voids what came before it, not what comes after."""
    assert ready.operator.post("/v1/abort").status_code == 200
    until(lambda: ready.anybody.get("/v1/status").json(), lambda status: status["ready"])
    answer = ready.drop()
    assert answer.status_code == 202, answer.text
    assert ready.operator.delete(f"/v1/drops/{answer.json()['number']}").status_code == 200


def test_an_abort_does_not_ask_a_stuck_database(ready):
    """With a token, with a session, and through the socket."""
    session = ready.client("operate")
    with session:
        csrf = session.post("/v1/session").json()["csrf"]
        del session.headers["authorization"]
        assert ready.operator.get("/v1/drops").status_code == 200
        with stuck_database(ready):
            assert ready.operator.post("/v1/abort").status_code == 200
            assert session.post("/v1/abort", headers={CSRF_HEADER: csrf}).status_code == 200
            assert abort_through_socket(ready.url, "ab") is not None


def test_a_drop_is_aborted_by_number_while_the_database_is_stuck(ready):
    """The answer comes from memory; the row follows when the disk does."""
    number = ready.drop().json()["number"]
    with stuck_database(ready):
        answer = ready.operator.delete(f"/v1/drops/{number}")
    assert answer.status_code == 200, answer.text
    assert answer.json()["state"] == "aborted"
    assert ready.ended(number)["state"] == "aborted"


def test_a_token_that_was_revoked_soon_aborts_no_more(ready):
    """What is kept in memory is read again every two seconds."""
    token, secret = ready.daemon.archive.tokens.create("gone", "operate", 1)
    bearer = {"Authorization": f"Bearer {secret}"}
    assert ready.anybody.post("/v1/abort", headers=bearer).status_code == 200
    ready.daemon.archive.tokens.revoke(token.id)
    until(
        lambda: ready.anybody.post("/v1/abort", headers=bearer).status_code,
        lambda status: status == 401,
    )


def test_large_reads_wait_their_turn(ready, monkeypatch):
    """Ten readers of moduli compute two at a time, and other requests are answered meanwhile."""
    done, inside = threading.Event(), []

    def slow(**_filters):
        inside.append(1)
        assert done.wait(60)
        return ModuliAnswer({"moduli": {}}, {"shots": b"[]"})

    monkeypatch.setattr(ready.daemon, "moduli", slow)
    with ThreadPoolExecutor(10) as pool:
        try:
            answers = [pool.submit(ready.reader.get, "/v1/moduli") for _ in range(10)]
            until(lambda: len(inside), lambda count: count == 2)
            assert ready.reader.get("/v1/drops").status_code == 200
            assert ready.operator.post("/v1/abort").status_code == 200
            assert len(inside) == 2
        finally:
            done.set()
        assert {answer.result().status_code for answer in answers} == {200}


@pytest.mark.parametrize("way", ["the abort socket", "HTTP"])
def test_the_command_says_which_way_it_went(ready, way, monkeypatch, tmp_path):
    """`impactd abort` goes through the socket, over HTTP where there is none, and says how long."""
    monkeypatch.setenv("IMPACTD_TOKEN", ready.token("operate"))
    if way == "HTTP":
        monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
        monkeypatch.setattr(abort_socket, "private_folder", lambda: tmp_path / "nothing")
    ended = CliRunner().invoke(app, ["abort", "--url", ready.url])
    assert ended.exit_code == 0, ended.output
    assert "The vacuum is on" in ended.output
    assert f"Through {way}; " in ended.output
    assert " ms from receipt to safe." in ended.output
