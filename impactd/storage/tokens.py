"""The table of bearer tokens: opaque, shown once, stored as hashes."""

from __future__ import annotations

import hashlib
import secrets
import sqlite3
from dataclasses import dataclass

from impactd.storage.errors import ArchiveError, NotFoundError
from impactd.storage.index import Index
from impactd.storage.timestamp import utc_after, utc_now

SCOPES = ("read", "operate", "admin")
"""Each scope holds the ones before it."""
_LONGEST_LIFE_D = 36525
"""A century; a calendar has no moment for much longer ones. [d]"""


@dataclass(frozen=True)
class Token:
    """What is known of a token; never the secret."""

    id: int
    name: str
    """Whose it is; also the owner of the drops it asks for."""
    scope: str
    """``read``, ``operate`` or ``admin``."""
    created_utc: str
    expires_utc: str | None
    revoked_utc: str | None

    def allows(self, scope: str) -> bool:
        """Return whether the token's scope holds another one."""
        return SCOPES.index(scope) <= SCOPES.index(self.scope)


class TokenTable:
    """The table of tokens."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def create(
        self, name: str, scope: str = "operate", days: float | None = None
    ) -> tuple[Token, str]:
        """Make a token; return it and its secret, which nobody can read again.

        It lives for ``days`` (> 0), without them until it is revoked. Raises ArchiveError if the
        scope is unknown, or the life is not positive or longer than a century.
        """
        if scope not in SCOPES:
            raise ArchiveError(f"The scope {scope!r} is unknown; there are {', '.join(SCOPES)}.")
        if days is not None and not 0 < days <= _LONGEST_LIFE_D:
            raise ArchiveError(
                f"A token lives for more than 0 and at most {_LONGEST_LIFE_D} days, not {days:g}.",
                remedy="Say no days for one that lives until it is revoked.",
            )
        # A plain SHA-256 is enough for 256 random bits: there is nothing to guess.
        secret = "impactd_" + secrets.token_urlsafe(32)
        number = self._index.write(
            "INSERT INTO tokens (name, scope, secret_sha256, created_utc, expires_utc) "
            "VALUES (?, ?, ?, ?, ?)",
            (name, scope, _hash(secret), utc_now(), None if days is None else utc_after(days)),
        )
        return self._get(number), secret

    def check(self, secret: str) -> Token | None:
        """Return the token of a secret, ``None`` when it is unknown, expired or revoked."""
        rows = self._index.token_rows(
            "SELECT * FROM tokens WHERE secret_sha256=? AND revoked_utc IS NULL "
            "AND (expires_utc IS NULL OR expires_utc > ?)",
            (_hash(secret), utc_now()),
        )
        return _token_of(rows[0]) if rows else None

    def valid(self, number: int) -> Token | None:
        """Return a token by its number, ``None`` when it is unknown, expired or revoked."""
        rows = self._index.token_rows(
            "SELECT * FROM tokens WHERE id=? AND revoked_utc IS NULL "
            "AND (expires_utc IS NULL OR expires_utc > ?)",
            (number, utc_now()),
        )
        return _token_of(rows[0]) if rows else None

    def by_hash(self) -> dict[str, Token]:
        """Return the tokens that are not revoked, by the SHA-256 of their secrets."""
        rows = self._index.rows("SELECT * FROM tokens WHERE revoked_utc IS NULL")
        return {row["secret_sha256"]: _token_of(row) for row in rows}

    def list(self) -> list[Token]:
        """Return all tokens, oldest first."""
        return [_token_of(row) for row in self._index.rows("SELECT * FROM tokens ORDER BY id")]

    def revoke(self, number: int) -> Token:
        """Revoke a token; it stays on the list. Raise NotFoundError."""
        self._index.write(
            "UPDATE tokens SET revoked_utc=coalesce(revoked_utc, ?) WHERE id=?",
            (utc_now(), number),
        )
        return self._get(number)

    def _get(self, number: int) -> Token:
        row = self._index.row("SELECT * FROM tokens WHERE id=?", (number,))
        if row is None:
            raise NotFoundError("token", number)
        return _token_of(row)


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _token_of(row: sqlite3.Row) -> Token:
    return Token(
        id=row["id"],
        name=row["name"],
        scope=row["scope"],
        created_utc=row["created_utc"],
        expires_utc=row["expires_utc"],
        revoked_utc=row["revoked_utc"],
    )
