"""How far a stacked residual is drawn."""

import numpy as np
import pytest

from analysis.plots.span import span_us

CONTACT_US = 70.0
USUAL = (-0.7 * CONTACT_US, 7.0 * CONTACT_US)


def _stacks(means: np.ndarray, centres_us: np.ndarray) -> dict:
    curves = [{"mean": [None if np.isnan(v) else float(v) for v in row]} for row in means]
    return {
        "time_us": centres_us.tolist(),
        "contact_us": CONTACT_US,
        "by_pair_and_height": curves,
    }


def _bins() -> tuple[np.ndarray, np.ndarray]:
    """Return centres and widths: coarse before touch-down, fine, coarse again."""
    widths = np.concatenate([np.full(7, 35.0), np.full(240, 2.0), np.full(100, 35.0)])
    edges = -4.0 * CONTACT_US + np.concatenate([[0.0], np.cumsum(widths)])
    return (edges[1:] + edges[:-1]) / 2, widths


def _noise(seed: int) -> np.ndarray:
    """Return what averages of white noise over the bins of nine curves are."""
    _, widths = _bins()
    return np.random.default_rng(seed).standard_normal((9, widths.size)) / np.sqrt(widths)


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_drawn_as_far_as_the_ring_goes(seed: int) -> None:
    """Of noise alone the pulse and most of the ring are shown."""
    assert span_us(_stacks(_noise(seed), _bins()[0])) == USUAL


def test_a_second_touch_long_after_is_drawn_too() -> None:
    """The picture ends behind it."""
    centres, _ = _bins()
    means = _noise(1)
    touched = (centres > 1400.0) & (centres < 1500.0)
    means[3, touched] += 3.0
    low, high = span_us(_stacks(means, centres))
    assert low == USUAL[0]
    assert high == pytest.approx(centres[touched].max() + CONTACT_US)


def test_empty_bins_say_nothing() -> None:
    """They are null in the JSON."""
    centres, _ = _bins()
    means = _noise(2)
    means[:, ::5] = np.nan
    assert span_us(_stacks(means, centres)) == USUAL


def test_without_a_stretch_before_touch_down_the_usual_is_drawn() -> None:
    """Then nothing says what noise looks like."""
    centres, _ = _bins()
    means = _noise(3) + 5.0
    late = centres > 0.0
    assert span_us(_stacks(means[:, late], centres[late])) == USUAL


def test_without_shots_the_usual_is_drawn() -> None:
    """No curve, no error."""
    centres, _ = _bins()
    assert span_us(_stacks(np.zeros((0, centres.size)), centres)) == USUAL


def test_a_last_bin_of_one_sample_is_nothing_late() -> None:
    """Records end at different times, each in a bin that is hardly begun."""
    centres, _ = _bins()
    means = _noise(3)
    for row, end in enumerate(range(centres.size - 9, centres.size)):
        means[row, end:] = np.nan
        means[row, end - 1] = 1.5
    assert span_us(_stacks(means, centres)) == USUAL
