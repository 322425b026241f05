"""Idempotency keys: each belongs to a namespace, so that nobody's key meets another one's."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RequestKey:
    """A key and whose it is.

    Attributes
    ----------
    namespace : str
        ``token 3``, or ``calibration`` for the drops of a series.
    key : str
        The client's own part.
    """

    namespace: str
    key: str

    @property
    def text(self) -> str:
        """Return the form that is stored."""
        return f"{self.namespace} {self.key}"
