"""Low-pass filters of any order in three published forms, in sections of order 1 and 2."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.electronics import Stage, lowpass_first, resonance


class Chain:
    """Stages one behind the other.

    Parameters
    ----------
    stages : sequence of Stage
        In the order of the signal.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = list(stages)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Return what comes out of the last one.

        Parameters
        ----------
        volts : ndarray, shape (n,)
            Input. [V]
        step_s : float
            Its step. [s]

        Returns
        -------
        ndarray, shape (n,)
            Output. [V]
        """
        for stage in self._stages:
            volts = stage.process(volts, step_s)
        return volts

    def is_quiet(self, threshold_v: float) -> bool:
        """Return whether every one has forgotten what it heard."""
        return all(stage.is_quiet(threshold_v) for stage in self._stages)


def butterworth(cutoff_hz: float, order: int) -> Stage:
    """Return a filter with poles even on a half circle (Butterworth 1930).

    Parameters
    ----------
    cutoff_hz : float
        -3 dB frequency. [Hz]
    order : int
        Number of poles. [1]

    Returns
    -------
    Stage
        At rest.
    """
    if order == 1:
        return lowpass_first(cutoff_hz)
    if order == 2:
        return resonance(cutoff_hz, math.sqrt(0.5), 1.0, 0.0)
    sections: list[Stage] = [lowpass_first(cutoff_hz)] if order % 2 else []
    for i in range(order // 2):
        zeta = math.sin(math.pi * (2 * i + 1) / (2 * order))
        sections.append(resonance(cutoff_hz, zeta, 1.0, 0.0))
    return Chain(sections)


def bessel(cutoff_hz: float, order: int) -> Stage:
    """Return a filter of flattest group delay (Thomson, Proc. IEE 96 III (1949) 487).

    Parameters
    ----------
    cutoff_hz : float
        -3 dB frequency. [Hz]
    order : int
        Number of poles, 1 to 8. [1]

    Returns
    -------
    Stage
        At rest.
    """
    n = order
    # Reverse Bessel polynomial, highest power first.
    coefficients = [
        math.factorial(2 * n - k) / (2 ** (n - k) * math.factorial(k) * math.factorial(n - k))
        for k in range(n, -1, -1)
    ]
    poles = np.roots(coefficients)
    low, high = 0.1, 10.0 * n
    while high - low > 1e-13 * high:
        w = 0.5 * (low + high)
        gain = abs(coefficients[-1] / np.prod(1j * w - poles))
        low, high = (w, high) if gain > math.sqrt(0.5) else (low, w)
    sections: list[Stage] = []
    for pole in poles[poles.imag >= -1e-9]:
        size_hz = abs(pole) / low * cutoff_hz
        if abs(pole.imag) < 1e-9:
            sections.append(lowpass_first(size_hz))
        else:
            sections.append(resonance(size_hz, -pole.real / abs(pole), 1.0, 0.0))
    return Chain(sections)


def rc_sections(cutoff_hz: float, order: int) -> Stage:
    """Return equal RC sections behind buffers; all together are 3 dB down at the cut-off.

    Parameters
    ----------
    cutoff_hz : float
        -3 dB frequency. [Hz]
    order : int
        Number of sections. [1]

    Returns
    -------
    Stage
        At rest.
    """
    if order == 1:
        return lowpass_first(cutoff_hz)
    each_hz = cutoff_hz / math.sqrt(2.0 ** (1.0 / order) - 1.0)
    return Chain([lowpass_first(each_hz) for _ in range(order)])
