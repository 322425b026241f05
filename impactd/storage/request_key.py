"""A key of whoever uses it: the same words of two clients are two keys."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RequestKey:
    """An idempotency key within a namespace.

    Attributes
    ----------
    namespace : str
        Whose, e.g. ``token 3`` or ``token 3 fit``.
    key : str
        As the client sent it.
    """

    namespace: str
    key: str

    @property
    def text(self) -> str:
        """As it is stored."""
        return f"{self.namespace} {self.key}"
