"""The crystal's frequency and damping from the free ring after the contact, without any model."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from analysis.aliases import Array
from analysis.fit.fit_shot import FitShot

DAMPING_RATIOS = (0.01, 0.03, 0.07, 0.15, 0.3)
FREQUENCY_STEP = 0.01
"""Relative; a ring of damping ratio 0.01 is no narrower."""
LEAST_SHARE = 0.3
"""A tail of which a damped sine explains less holds no ring worth starting from."""
LONGEST_TAIL = 1000


def _tail(item: FitShot) -> Array:
    """Return the samples after the first pulse fell below 5 % of its peak, baseline removed."""
    window = item.window
    width = round(window.width_s * item.frame.sample_rate_hz)
    start = window.rise_index + width + width // 4
    return np.asarray(window.signal[start : start + LONGEST_TAIL] - window.baseline)


@njit(cache=True)
def _project(tail, step_re, step_im, seen_re, seen_im):  # type: ignore[no-untyped-def]
    """Add the sum of ``tail[i] step**i`` for each complex step; no array of powers is kept."""
    power_re, power_im = np.ones(step_re.size), np.zeros(step_re.size)
    for y in tail:
        # frequencies inside: they are independent, so the processor takes several at once
        for j in range(step_re.size):
            a, b = power_re[j], power_im[j]
            seen_re[j] += y * a
            seen_im[j] += y * b
            power_re[j] = a * step_re[j] - b * step_im[j]
            power_im[j] = a * step_im[j] + b * step_re[j]


def _explained(tail: Array, omega: Array, zeta: float, rate: float) -> Array:
    """Return the share of a tail's energy in a sine of each frequency at one damping ratio."""
    n = tail.size
    root = np.exp((-zeta * omega + 1j * omega * math.sqrt(1 - zeta**2)) / rate)
    a, b = np.zeros(omega.size), np.zeros(omega.size)
    _project(tail, root.real.copy(), root.imag.copy(), a, b)
    # sums of cos^2, sin^2 and cos sin under the envelope are geometric series
    square = root**2
    turning = (1 - square**n) / (1 - square)
    power = (1 - np.abs(root) ** (2 * n)) / (1 - np.abs(root) ** 2)
    cc, ss, cs = 0.5 * (power + turning.real), 0.5 * (power - turning.real), 0.5 * turning.imag
    energy = (ss * a**2 - 2 * cs * a * b + cc * b**2) / (cc * ss - cs**2)
    return np.asarray(energy / float(tail @ tail))


def ring_in_tails(
    items: Sequence[FitShot], *, near: tuple[float, float] | None = None
) -> tuple[float, float] | None:
    """Return the frequency [rad/s] and damping ratio [1] of the ring after the contact.

    They are those of the grid's best point; None if no ring is seen. The shots are of one cell, at
    one sample rate. ``near`` is a frequency [rad/s], and how far from it in the logarithm a ring
    may be; the default is all that the records can show. Source: projection of the tail on damped
    sines over a grid. Validation: fits without a certificate in
    ``tests/analysis/fit/test_joint.py``.
    """
    rate = items[0].frame.sample_rate_hz
    tails = [t for t in (_tail(i) for i in items) if t.size > 16 and t.any()]
    if not tails:
        return None
    width = float(np.median([i.window.width_s for i in items]))
    low, high = 0.3 / width, 0.4 * rate
    if near is not None:
        middle, far = near[0] / (2 * math.pi), math.exp(near[1])
        low, high = max(low, middle / far), min(high, middle * far)
    count = math.ceil(math.log(high / low) / FREQUENCY_STEP) if high > low else 0
    if count == 0:
        return None
    omega = 2 * math.pi * np.geomspace(low, high, max(count, 2))
    best = (LEAST_SHARE, 0.0, 0.0)
    for zeta in DAMPING_RATIOS:
        share = np.mean([_explained(t, omega, zeta, rate) for t in tails], axis=0)
        at = int(np.argmax(share))
        if share[at] > best[0]:
            best = (float(share[at]), float(omega[at]), zeta)
    return (best[1], best[2]) if best[1] > 0 else None
