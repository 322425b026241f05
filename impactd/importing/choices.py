"""What a person says about recordings beforehand, and what is asked when nothing was said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

ALL = "all"


@dataclass(frozen=True)
class Choices:
    """The options of ``impactd new``.

    Attributes
    ----------
    rate_hz : float or None
        Counts instead of the file's. [Hz]
    unit : str or None
        Counts instead of the file's.
    columns : tuple of str
        Names or numbers from 1; ``all`` means every one. Empty means the first.
    scale : float
        One of the file's numbers in ``unit``.
    time_unit : str or None
        ``s``, ``ms``, ``us`` or ``ns``; counts instead of the file's.
    threshold : float or None
        Excursion that counts as a hit, in the file's own numbers times ``scale``.
    """

    rate_hz: float | None = None
    unit: str | None = None
    columns: tuple[str, ...] = ()
    scale: float = 1.0
    time_unit: str | None = None
    threshold: float | None = None


Ask = Callable[[str, Sequence[str], str], str]
"""Question, possible answers (empty: anything), proposal; returns the answer."""


def propose(question: str, answers: Sequence[str], proposal: str) -> str:
    """Return the proposal: nobody is there to be asked."""
    del question, answers
    return proposal
