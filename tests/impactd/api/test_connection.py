"""Connections on a real server with a small application: their stamps and their limits."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
import time
from collections.abc import Iterator

import pytest
import structlog.testing
import uvicorn

from impactd.acquisition.abort_epoch import AbortEpoch
from impactd.api import connection_limit
from impactd.api.arrivals import NEVER, Arrivals
from impactd.api.connection import connection_class
from impactd.api.connection_limit import Connections
from impactd.server import listen

from .conftest import until

MOST = 6
RECEIVE_LIMIT_S = 0.5


class SmallServer:
    """Uvicorn with our connections; answers the epoch of each request's arrival."""

    def __init__(self) -> None:
        self.epoch = AbortEpoch()
        self.arrivals = Arrivals(self.epoch)
        self.connections = Connections(MOST, RECEIVE_LIMIT_S)
        self.held = threading.Event()
        self.server = uvicorn.Server(
            uvicorn.Config(
                self.answer,
                http=connection_class(self.arrivals, self.connections),
                loop="asyncio",
                lifespan="off",
                interface="asgi3",
                log_config=None,
                timeout_keep_alive=60,
                timeout_graceful_shutdown=1,
            )
        )
        listener = listen("127.0.0.1", 0)
        self.address = listener.getsockname()
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [listener]})
        self.thread.start()
        until(lambda: self.server.started, bool)

    async def answer(self, scope, receive, send) -> None:
        """Answer at once, or as a stream, or when `held` is set."""
        self.arrivals.serve_on(asyncio.get_running_loop())
        while scope["path"] == "/held" and not self.held.is_set():
            await asyncio.sleep(0.01)
        if scope["path"] == "/caller":
            scope["state"]["caller_name"] = "ab"
        stream = scope["path"] in ("/caller", "/stream")
        body = str(scope["state"]["abort_epoch"]).encode()
        length = [] if stream else [(b"content-length", str(len(body)).encode())]
        if scope["path"] == "/v1/abort":
            await asyncio.sleep(1.0)
        if scope["method"] == "PUT":
            while (await receive()).get("more_body"):
                continue
        await send({"type": "http.response.start", "status": 200, "headers": length})
        await send({"type": "http.response.body", "body": body, "more_body": stream})
        while stream and (await receive())["type"] != "http.disconnect":
            continue

    def open(self, said: bytes = b"") -> socket.socket:
        """Return a connection on which something was said; the server has taken it in."""
        client = socket.create_connection(self.address, timeout=30)
        client.sendall(said)
        return client

    def close(self) -> None:
        """End it."""
        self.held.set()
        self.server.should_exit = True
        self.thread.join(30)
        assert not self.thread.is_alive()


def _request(path: str, method: str = "GET", more: str = "") -> bytes:
    return f"{method} {path} HTTP/1.1\r\nHost: x\r\n{more}\r\n".encode()


def _answer(client: socket.socket) -> bytes:
    """Return the body of one answer of a length."""
    said = b""
    while b"\r\n\r\n" not in said:
        said += client.recv(1)
    head = said.decode().lower()
    assert head.startswith("http/1.1 200"), head
    return client.recv(int(head.partition("content-length: ")[2].split()[0]))


def _is_closed(client: socket.socket) -> bool:
    """Return whether the other side closed; reads what was said before."""
    client.setblocking(False)
    try:
        while client.recv(65536):
            pass
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True
    finally:
        client.settimeout(30)
    return True


@pytest.fixture
def small() -> Iterator[SmallServer]:
    """A server for six connections."""
    server = SmallServer()
    try:
        yield server
    finally:
        server.close()


def test_half_requests_keep_nobody_out(small):
    """Ten times as many half headers as there may be connections: the next request is answered."""
    with contextlib.ExitStack() as held:
        half = [held.enter_context(small.open(b"GET / HTTP/1.1\r\nHost: x")) for _ in range(60)]
        whole = held.enter_context(small.open(_request("/")))
        assert _answer(whole) == b"1"
        until(lambda: [_is_closed(one) for one in half].count(False), lambda left: left < MOST)
        assert all(_is_closed(one) for one in half[: 60 - MOST])
        assert not _is_closed(whole)


def test_the_least_worth_makes_room_first(small):
    """Half headers, then half bodies, then idle ones, then strangers' answers, then callers'."""
    with contextlib.ExitStack() as held:

        def opened(said: bytes) -> socket.socket:
            client = held.enter_context(small.open(said))
            small.open(_request("/")).close()  # read after it, so it was read too
            time.sleep(0.02)
            return client

        caller = opened(_request("/caller"))
        stranger = opened(_request("/stream"))
        idle = opened(_request("/"))
        body = opened(_request("/", "PUT", "Content-Length: 9\r\n"))
        header = opened(b"GET /")
        crowd = []
        for victim, kept in (
            (header, (body, idle, stranger, caller)),
            (body, (idle, stranger, caller)),
            (idle, (stranger, caller)),
            (stranger, (caller,)),
        ):
            while not _is_closed(victim):
                # Answers to callers: nothing that is newer makes room before the victim.
                crowd.append(held.enter_context(small.open(_request("/caller"))))
                time.sleep(0.02)
                assert len(crowd) < 3 * MOST
            assert not any(_is_closed(one) for one in kept)


