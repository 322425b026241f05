"""A jump of the clock is found in a record from which samples were taken."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.basis.time_course import jump_columns


def _ring(samples):
    """A pulse that sets off a ring, at any time."""
    t = np.asarray(samples) * 1e-6
    later = np.maximum(t - 1e-4, 0.0)
    ring = 0.4 * np.exp(-later / 3e-4) * np.sin(1.6e5 * later)
    return np.exp(-(((t - 1e-4) / 3e-5) ** 2)) + ring


@pytest.mark.parametrize(("lost", "at", "late"), [(3, 160, 1), (-5, 240, -3), (1, 130, 0.5)])
def test_the_jump_of_a_record_that_lost_samples_is_found(lost, at, late):
    """The model's touch-down lies between: late before the jump, early after it."""
    n = np.arange(700)
    noise = 1e-3 * np.random.default_rng(5).standard_normal(n.size)
    record = _ring(n + np.where(n < at, 0.0, lost)) + noise
    model = _ring(n + late)
    labels, columns = jump_columns(model, record - model, first=40)
    assert (len(labels), columns.shape) == (1, (700, 1))
    came = int(np.argmax(columns[:, 0] != 0.0))
    assert came == pytest.approx(at, abs=3)
    in_time, jump = _ring(n), columns[:, 0] * lost
    left = record - in_time - jump
    assert np.std(left[n > at + 3]) < 0.2 * np.std((record - in_time)[n > at + 3])


def test_a_record_without_a_jump_has_a_column_that_explains_no_more_than_chance():
    """Place and size are free: some tens of whitened squares, not hundreds."""
    n = np.arange(700)
    rng = np.random.default_rng(6)
    for _ in range(20):
        noise = 1e-3 * rng.standard_normal(n.size)
        column = jump_columns(_ring(n), noise, first=40)[1][:, 0]
        size = column @ noise / max(column @ column, 1e-300)
        assert (size * column @ noise) / 1e-6 < 40.0
