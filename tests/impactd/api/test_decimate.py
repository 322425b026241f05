"""Thinning a trace."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from impactd.api.decimate import min_max_indices


@settings(deadline=None)
@given(st.integers(1, 3000), st.integers(2, 400), st.integers(0, 2**32 - 1))
def test_extremes_survive_and_the_number_of_points_is_kept(samples, points, seed):
    """However few points: both extremes are among them, in order of time, and not too many."""
    signal = np.random.default_rng(seed).normal(size=samples)
    kept = min_max_indices(signal, points)
    assert kept.size <= points
    assert np.all(np.diff(kept) >= 0)
    assert {signal.argmin(), signal.argmax()} <= set(kept.tolist())


def test_a_short_record_stays_whole():
    """A record with fewer samples than points is not touched."""
    assert min_max_indices(np.zeros(7), 8).tolist() == list(range(7))
