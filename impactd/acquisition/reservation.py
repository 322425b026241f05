"""The reservation of the rig, and the report of an abort: values without behaviour."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

from impactd.acquisition.transitions import DROP_UNDER_WAY, State


class Reservation:
    """The rig, reserved for a series of drops.

    Parameters
    ----------
    calibration : int or None
        The calibration run whose drops are let through.
    accepted : int
        Abort epoch at which the series was asked for: an abort voids all its later drops.

    Attributes
    ----------
    aborted : threading.Event
        Set when somebody aborts the series.
    """

    def __init__(self, owner: str, calibration: int | None, accepted: int) -> None:
        self.owner = owner
        self.calibration = calibration
        self.accepted = accepted
        self.aborted = threading.Event()
        self.aborted_by = ""


@dataclass(frozen=True)
class AbortReport:
    """The outcome of an abort."""

    aborted: bool
    """Whether something was under way and is not any more."""
    drop: int | None
    """The drop that was ended."""
    sentence: str
    """The outcome in words, with whatever did not work."""
    took_s: float
    """From the call to valve safe, digitizer stopped, state changed. [s]"""


def report_of(
    before: State,
    drop: int | None,
    reservation: Reservation | None,
    *,
    entering: int,
    troubles: Sequence[Exception],
    took_s: float,
) -> AbortReport:
    """Return the report of an abort, also where the drop came too far to be ended.

    ``drop`` and ``reservation`` were under way, ``entering`` requests were about to begin a drop,
    ``troubles`` are what could not be made safe.
    """
    ended = drop if before in DROP_UNDER_WAY else None
    if ended is not None:
        what = f"Drop {ended} was aborted."
    elif before is State.STORING:
        what = (
            f"Drop {drop} could no longer be aborted: nothing moves any more, and its shot is kept."
        )
    elif before is State.STOPPING:
        what = f"Drop {drop} was ending already."
    else:
        what = "No drop was under way."
    if reservation is not None:
        owner = reservation.owner
        what += f" {owner[0].upper()}{owner[1:]} was ended."
    if entering:
        what += " A request that was about to start is refused."
    if troubles:
        what += " NOT MADE SAFE: " + " ".join(str(trouble) for trouble in troubles)
    else:
        what += " The vacuum is on and the digitizer is stopped."
    aborted = ended is not None or reservation is not None or entering > 0
    return AbortReport(aborted, ended, what, took_s)
