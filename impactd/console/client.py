"""The daemon that a command talks to."""

from __future__ import annotations

from impactd.client.connection import Connection
from impactd.client.environment import address, token_from_environment


def connect(url: str | None) -> Connection:
    """Return a connection to an address, with the token of the environment."""
    return Connection(address(url), token_from_environment())
