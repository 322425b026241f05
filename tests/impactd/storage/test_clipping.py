"""Flat tops that are limits, and crests that only look flat."""

from __future__ import annotations

import numpy as np
import pytest

from impactd.storage.clipping import is_clipped


def _pulse(height: float, width: int, noise: float = 0.0) -> np.ndarray:
    signal = np.zeros(2000)
    signal[500 : 500 + width] = height * np.sin(np.linspace(0.0, np.pi, width))
    return signal + np.random.default_rng(0).normal(0.0, noise, signal.size)


@pytest.mark.parametrize("height", [3, 10, 50, 400, 5000])
@pytest.mark.parametrize("width", [20, 60, 150, 600])
@pytest.mark.parametrize("noise", [0.0, 0.3, 3.0])
def test_a_smooth_crest_is_not_called_clipped(height: float, width: int, noise: float) -> None:
    """However coarse the converter, a half-sine keeps its clean name."""
    assert not is_clipped(np.round(_pulse(height, width, noise)).astype(np.int16))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_an_amplifiers_limit_is_seen(share: float, sign: int) -> None:
    """A pulse cut well inside the converter's range is flagged, of either sign."""
    signal = np.minimum(_pulse(5000, 100, 1.0), 5000 * share)

    assert is_clipped(np.round(sign * signal).astype(np.int16))


def test_the_end_of_the_converters_codes_is_enough() -> None:
    """Three samples at the last code are a limit, whatever stands beside them."""
    codes = np.round(_pulse(5000, 100)).astype(np.int16)
    codes[550:553] = 32767

    assert is_clipped(codes)
    codes[552] = 0
    assert not is_clipped(codes)


def test_floats_are_judged_by_their_own_step() -> None:
    """Volts with a flat top are flagged without knowing the converter."""
    volts = np.round(_pulse(5000, 100, 1.0)) * 3e-4

    assert not is_clipped(volts)
    assert is_clipped(np.minimum(volts, 1.2))
