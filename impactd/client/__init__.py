"""A rig from Python: `Rig` and `AsyncRig`, their errors, and the units of a drop height."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from impactd.client.errors import (
    AbortedError,
    EndedError,
    InvalidError,
    LostError,
    NotFoundError,
    NotReadyError,
    ProblemError,
    RigError,
    TokenError,
    UnreachableError,
)
from impactd.client.units import cm, m, mm

if TYPE_CHECKING:
    from impactd.client.async_rig import AsyncRig
    from impactd.client.rig import Rig

__all__ = [
    "AbortedError",
    "AsyncRig",
    "EndedError",
    "InvalidError",
    "LostError",
    "NotFoundError",
    "NotReadyError",
    "ProblemError",
    "Rig",
    "RigError",
    "TokenError",
    "UnreachableError",
    "cm",
    "m",
    "mm",
]
_LATE = {"AsyncRig": "impactd.client.async_rig", "Rig": "impactd.client.rig"}


def __getattr__(name: str) -> Any:
    """Import the rigs when they are asked for: a command without one need not load pydantic."""
    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
