"""What a converter's step hides: found, measured, and made good for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.hidden_noise import COARSE, hidden_noise
from analysis.noise import estimate_noise
from analysis.quantisation import Coarse, kept_share, starts_of_rest, step_of, weights_at_rest

RHO = 0.6


def noise(rng: np.random.Generator, samples: int, rms: float) -> np.ndarray:
    """Return AR(1) noise."""
    white = rng.standard_normal(samples + 200) * math.sqrt(1.0 - RHO**2)
    return rms * lfilter([1.0], [1.0, -RHO], white)[200:]


def quiet(rms: float, *, spread: float, seed: int = 0, records: int = 10) -> list[np.ndarray]:
    """Return rounded quiet stretches, levels scattered; the step is 1."""
    rng = np.random.default_rng(seed)
    return [np.rint(noise(rng, 1500, rms) + rng.uniform(-spread, spread)) for _ in range(records)]


def pulse(samples: int = 3000) -> np.ndarray:
    """Return a pulse with a ring, of height 1."""
    t = np.arange(samples) - 1500.0
    ring = 0.2 * np.exp(-t / 150.0) * np.sin(t / 9.0)
    return np.where(t < 0, 0.0, np.exp(-(((t - 40) / 20.0) ** 2)) + ring)


@pytest.mark.parametrize("bits", [6, 8, 12])
def test_the_step_is_the_smallest_difference_of_codes(bits: int) -> None:
    """Fewer bits in codes of more, volts or text with a few digits all show the same step."""
    step = 2.0 / 2**bits
    rounded = step * np.rint(pulse() / step)
    assert step_of(rounded, 2.0 / 65536) == pytest.approx(step, rel=1e-9)
    assert step_of(rounded) == pytest.approx(step, rel=1e-9)
    assert step_of(1.003 * rounded + 0.0123) == pytest.approx(1.003 * step, rel=1e-6)
    assert step_of(np.round(rounded, 5)) == pytest.approx(step, rel=0.05)


def test_no_step_is_seen_where_there_is_none() -> None:
    """Numbers that are not multiples of anything, or few of them, leave what is declared."""
    smooth = pulse() + noise(np.random.default_rng(0), 3000, 0.01)
    assert step_of(smooth) is None
    assert step_of(smooth, 1e-3) == 1e-3
    assert step_of(np.array([0.0, 5.0, 10.0]), 1.0) == 1.0


@pytest.mark.parametrize("spread", [0.05, 0.5])
@pytest.mark.parametrize("rms", [0.2, 0.3, 0.4])
def test_noise_is_inferred_through_the_step(rms: float, spread: float) -> None:
    """From the codes that change come size and colour of noise of a fraction of a step."""
    found = hidden_noise(quiet(rms, spread=spread), 1.0)
    assert found is not None
    coarse, covariance = found
    assert coarse.noise == pytest.approx(rms, rel=0.12)
    assert covariance[0] == pytest.approx(coarse.noise**2 + 1 / 12, rel=1e-12)
    correlations = covariance[1:4] / coarse.noise**2
    assert correlations == pytest.approx([0.6, 0.36, 0.216], abs=0.12)


def test_noise_that_changes_no_code_is_bounded() -> None:
    """Where all codes are one, noise may be as large as leaves them so, and no larger."""
    found = hidden_noise([np.zeros(1500)] * 8, 1.0)
    assert found is not None
    # 12000 samples within half a step to either side
    assert 0.1 < found[0].noise < 0.15
    assert np.all(found[1][1:] == 0.0)


def test_noise_of_half_a_step_hides_the_step() -> None:
    """Then rounding is white noise, and the quiet stretches say all, as they do of waves."""
    assert hidden_noise(quiet(1.2 * COARSE, spread=0.5), 1.0) is None
    wave = np.rint(20.0 * np.sin(np.arange(1500) / 50.0))
    assert hidden_noise([wave], 1.0) is None
    fine = quiet(5.0, spread=0.5)
    with_step, without = (estimate_noise(fine, quantum=q, sample_rate_hz=1e6) for q in (1.0, None))
    assert with_step is not None
    assert without is not None
    assert with_step.coarse is None
    assert with_step.innovation_rms == without.innovation_rms
    assert np.array_equal(with_step.coefficients, without.coefficients)


@pytest.mark.parametrize("rms", [0.05, 0.15, 0.25])
def test_a_signal_at_rest_keeps_its_error(rms: float) -> None:
    """The mean error at a level, over all levels, has the variance that the series gives."""
    rng = np.random.default_rng(1)
    levels = np.linspace(-0.5, 0.5, 400, endpoint=False)
    drawn = rms * rng.standard_normal(4000)
    errors = [float(np.mean(np.rint(level + drawn) - level - drawn)) for level in levels]
    assert 12.0 * np.var(errors) == pytest.approx(kept_share(rms), rel=0.05, abs=2e-3)


def test_a_stretch_lasts_as_long_as_the_record_rests() -> None:
    """Flicker and noise do not end it; a signal that crosses codes each sample rests nowhere."""
    step = Coarse(0.1, 0.05, 0.05)
    flicker = 0.1 * np.array([0, 1, 0, 1, 1, 0])
    steep = 0.1 * np.array([5, 9, 14, 8, 3])
    found = starts_of_rest(np.concatenate([flicker, steep]), step)
    assert found.tolist() == [0, 6, 7, 8, 9, 10]
    rng = np.random.default_rng(2)
    resting = np.rint(noise(rng, 5000, 0.4) + 0.3)
    assert starts_of_rest(resting, Coarse(1.0, 0.4, 0.4)).size < 10


@pytest.mark.parametrize("rms", [0.05, 0.2, 0.4])
def test_a_stretch_counts_as_one_value(rms: float) -> None:
    """Whatever its level and length, a stretch's error has a variance of 1 or a little less."""
    rng = np.random.default_rng(3)
    model = estimate_noise(quiet(rms, spread=0.5, records=40), quantum=1.0)
    assert model is not None
    assert model.coarse is not None
    memory = float(1.0 - model.coefficients.sum()) * model.rms / model.innovation_rms
    for length in (40, 400):
        found: list[float] = []
        for _ in range(500):
            level = rng.uniform(-0.5, 0.5)
            error = np.rint(noise(rng, length + model.order, rms) + level) - level
            record = error[model.order :] + level
            weights = weights_at_rest(record, model.coarse, memory=memory)
            # what a constant would be told by
            found.append(np.sum(weights**2 * model.whiten(error)) / math.sqrt(np.sum(weights**2)))
        assert 0.3 < float(np.var(found)) < 1.25


@pytest.mark.parametrize("rms", [0.02, 0.1])
@pytest.mark.parametrize("height", [30.0, 100.0, 300.0])
def test_a_pulse_leaves_the_squares_that_are_expected(rms: float, height: float) -> None:
    """Whether it passes through codes or rests."""
    rng = np.random.default_rng(4)
    coarse = Coarse(1.0, rms, rms)
    of_one = 1.0 / math.sqrt(1.0 / 12.0 + rms**2)
    seen = expected = samples = 0.0
    for _ in range(50):
        signal = height * rng.uniform(0.9, 1.1) * pulse()[1490:2400] + rng.uniform(0.0, 1.0)
        record = np.rint(signal + rms * rng.standard_normal(signal.size))
        weights = weights_at_rest(record, coarse)
        seen += float(np.sum((weights * of_one * (record - signal)) ** 2))
        expected += float(np.sum(weights**2))
        samples += signal.size
    assert seen == pytest.approx(expected, rel=0.05)
    assert expected < samples
