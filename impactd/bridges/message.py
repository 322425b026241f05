"""An event and the light as JSON that leaves the daemon; see `impactd schema event`."""

from __future__ import annotations

import json
from typing import Any

from impactd.client.events import Event
from impactd.wire.rig_answers import StatusAnswer


def event_json(event: Event) -> bytes:
    """Return an event as a message."""
    return _bytes({"id": event.id, "kind": event.kind, "utc": event.utc, "data": dict(event.data)})


def status_json(status: StatusAnswer) -> bytes:
    """Return the light as a message: what says something to people who see no page."""
    return _bytes({
        "ready": status.ready,
        "sentence": status.sentence,
        "state": status.state,
        "owner": status.owner,
        "drop": status.drop,
    })  # fmt: skip


def _bytes(message: dict[str, Any]) -> bytes:
    return json.dumps(message, ensure_ascii=False, allow_nan=False).encode()
