"""Sessions of the web page: a cookie in place of a token, for one browser and some hours.

A page must not keep a token where scripts can read it. It shows the token once and gets a cookie
that no script reads (HttpOnly) and no other site sends (SameSite=Strict). Because a browser sends
cookies by itself, everything that writes needs a second secret in a header of its own, which only
the page knows.

Sessions live in memory: they end with the daemon, with their time, with a log-out, and at once
when their token is revoked or expires.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from dataclasses import dataclass

from impactd.storage.tokens import Token

COOKIE = "impactd_session"
CSRF_HEADER = "X-CSRF-Token"
LIFE_S = 12 * 3600.0
# Page, tablet and telephone of one person, with as many left from before.
_MOST_PER_TOKEN = 8


@dataclass(frozen=True)
class Session:
    """One browser that has shown a token.

    Attributes
    ----------
    token_id : int
        The token it stands for.
    csrf : str
        What its writes must carry in the header `CSRF_HEADER`.
    ends_s : float
        On the monotonic clock. [s]
    """

    token_id: int
    csrf: str
    ends_s: float


class Sessions:
    """All sessions, by the hash of their cookie; the oldest of a token makes room for its next."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_hash: dict[str, Session] = {}

    def begin(self, token: Token) -> tuple[Session, str]:
        """Begin a session.

        Parameters
        ----------
        token : Token
            Which was shown.

        Returns
        -------
        tuple of Session and str
            The session, and the cookie's secret, which is not kept.
        """
        secret = secrets.token_urlsafe(32)
        session = Session(token.id, secrets.token_urlsafe(32), time.monotonic() + LIFE_S)
        with self._lock:
            of_token = [key for key, one in self._by_hash.items() if one.token_id == token.id]
            for key in of_token[: len(of_token) - _MOST_PER_TOKEN + 1]:
                del self._by_hash[key]
            self._by_hash[_hash(secret)] = session
        return session, secret

    def find(self, secret: str) -> Session | None:
        """Return the session of a cookie, ``None`` when it is unknown or over."""
        key = _hash(secret)
        with self._lock:
            session = self._by_hash.get(key)
            if session is not None and time.monotonic() >= session.ends_s:
                session = self._by_hash.pop(key) and None
            return session

    def end(self, secret: str) -> None:
        """End a session; do nothing when it is over."""
        with self._lock:
            self._by_hash.pop(_hash(secret), None)


def csrf_holds(session: Session, given: str | None) -> bool:
    """Return whether a write carries its session's second secret."""
    return given is not None and hmac.compare_digest(
        given.encode("utf-8", "replace"), session.csrf.encode()
    )


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()
