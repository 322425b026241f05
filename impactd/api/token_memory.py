"""The tokens in memory, so that an abort waits for no disk.

Every other request asks the database each time. An abort asks here first; the answer is at most
`REFRESH_S` old while the database answers, and stays as it was while it does not.
"""

from __future__ import annotations

import hashlib
import threading

import structlog

from impactd.storage.timestamp import utc_now
from impactd.storage.tokens import Token, TokenTable

REFRESH_S = 2.0
_log = structlog.get_logger("impactd.api")


class TokenMemory:
    """The last reading of the table of tokens. Thread safe."""

    def __init__(self, table: TokenTable) -> None:
        self._table = table
        self._by_hash: dict[str, Token] = {}
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._refresh()

    def start(self) -> None:
        """Read the table again every `REFRESH_S` from now on."""
        self._thread = threading.Thread(target=self._go_on, name="tokens", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop reading the table; a read that waits for the disk is not waited for."""
        self._end.set()

    def check(self, secret: str) -> Token | None:
        """Return the token of a secret, ``None`` when it is unknown, expired or revoked.

        The database is asked only for a secret that is not known here.
        """
        found = self._by_hash.get(hashlib.sha256(secret.encode()).hexdigest())
        return self.ask(secret) if found is None else _if_valid(found)

    def valid(self, number: int) -> Token | None:
        """Return a token by its number, as `check` does by its secret."""
        for token in tuple(self._by_hash.values()):
            if token.id == number:
                return _if_valid(token)
        return self._table.valid(number)

    def ask(self, secret: str) -> Token | None:
        """Return the token of a secret as the database has it now, and remember it."""
        found = self._table.check(secret)
        if found is not None:
            # A whole new dictionary each time: reading needs no lock.
            key = hashlib.sha256(secret.encode()).hexdigest()
            self._by_hash = {**self._by_hash, key: found}
        return found

    def _refresh(self) -> None:
        self._by_hash = self._table.by_hash()

    def _go_on(self) -> None:
        while not self._end.wait(REFRESH_S):
            try:
                self._refresh()
            except Exception as error:  # the disk is the trouble; what is known stays known
                if not self._end.is_set():
                    _log.warning("the tokens could not be read again", why=str(error))


def _if_valid(token: Token) -> Token | None:
    if token.revoked_utc is not None:
        return None
    return token if token.expires_utc is None or token.expires_utc > utc_now() else None
