"""Decimation of records whose pulse is longer than a window holds.

A window has `MAX_SAMPLES`, whatever the sampling rate: a pulse of 50 000 of them would be cut off
in its rise. A pulse of thousands of samples is as smooth over three of them, so that fewer tell
next to the same.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Campaign, Shot
from analysis.fit.window import MAX_SAMPLES, pulse_samples

LONGEST_PULSE = MAX_SAMPLES // 2
"""Samples of a pulse; the other half of the window is for what comes before and after it."""
STEP = 3
"""Factor from one trial to the next: odd, so that the mean of a stretch lies on a sample."""
FEWEST = 64
"""Samples that a record must keep; `analysis.fit.window` looks for a pulse in as many."""


def thinned(campaign: Campaign) -> tuple[Campaign, list[str]]:
    """Return a campaign whose pulses fit into a window, and sentences that say what was done.

    The campaign is the same if they do already, or if no pulse is seen at any rate. There is one
    sentence for each instrument (quantity and sampling rate) that was thinned.
    """
    groups: dict[tuple[str, float], list[Shot]] = defaultdict(list)
    for shot in campaign.shots:
        groups[shot.quantity, shot.sample_rate_hz].append(shot)
    factors = {key: _factor(shots) for key, shots in groups.items()}
    if all(factor == 1 for factor in factors.values()):
        return campaign, []
    shots = (_by(shot, factors[shot.quantity, shot.sample_rate_hz]) for shot in campaign.shots)
    told = [
        f"Pulses at {rate:g} Hz have more than {LONGEST_PULSE} samples: one in {factor} was "
        f"fitted, at {rate / factor:.4g} Hz."
        for (_, rate), factor in factors.items()
        if factor > 1
    ]
    return replace(campaign, shots=tuple(shots)), told


def _factor(shots: list[Shot]) -> int:
    """Return the smallest power of `STEP` that shows half of the pulses whole, 1 if none does."""
    longest = max(shot.signal.size for shot in shots)
    factor = 1
    while longest // factor >= FEWEST:
        found = [pulse_samples(_by(shot, factor), strict=factor > 1) for shot in shots]
        fitting = sum(1 for samples in found if samples is not None and samples <= LONGEST_PULSE)
        if 2 * fitting >= len(shots):
            return factor
        factor *= STEP
    return 1


def _by(shot: Shot, factor: int) -> Shot:
    """Return one shot with one sample in so many; the first stays the first."""
    if factor == 1:
        return shot
    u_rate = shot.u_sample_rate_hz
    return replace(
        shot,
        signal=_samples(shot, factor),
        sample_rate_hz=shot.sample_rate_hz / factor,
        trigger_index=shot.trigger_index // factor,
        u_sample_rate_hz=None if u_rate is None else replace(u_rate, u=u_rate.u / factor),
    )


def _samples(shot: Shot, factor: int) -> NDArray[np.float64]:
    """Return the mean about each sample that is kept, or that sample itself where it is a code.

    What is known of a converter's step and limits holds for what it gave, not for means.
    """
    if shot.quantum is not None:
        return np.ascontiguousarray(shot.signal[::factor])
    count = (shot.signal.size - 1) // factor + 1
    half = factor // 2
    behind = count * factor - half - shot.signal.size
    whole = np.pad(shot.signal[: count * factor - half], (half, max(behind, 0)), mode="edge")
    return np.asarray(whole.reshape(count, factor).mean(axis=1))
