"""One HTTP connection: stamps requests on arrival and enforces `connection_limit`."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any

import h11
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from impactd.api.arrivals import Arrivals
from impactd.api.connection_limit import (
    ANSWERS_CALLER,
    ANSWERS_STRANGER,
    IDLE,
    LEAST_BYTES_PER_S,
    UNFINISHED_BODY,
    UNFINISHED_HEADER,
    Connections,
)

# What the protocol warns of, anybody can make it say as often as he likes; it is counted instead.
_log = logging.getLogger("uvicorn.error.connection")
_log.setLevel(logging.ERROR)


class Connection(H11Protocol):
    """Uvicorn's connection with stamps and limits; `connection_class` binds the class attributes.

    ``receiving_since_s`` is the first byte of a request that is not complete, on the monotonic
    clock; the connection's beginning before its first request. It is later by what arrived.
    """

    arrivals: Arrivals
    kept: Connections

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        # A copy: the stamp is this connection's own.
        super().__init__(config, server_state, dict(app_state), _loop)
        self.logger = _log
        self.receiving_since_s: float | None = time.monotonic()
        self._pipelines = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count for the limits from now on."""
        super().connection_made(transport)
        self.kept.add(self, self.loop)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count for the limits no longer."""
        self.kept.discard(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Stamp what begins with these bytes, then read them."""
        # Behind a request that is still being answered nobody knows when the next one arrived: the
        # kernel may keep it while nobody reads. Such a connection keeps its first stamp for good.
        if not self._pipelines:
            self.app_state["abort_epoch"] = self.arrivals.stamp()
            self.app_state["received_s"] = time.monotonic()
        super().data_received(data)
        self._look_at_progress()
        if self.receiving_since_s is not None:
            later_s = self.receiving_since_s + len(data) / LEAST_BYTES_PER_S
            self.receiving_since_s = min(later_s, time.monotonic())

    def on_response_complete(self) -> None:
        """Check whether the next request has begun already."""
        super().on_response_complete()
        self._look_at_progress()

    def send_400_response(self, msg: str) -> None:
        """Count input that is not HTTP, instead of logging each line."""
        self.kept.count("malformed")
        super().send_400_response(msg)

    def rank(self) -> int | None:
        """Return what the connection is doing; ``None`` for an abort, which is never closed."""
        if self._is_answering():
            scope = self.cycle.scope
            if _is_abort(scope["method"], scope["path"]) and not self.cycle.response_started:
                return None
            if self.receiving_since_s is not None:
                return UNFINISHED_BODY
            known = "caller_name" in scope["state"]  # left by impactd.api.security.authorize
            return ANSWERS_CALLER if known else ANSWERS_STRANGER
        if self.receiving_since_s is None:
            return IDLE
        return UNFINISHED_BODY if self.conn.their_state is h11.SEND_BODY else UNFINISHED_HEADER

    def close_now(self) -> None:
        """Close without an answer."""
        self.transport.abort()

    def _is_answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _look_at_progress(self) -> None:
        their, waiting = self.conn.their_state, bool(self.conn.trailing_data[0])
        if waiting and their is h11.DONE and self._is_answering():
            self._pipelines = True
        begun = waiting or self.cycle is None
        if their is h11.SEND_BODY or (their is h11.IDLE and begun):
            if self.receiving_since_s is None:
                self.receiving_since_s = time.monotonic()
        else:
            self.receiving_since_s = None


def connection_class(arrivals: Arrivals, connections: Connections) -> type[Connection]:
    """Return the class that uvicorn makes connections of, for one server."""
    return type("BoundConnection", (Connection,), {"arrivals": arrivals, "kept": connections})


def _is_abort(method: str, path: str) -> bool:
    if method == "POST":
        return path == "/v1/abort"
    return method == "DELETE" and path.startswith("/v1/drops/")
