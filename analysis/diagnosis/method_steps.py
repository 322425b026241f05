"""The nine steps of METHOD.md by name, as whoever waits for a diagnosis reads them."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

Progress = Callable[[str, float], None]
"""Told what is being done and a share between 0 and 1."""


class MethodStep(Enum):
    """A step of METHOD.md, under the title that it has there."""

    NOISE = "Noise"
    BASE_FIT = "Base fit"
    STRUCTURE = "Is there structure?"
    CANDIDATES = "Candidates"
    COMPARE = "Compare"
    ON_TOP = "Another effect on top?"
    HELD_OUT = "Held-out check"
    VERDICT = "Verdict"
    NEXT_DROP = "What to drop next"

    @property
    def heading(self) -> str:
        """Return the title with its place among all steps."""
        steps = list(MethodStep)
        return f"{self.value} ({steps.index(self) + 1} of {len(steps)})"

    def told(self, what: str) -> str:
        """Return what is being done, the step's heading before it."""
        return f"{self.heading}: {what}"


def each_step(tell: Callable[[str], object]) -> Callable[[str, float | None], None]:
    """Return a progress callable that passes on only the first words of each step.

    Parameters
    ----------
    tell : callable
        Gets one line whenever another step begins; ``print`` will do.

    Returns
    -------
    callable
        For ``progress`` of a diagnosis.
    """
    heading = ""

    def progress(text: str, share: float | None) -> None:
        """Tell a text where its heading is another than that of the one before."""
        nonlocal heading
        del share
        now = text.partition(": ")[0]
        if now != heading:
            heading = now
            tell(text)

    return progress
