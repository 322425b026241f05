"""Filters of the chain: a high-pass, a resonance, and low-passes of any order in published forms.

A low-pass is a chain of sections of order 1 and 2.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.electronics import Chain, Stage, StateSpaceStage


def highpass(time_constant_s: float) -> StateSpaceStage:
    """Return a first-order high-pass at rest, ``y' + y/tau = u'``."""
    a = 1.0 / time_constant_s
    return StateSpaceStage(np.array([[-a]]), np.array([1.0]), np.array([-a]), 1.0)


def lowpass_first(cutoff_hz: float) -> StateSpaceStage:
    """Return a first-order low-pass at rest; the cut-off is at -3 dB."""
    w = 2.0 * np.pi * cutoff_hz
    return StateSpaceStage(np.array([[-w]]), np.array([1.0]), np.array([w]), 0.0)


def resonance(
    frequency_hz: float, damping_ratio: float, gain: float, direct: float
) -> StateSpaceStage:
    """Return ``direct + gain w^2 / (s^2 + 2 zeta w s + w^2)``, at rest.

    The frequency is the undamped one; zeta is not exactly 1.
    """
    w = 2.0 * np.pi * frequency_hz
    system = np.array([[0.0, 1.0], [-w * w, -2.0 * damping_ratio * w]])
    return StateSpaceStage(system, np.array([0.0, 1.0]), np.array([gain * w * w, 0.0]), direct)


def butterworth(cutoff_hz: float, order: int) -> Stage:
    """Return a filter with poles even on a half circle (Butterworth 1930), -3 dB at the cut-off."""
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

    It has 1 to 8 poles and is 3 dB down at the cut-off.
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
    """Return equal RC sections behind buffers; all together are 3 dB down at the cut-off."""
    if order == 1:
        return lowpass_first(cutoff_hz)
    each_hz = cutoff_hz / math.sqrt(2.0 ** (1.0 / order) - 1.0)
    return Chain([lowpass_first(each_hz) for _ in range(order)])
