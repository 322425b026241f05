"""Why a request to the rig was refused, drawn as one tree.

::

    RequestRefusedError             nothing was begun and nothing moved
    ├── BusyError                   somebody else's drop is under way
    ├── RequestAbortedError         somebody aborted after the request had arrived
    ├── NotReadyError               the rig cannot take a drop now
    │   └── CalibrationRefusedError a calibration run cannot be started
    └── DropHeightError             the height is none that this rig allows
"""

from __future__ import annotations


class RequestRefusedError(Exception):
    """A request was refused; nothing was begun and nothing moved."""


class BusyError(RequestRefusedError):
    """Somebody else holds the rig; ``number`` is their drop, ``None`` between two of a series."""

    def __init__(self, owner: str, number: int | None) -> None:
        self.owner = owner
        self.number = number
        what = (
            f"drop {number} of {owner} is under way"
            if number
            else (f"{owner} has reserved the rig")
        )
        super().__init__(f"The rig is busy: {what}.")


class RequestAbortedError(RequestRefusedError):
    """Somebody aborted after the request had arrived."""

    def __init__(self, by: str, aborted_utc: str) -> None:
        self.by = by
        self.aborted_utc = aborted_utc
        super().__init__(
            f"Aborted: accepted before the abort at {aborted_utc} by {by}, so it was not carried "
            "out."
        )


class NotReadyError(RequestRefusedError):
    """The rig cannot take a drop now."""

    def __init__(self, sentence: str, remedy: str) -> None:
        self.sentence = sentence
        self.remedy = remedy
        super().__init__(f"{sentence} {remedy}".strip())


class CalibrationRefusedError(NotReadyError):
    """A calibration run cannot be started."""


class DropHeightError(RequestRefusedError):
    """The rig does not allow this height."""

    def __init__(self, drop_height_m: float, lowest_m: float, greatest_m: float) -> None:
        self.drop_height_m = drop_height_m
        self.lowest_m = lowest_m
        self.greatest_m = greatest_m
        super().__init__(
            f"A drop height of {drop_height_m:g} m is outside what this rig allows, "
            f"{lowest_m:g} to {greatest_m:g} m. Is it in metres?"
        )
