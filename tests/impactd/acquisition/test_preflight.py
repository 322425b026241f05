"""Pre-flight: facts in, checks with sentences out."""

from __future__ import annotations

import numpy as np
import pytest

from impactd.acquisition.preflight import Baseline, check_disk, check_input
from impactd.settings.instrument import TriggerSection
from impactd.settings.sections import PreflightSection

LIMITS = PreflightSection(
    baseline_min_v=-0.1, baseline_max_v=0.1, noise_max_v=0.02, noise_min_v=1e-5
)
TRIGGER = TriggerSection(level_v=0.05, hysteresis_v=0.02)
RNG = np.random.default_rng(1)


def _input(mean_v: float, noise_v: float) -> Baseline:
    return Baseline.of(mean_v + noise_v * RNG.standard_normal(20_000))


@pytest.mark.parametrize(
    ("mean_v", "noise_v", "word"),
    [
        (0.2, 1e-3, "baseline must lie"),
        (-0.2, 1e-3, "baseline must lie"),
        (0.0, 0.03, "near the trigger"),
        (0.0, 0.0, "is dead"),
    ],
)
def test_a_bad_input_is_named_with_its_limit(mean_v: float, noise_v: float, word: str) -> None:
    """Offset, noise and a dead input each get their own sentence and remedy."""
    check = check_input(_input(mean_v, noise_v), LIMITS, TRIGGER)
    assert not check.ok
    assert word in check.sentence
    assert check.remedy


def test_a_quiet_input_passes() -> None:
    """Noise of a millivolt around zero is what a rig looks like."""
    assert check_input(_input(0.0, 1.5e-3), LIMITS, TRIGGER).ok
    nearly_zero = Baseline.of(np.array([1e-3, -1.002e-3]))
    assert check_input(nearly_zero, LIMITS, TRIGGER).sentence.startswith("baseline 0.00 mV")


def test_a_last_bounce_is_seen_although_the_noise_is_low() -> None:
    """A hundred microseconds in a quarter second hardly change the rms, and would trigger."""
    signal = 1.5e-3 * RNG.standard_normal(250_000)
    signal[100_000:100_100] += 0.2
    baseline = Baseline.of(signal)
    assert baseline.noise_rms_v < LIMITS.noise_max_v
    assert "near the trigger" in check_input(baseline, LIMITS, TRIGGER).sentence


def test_the_disk_says_what_it_lacks() -> None:
    """Inside the reserve the check says by how much."""
    assert check_disk(5_000_000).ok
    assert check_disk(67_542_000_000).sentence == "67.5 GB free above the reserve"
    assert "lacks 7 MB" in check_disk(-7_000_000).sentence
