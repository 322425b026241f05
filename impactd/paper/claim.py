"""A claim of the paper beside our number."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

HOLDS, NEARLY, FAILS, SLIP = "holds", "nearly", "does not hold", "slip"
NO_CLAIM = "no claim"


@dataclass(frozen=True)
class Claim:
    """One claim and our number.

    Attributes
    ----------
    key : str
        How tests and JSON call it.
    where : str
        Figure, table or equation.
    says : str
        What is claimed, shortly.
    claimed, ours : str
        As people read them.
    verdict : str
        ``holds``, ``nearly`` (but for a corner), ``does not hold``, ``slip`` or ``no claim``.
    values : dict
        Ours, unrounded, SI.
    note : str
        Why, where it needs saying.
    """

    key: str
    where: str
    says: str
    claimed: str
    ours: str
    verdict: str
    values: dict[str, float] = field(default_factory=dict)
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return dataclasses.asdict(self)
