"""Idempotency keys as they are stored: each client has its own, and so has the daemon itself.

::

    token 3 K                the drop that the client of token 3 asked for under its key K
    token 3 fit K            its fit, which is another request: jobs, calibrations name their kind
    calibration 1-1-0        a drop that a calibration run asked for

Older archives hold the client's key as it came. A repeated request still finds it there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

CALIBRATION = "calibration"
"""Namespace of the drops that a calibration run asks for."""
_TOKEN = re.compile(r"token (\d+) (.+)", re.DOTALL)
_TOKEN_AND_KIND = re.compile(r"token (\d+) [a-z_]+ (.+)", re.DOTALL)
_NOT_BARE = re.compile(r"token \d+ |calibration[ -]")
"""A namespace, or how keys of calibration runs began before they had one: no client's bare key."""


@dataclass(frozen=True)
class RequestKey:
    """An idempotency key and whose it is."""

    namespace: str
    """``token 3``; ``token 3 fit`` where drops are not what is asked for; ``calibration``."""
    key: str
    """The client's own part."""

    @property
    def text(self) -> str:
        """Return how it is stored."""
        return f"{self.namespace} {self.key}"


@dataclass(frozen=True)
class BareKey:
    """What an older program stored for a token's key: the key as it came."""

    token: int
    key: str


def bare_key(text: str, *, has_kind: bool = False) -> BareKey | None:
    """Return what an older program would have stored for a key.

    ``None`` where only the daemon, or another token, can have stored it so. ``has_kind`` says
    whether the namespace names a kind behind the token, as for jobs and calibrations.
    """
    found = (_TOKEN_AND_KIND if has_kind else _TOKEN).fullmatch(text)
    if found is None or _NOT_BARE.match(found[2]):
        return None
    return BareKey(int(found[1]), found[2])


def client_part(text: str | None) -> str | None:
    """Return the part of a drop's stored key that its client sent.

    That is the whole text where it has no namespace of a token.
    """
    found = _TOKEN.fullmatch(text or "")
    return found[2] if found else text
