"""How work is spread over cores: here over one.

A program may hand a diagnosis the others as well, see `impactd.diagnosis.processes`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")


class Cores(Protocol):
    """Does work on some cores; it must change nothing that anybody else looks at."""

    @property
    def count(self) -> int:
        """How many there are for this process."""
        ...

    def each(
        self, work: Callable[[T], R], pieces: Sequence[T], shared: Sequence[object]
    ) -> Iterator[R]:
        """Yield what the work makes of each piece, in their order.

        ``shared`` are objects that are there before the work and may be in what it makes.
        """
        ...

    def team(
        self, work: Callable[[int, int, T], R]
    ) -> AbstractContextManager[Callable[[T], list[R]]]:
        """Return a team that does its parts of some work whenever it is asked.

        Each member calls ``work(member, members, question)`` and keeps what it has; asked, the team
        answers with what all members make of a question, in their order.
        """
        ...


class OneCore:
    """One piece after the other."""

    count = 1

    def each(
        self, work: Callable[[T], R], pieces: Sequence[T], shared: Sequence[object]
    ) -> Iterator[R]:
        """Yield what the work makes of each piece once it is asked for."""
        del shared
        return map(work, pieces)

    def team(
        self, work: Callable[[int, int, T], R]
    ) -> AbstractContextManager[Callable[[T], list[R]]]:
        """Return a team of one."""
        return contextlib.nullcontext(lambda question: [work(0, 1, question)])


ONE_CORE = OneCore()
