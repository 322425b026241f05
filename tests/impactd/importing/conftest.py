"""Recordings as instruments and people write them, of hits whose places are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

RATE_HZ = 50_000.0


@dataclass(frozen=True)
class Record:
    """A record and what is in it."""

    times_s: NDArray[np.float64]
    signal: NDArray[np.float64]
    begins: tuple[int, ...]
    contact: int


def make_record(
    begins: tuple[int, ...] = (4000, 14000, 24000),
    *,
    samples: int = 32_000,
    contact: int = 60,
    peaks: tuple[float, ...] = (100.0, 70.0, 85.0, 60.0, 90.0),
    noise: float = 0.1,
    rate_hz: float = RATE_HZ,
) -> Record:
    """Return Hertz-like pulses, each with a faint ring behind it, in white noise."""
    signal = np.random.default_rng(5).normal(0.0, noise, samples)
    ringing = np.arange(20 * contact)
    for begin, peak in zip(begins, peaks, strict=False):
        pulse = peak * np.sin(np.pi * np.arange(contact) / contact) ** 1.5
        signal[begin : begin + contact] += pulse
        ring = 0.02 * peak * np.sin(ringing * 2 * np.pi / 25) * np.exp(-ringing / (3 * contact))
        signal[begin + contact :][: ring.size] += ring[: samples - begin - contact]
    return Record(np.arange(samples) / rate_hz, signal, begins, contact)


@pytest.fixture(scope="session")
def record() -> Record:
    """Three hits in a record of 0.64 s."""
    return make_record()
