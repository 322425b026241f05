"""Sessions of the web page: a cookie in place of a token, for one browser and some hours.

A page must not keep a token where scripts can read it. It shows the token once and gets a cookie
that no script reads (HttpOnly) and no other site sends (SameSite=Strict). Because a browser sends
cookies by itself, everything that writes needs a second secret in a header of its own, which only
the page knows.

Sessions outlive a restart of the daemon: a technician must not look for a token because of an
update. They end with their time, with a log-out, and at once when their token is revoked or
expires. The file holds no secret: of each cookie its SHA-256, and the second secret follows from
the cookie.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import structlog

from impactd.storage.errors import ArchiveError
from impactd.storage.publish import publish
from impactd.storage.tokens import Token

_log = structlog.get_logger("impactd.api")
COOKIE = "impactd_session"
SESSIONS_NAME = "sessions.json"
CSRF_HEADER = "X-CSRF-Token"
LIFE_S = 12 * 3600.0
# Page, tablet and telephone of one person, with as many left from before.
_MOST_PER_TOKEN = 8


@dataclass(frozen=True)
class Session:
    """One browser that has shown a token."""

    token_id: int
    csrf: str
    """What its writes must carry in the header `CSRF_HEADER`."""
    ends_s: float
    """Seconds since 1970: it holds over a restart. [s]"""


@dataclass(frozen=True)
class _Kept:
    """What is kept of a session."""

    token_id: int
    ends_s: float


class Sessions:
    """All sessions, by the hash of their cookie; one too many of a token ends its oldest.

    Without a ``file`` they do not outlive a restart.
    """

    def __init__(self, file: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._file = file
        self._by_hash: dict[str, _Kept] = {} if file is None else _read(file)

    def begin(self, token: Token) -> tuple[Session, str]:
        """Begin a session; return it and the cookie's secret, which is not kept."""
        secret = secrets.token_urlsafe(32)
        session = Session(token.id, _csrf(secret), time.time() + LIFE_S)
        with self._lock:
            of_token = [key for key, one in self._by_hash.items() if one.token_id == token.id]
            for key in of_token[: len(of_token) - _MOST_PER_TOKEN + 1]:
                del self._by_hash[key]
            self._by_hash[_hash(secret)] = _Kept(session.token_id, session.ends_s)
            self._keep()
        return session, secret

    def find(self, secret: str) -> Session | None:
        """Return the session of a cookie, ``None`` when it is unknown or over."""
        key = _hash(secret)
        with self._lock:
            kept = self._by_hash.get(key)
            if kept is None:
                return None
            if time.time() >= kept.ends_s:
                del self._by_hash[key]
                return None
            return Session(kept.token_id, _csrf(secret), kept.ends_s)

    def end(self, secret: str) -> None:
        """End a session; do nothing when it is over."""
        with self._lock:
            self._by_hash.pop(_hash(secret), None)
            self._keep()

    def _keep(self) -> None:
        """Write what outlives a restart; without it a session only ends with the daemon."""
        if self._file is None:
            return
        now = time.time()
        kept = {key: asdict(one) for key, one in self._by_hash.items() if one.ends_s > now}
        try:
            publish(self._file, json.dumps(kept).encode(), replace=True)
        except ArchiveError as error:
            _log.warning("sessions will not outlive a restart", why=error.what)


def _read(file: Path) -> dict[str, _Kept]:
    """Return the sessions of a file, none of a damaged one: people sign in again."""
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        return {
            str(key): _Kept(int(one["token_id"]), float(one["ends_s"])) for key, one in said.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def csrf_holds(session: Session, given: str | None) -> bool:
    """Return whether a write carries its session's second secret."""
    return given is not None and hmac.compare_digest(
        given.encode("utf-8", "replace"), session.csrf.encode()
    )


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


def _csrf(secret: str) -> str:
    """Return a session's second secret: only who has the cookie can know it."""
    return hmac.new(secret.encode("utf-8", "replace"), b"csrf", hashlib.sha256).hexdigest()
