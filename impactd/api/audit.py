"""The audit log: every write is kept as an event, with the name of its token.

It is written after the answer has gone out, so that nobody, least of all an abort, waits for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import structlog
from starlette.types import Scope

REQUEST = "request"
"""Kind of the events that are written here."""
WRITES = frozenset({"POST", "PUT", "PATCH", "DELETE"})

_log = structlog.get_logger("impactd.api")


@dataclass(frozen=True)
class Written:
    """A write that was answered."""

    scope: Scope
    """`impactd.api.security.authorize` left the caller's name in its state."""
    status: int
    location: str | None
    """Where the answer says the work can be watched."""


class Audit:
    """Publishes the writes of known callers; ``publish`` gets kind and data of an event."""

    def __init__(self, publish: Callable[[str, dict[str, Any]], None]) -> None:
        self._publish = publish

    def record(self, written: Written) -> None:
        """Keep a write; one without a known caller is left out, as it changed nothing."""
        by = written.scope["state"].get("caller_name")
        if by is None:
            return
        told = {
            "by": by,
            "method": written.scope["method"],
            "path": written.scope["path"],
            "status": written.status,
            "location": written.location,
        }
        try:
            self._publish(REQUEST, told)
        except Exception:  # a disk that is full must not make of an answer a failure
            _log.warning("a request could not be kept", **told)
