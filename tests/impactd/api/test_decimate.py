"""Thinning a trace."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from impactd.api.decimate import min_max_indices


@given(st.integers(1, 3000), st.integers(2, 400), st.randoms())
def test_extremes_survive_and_the_number_of_points_is_kept(samples, points, random):
    """However few points: both extremes are among them, in order of time, and not too many."""
    signal = np.array([random.gauss(0, 1) for _ in range(samples)])
    kept = min_max_indices(signal, points)
    assert kept.size <= max(points, 2)
    assert np.all(np.diff(kept) >= 0)
    assert {signal.argmin(), signal.argmax()} <= {
        int(np.flatnonzero(signal == signal[k])[0]) for k in kept
    }


def test_a_short_record_stays_whole():
    """A record with fewer samples than points is not touched."""
    assert min_max_indices(np.zeros(7), 8).tolist() == list(range(7))
