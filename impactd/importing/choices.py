"""The options that a person states about recordings, and the questions about the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ALL = "all"


@dataclass(frozen=True)
class Choices:
    """The options of ``impactd new``."""

    rate_hz: float | None = None
    """Counts instead of the file's. [Hz]"""
    unit: str | None = None
    """Counts instead of the file's."""
    columns: tuple[str, ...] = ()
    """Names or numbers from 1; ``all`` means every one. Empty means the first."""
    scale: float = 1.0
    """One of the file's numbers in ``unit``."""
    time_unit: str | None = None
    """``s``, ``ms``, ``us`` or ``ns``; counts instead of the file's."""
    values: Path | None = None
    """A JSON file of what a person measured."""
    drops: Path | None = None
    """A table of which recording is which drop."""
    threshold: float | None = None
    """Excursion that counts as a hit, in the file's own numbers times ``scale``."""


Ask = Callable[[str, Sequence[str], str], str]
"""Question, possible answers (empty: anything), proposal; returns the answer."""


def propose(question: str, answers: Sequence[str], proposal: str) -> str:
    """Return the proposal, without asking a person."""
    del question, answers
    return proposal
