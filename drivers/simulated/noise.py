"""Noise of the simulated electronics: white, 1/f, or correlated from sample to sample."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from drivers.simulated.recursion import run_on


@dataclass(frozen=True)
class NoiseSettings:
    """Noise of the input when nothing happens."""

    rms_v: float = 1.5e-3
    """Standard deviation of the white or autoregressive part."""
    ar1: float = 0.0
    """Correlation from one sample to the next, 0 for white. [1]"""
    pink_corner_hz: float = 300.0
    """Frequency at which a 1/f part (in power) equals the white part's density; 0 for none. [Hz]"""

    def __post_init__(self) -> None:
        """Refuse what is not noise."""
        if self.rms_v < 0.0 or not -1.0 < self.ar1 < 1.0 or self.pink_corner_hz < 0.0:
            raise ValueError(
                f"Noise needs rms_v >= 0, -1 < ar1 < 1 and pink_corner_hz >= 0, not {self}."
            )


def noise_record(
    settings: NoiseSettings, samples: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return a stretch of white or AR(1) noise that is stationary from its first sample. [V]

    The 1/f part is left out.
    """
    white = rng.standard_normal(samples)
    if settings.ar1 == 0.0:
        return settings.rms_v * white
    rho = settings.ar1
    innovation = np.sqrt(1.0 - rho * rho)
    white[1:] *= innovation
    return settings.rms_v * run_on(white, rho, 0.0)


def noise_table(
    settings: NoiseSettings, samples: int, sample_rate_hz: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return noise that joins its own beginning, so that it can be read round and round.

    A power of two of samples is quickest; the rate is that at which it will be read. Shaped in the
    frequency domain: AR(1) has the density ``(1 - rho^2)/|1 - rho exp(-i w)|^2``, the 1/f part
    ``f_c / f`` of the white density, cut below the table's first line.
    """
    spectrum = rfft(rng.standard_normal(samples).astype(np.float32))
    spectrum *= _amplitudes(settings, samples, sample_rate_hz)
    return np.asarray(irfft(spectrum, samples), dtype=np.float32)


@lru_cache(maxsize=4)
def _amplitudes(
    settings: NoiseSettings, samples: int, sample_rate_hz: float
) -> NDArray[np.float32]:
    """Return what white noise of 1 is multiplied with, line by line. [V]"""
    f = np.fft.rfftfreq(samples)
    rho = settings.ar1
    power = (1.0 - rho * rho) / np.abs(1.0 - rho * np.exp(-2j * np.pi * f)) ** 2
    if settings.pink_corner_hz > 0.0:
        power[1:] += settings.pink_corner_hz / (f[1:] * sample_rate_hz)
    return np.asarray(settings.rms_v * np.sqrt(power), dtype=np.float32)
