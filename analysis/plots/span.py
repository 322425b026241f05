"""The time range of a stacked residual: the pulse and most of the ring, further where needed."""

from __future__ import annotations

import numpy as np

from analysis.aliases import Json

USUAL_SHARES = (-0.7, 7.0)
"""What is drawn at least, in contact times."""
QUIET_BEFORE = -1.0
"""Contact times before which a residual is the noise alone."""
LOUD = 6.0
"""Times that noise at which a later bin is worth showing."""


def span_us(stacks: Json) -> tuple[float, float]:
    """Return from when to when a stacked residual is worth drawing. [us]

    Around the touch-down: the pulse and most of the ring, and a second touch or a slow decay long
    after it where one stands out of what was there before the touch.

    A bin's mean is told from noise by the bins before touch-down, as if noise were white: its
    standard deviation falls with the square root of a bin's width. Own rule; it moves the edge of a
    picture, and no figure. Where fine bins meet coarse ones the finer width counts; a record's last
    bin, of which nobody knows how full it is, does not.
    """
    t = np.array(stacks["time_us"])
    low, high = (share * stacks["contact_us"] for share in USUAL_SHARES)
    means = [[np.nan if v is None else v for v in c["mean"]] for c in stacks["by_pair_and_height"]]
    if t.size < 2 or not means:
        return low, high
    apart = np.diff(t)
    widths = np.minimum(np.append(apart, apart[-1]), np.insert(apart, 0, apart[0]))
    heard = np.abs(np.array(means)) * np.sqrt(widths)
    for row in heard:
        row[np.flatnonzero(np.isfinite(row))[-1:]] = np.nan
    quiet = heard[:, t < QUIET_BEFORE * stacks["contact_us"]]
    if not np.isfinite(quiet).any():
        return low, high
    loud = np.nanmax(np.nan_to_num(heard), axis=0) > LOUD * np.sqrt(np.nanmean(quiet**2))
    return low, max(high, *(t[loud] + stacks["contact_us"])) if loud.any() else high