def test_an_abort_never_makes_room(small):
    """An abort that is being carried out stays, whoever comes meanwhile."""
    with contextlib.ExitStack() as held:
        abort = held.enter_context(small.open(_request("/v1/abort", "POST")))
        time.sleep(0.1)
        for _ in range(4 * MOST):
            held.enter_context(small.open(_request("/caller")))
        assert _answer(abort) == b"1"


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"GET / HTTP/1.1\r\nHo",
        _request("/", "PUT", "Content-Length: 99999\r\n"),
        _request("/") + b"GET",
    ],
    ids=["nothing", "half a header", "half a body", "half a second header"],
)
def test_a_slow_request_is_closed(small, said):
    """The limit holds from the first byte to the last, however often another byte comes."""
    with small.open(said) as slow:

        def drip() -> bool:
            with contextlib.suppress(OSError):
                slow.send(b"x")
            return _is_closed(slow)

        until(drip, bool, 20)


def test_a_large_body_may_last_while_it_flows(small):
    """A file over a poor link takes longer than the limit, and is no slow request."""
    part, parts = b"x" * 250_000, 20
    head = _request("/", "PUT", f"Content-Length: {len(part) * parts}\r\n")
    with small.open(head) as upload:
        for _ in range(parts):
            upload.sendall(part)
            time.sleep(0.1)
        assert _answer(upload)


def test_a_stream_may_last(small):
    """Whoever reads events is no slow request."""
    with small.open(_request("/stream")) as stream:
        time.sleep(3 * RECEIVE_LIMIT_S)
        assert not _is_closed(stream)


def test_a_request_carries_the_epoch_of_its_arrival(small):
    """An abort between two requests of one connection counts for the second only."""
    with small.open(_request("/")) as client:
        assert _answer(client) == b"1"
        small.epoch.advance("cd")
        client.sendall(_request("/"))
        assert _answer(client) == b"2"


def test_a_pipelined_request_is_never_newer_than_its_arrival(small):
    """Sent behind another one, read after an abort: its stamp is older than the abort."""
    with small.open(_request("/held") + _request("/")) as client:
        time.sleep(0.1)
        client.sendall(
            _request("/")
        )  # stays in the kernel: nobody reads a connection that pipelines
        small.epoch.advance("cd")
        small.held.set()
        assert [_answer(client) for _ in range(3)] == [b"1", b"1", b"1"]


def test_what_is_read_while_an_abort_is_answered_is_older_than_it(small):
    """From the abort's beginning until the loop has read everything, each stamp is void."""
    with small.open(_request("/")) as client:
        assert _answer(client) == b"1"
        small.arrivals.begin()
        small.epoch.advance("cd")
        client.sendall(_request("/"))
        assert _answer(client) == str(NEVER).encode()
        assert small.arrivals.settle_from_thread(30)
        client.sendall(_request("/"))
        assert _answer(client) == b"2"


def test_a_loop_that_is_stuck_reads_old_requests_only(small):
    """An abort is answered while the loop hangs; what the loop reads then is void."""
    with small.open(_request("/")) as client:
        assert _answer(client) == b"1"
        go_on = threading.Event()
        loop = small.arrivals._loop
        loop.call_soon_threadsafe(go_on.wait, 30)
        client.sendall(_request("/"))
        small.arrivals.begin()
        small.epoch.advance("cd")
        assert not small.arrivals.settle_from_thread(0.05)
        go_on.set()
        assert _answer(client) == str(NEVER).encode()
        until(small.arrivals.stamp, lambda stamp: stamp == 2)


def test_what_strangers_send_fills_no_log(small, caplog, monkeypatch):
    """Hundreds of malformed requests and closed connections are one line, with their number."""
    monkeypatch.setattr(connection_limit, "_SWEEP_EVERY_S", 0.05)
    with caplog.at_level(logging.WARNING), structlog.testing.capture_logs() as lines:
        for _ in range(200):
            with small.open(b"no http\r\n\r\n") as client:
                assert client.recv(100).startswith(b"HTTP/1.1 400")
        until(lambda: len(lines), bool)
        time.sleep(0.3)
    assert not caplog.records
    assert [line["event"] for line in lines] == ["connections closed"]
    assert lines[0]["malformed"] >= 1


@pytest.mark.parametrize("soft", [64, 256, 1024, 524288])
def test_there_is_a_descriptor_for_everything_else(soft):
    """However many descriptors there are, a device that is opened again gets one select() knows."""
    most = connection_limit.most_connections(soft)
    assert most >= 16
    assert most + connection_limit._IN_TRANSIT + connection_limit._RESERVED <= max(soft, 464)
    assert most + connection_limit._IN_TRANSIT + connection_limit._RESERVED < 1024
