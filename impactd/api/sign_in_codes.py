"""Sign-in codes: eight characters from a terminal begin a session, once, in place of a token.

A code is short, because a person types it. These numbers make guessing hopeless:

- Eight of 30 characters are 6.6e11 codes (39 bits), drawn by `secrets`.
- A code is valid for five minutes and once. A token has one code at a time: a new one replaces it.
- Of wrong codes, 5 a minute are read from one address and 30 a minute in all
  (`impactd.api.guess_limit`). So at most 180 guesses meet a code in its five minutes, which touch
  six counted minutes.
- With codes of ten tokens valid at once, 180 guesses find one with a probability of 2.7e-9. A year
  of guesses against ten codes that are always valid finds one with a probability of 2.4e-4.

Codes are held in memory only, as SHA-256; a restart ends them. A code has the rights of the token
that made it, because its session is a session of that token.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

ALPHABET = "23456789ABCDEFGHJKMNPQRSTVWXYZ"
"""Digits and capitals without 0 and O, 1, I and L, and U, which looks like V."""
LIFE_S = 300.0
"""How long a code is valid, a choice: a walk from a terminal to a tablet. The numbers above are for
it. [s]"""
_GROUP = 4
_LENGTH = 2 * _GROUP


@dataclass(frozen=True)
class _Kept:
    """What is kept of a code."""

    digest: bytes
    ends_s: float


class SignInCodes:
    """The codes that are valid now, one per token at most. Thread safe."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._by_token: dict[int, _Kept] = {}

    def make(self, token_id: int) -> str:
        """Return a new code of a token, as two groups; the token's last code ends."""
        code = "".join(secrets.choice(ALPHABET) for _ in range(_LENGTH))
        with self._lock:
            self._by_token[token_id] = _Kept(_digest(code), self._now_s() + LIFE_S)
        return f"{code[:_GROUP]}-{code[_GROUP:]}"

    def take(self, typed: str) -> int | None:
        """Use up a code; return the number of its token, ``None`` when no valid code is like it.

        Case, spaces and hyphens do not count.
        """
        digest, now_s = _digest(_plain(typed)), self._now_s()
        with self._lock:
            valid = {number: one for number, one in self._by_token.items() if one.ends_s > now_s}
            # All are compared, each in constant time: the answer's time says nothing of a code.
            same = [
                number for number, one in valid.items() if hmac.compare_digest(one.digest, digest)
            ]
            for number in same:
                del valid[number]
            self._by_token = valid
        return same[0] if same else None


def _plain(typed: str) -> str:
    return "".join(typed.replace("-", " ").split()).upper()


def _digest(code: str) -> bytes:
    return hashlib.sha256(code.encode("utf-8", "replace")).digest()
