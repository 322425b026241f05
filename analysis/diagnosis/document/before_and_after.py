"""Signals before touch-down and after the pulse that no contact can have caused.

Both are seen in the records themselves, without a model: what comes before cannot be caused by what
comes after, and a pulse that is over leaves a record where it began.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.document.wording import two_digits
from analysis.diagnosis.model_free import CONTACT_ENDS, FEWEST_HITS
from analysis.fit.fit_shot import FitShot

MARGIN = 0.25
"""Pulse widths between what is looked at and where a pulse exceeds 5 % of its height. A Hertz pulse
begins 0.05^(2/3) of its rise before, 0.07 widths."""
LONGEST_AFTER = 8.0
"""Pulse widths over which the level after a pulse is taken. Derived: of a ring whose period is a
pulse width the mean over so many leaves 1 / (8 pi) at most."""


def said_before_and_after(shots: Sequence[FitShot]) -> list[str]:
    """Return a sentence for what the hits show before they touch, and one for where they end."""
    looks = [look for item in shots if (look := _Look.at(item)) is not None]
    if len(looks) < FEWEST_HITS:
        return []
    return [*_before(looks), *_after(looks)]


@dataclass(frozen=True)
class _Look:
    """One record beside its pulse, in heights of the pulse."""

    before: Array
    """The pulse width before touch-down."""
    noise: float
    """Rms of noise."""
    after: float | None
    """Level behind the pulse."""
    impulse_s: float
    """Of the pulse over its height."""

    @classmethod
    def at(cls, item: FitShot) -> _Look | None:
        """Return it; None where the record begins too late."""
        window = item.window
        x = (window.polarity * item.shot.signal - window.baseline) / window.peak
        rate_hz = item.shot.sample_rate_hz
        width = max(2, round(window.width_s * rate_hz))
        rise, top = window.first + window.rise_index, window.first + window.peak_index
        last = rise - max(1, round(MARGIN * width))
        over = np.flatnonzero(x[top:] < CONTACT_ENDS)
        if last < width or not over.size:
            return None
        end = top + int(over[0])
        level = x[end + width : end + width + round(LONGEST_AFTER * width)]
        return cls(
            x[last - width : last],
            item.noise.rms / window.peak,
            float(level.mean()) if level.size >= 2 * width else None,
            float(x[rise:end].sum()) / rate_hz,
        )


def _before(looks: Sequence[_Look]) -> list[str]:
    length = min(look.before.size for look in looks)
    each = np.array([look.before[-length:] for look in looks])
    own = float(np.sum(each**2))
    whole = each.sum(axis=0)
    # products of different hits only: noise does not repeat
    share = (float(whole @ whole) - own) / (own * (len(looks) - 1)) if own > 0.0 else 0.0
    rms = math.sqrt(own / each.size)
    noise = math.sqrt(float(np.mean([look.noise**2 for look in looks])))
    if share < CRITERIA.half or rms**2 < CRITERIA.noticeable * noise**2:
        return []
    size = two_digits(100.0 * float(np.abs(each.mean(axis=0)).max()))
    return [
        f"Before touch-down the records already leave their baseline, by up to {size} % of the "
        "peak and in the same way in every hit. A contact cannot cause that: it is a zero-phase "
        "or linear-phase filter, or a precursor."
    ]


def _after(looks: Sequence[_Look]) -> list[str]:
    levels = np.array([look.after for look in looks if look.after is not None])
    if levels.size < FEWEST_HITS:
        return []
    level, u = float(levels.mean()), float(levels.std(ddof=1)) / math.sqrt(levels.size)
    if abs(level) <= CRITERIA.excess_deviations * u:
        return []
    where = "below" if level < 0.0 else "above"
    said = (
        f"After the pulse the records lie {two_digits(100.0 * abs(level))} % of the peak {where} "
        f"their level before it (+- {two_digits(100.0 * u)} %)"
    )
    if level > 0.0:
        return [f"{said}: a creep, a warming, or a load that remains."]
    droop_s = float(np.median([look.impulse_s for look in looks])) / -level
    return [
        f"{said}: a droop, as from a high-pass of about {two_digits(1e3 * droop_s)} ms, or a slow "
        "return of a moving part."
    ]
