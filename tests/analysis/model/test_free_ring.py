"""The free ring of a structure against matrix exponentials."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.model.free_ring import add_free_ring
from analysis.model.structure import FRAME, Structure


def structure(zeta: float) -> Structure:
    """Return a crystal on a base, with a coupon on top."""
    found = Structure.kelvin_voigt(0.035, 4e8, 2 * zeta * 0.035 * 1.07e5)
    found.add("coupon", 3e-3)
    found.link("coupon", "crystal", 3e8, 2 * zeta * np.sqrt(3e8 * 3e-3))
    found.add("base", 0.3)
    found.move_base("base")
    found.link("base", FRAME, 0.3 * 2e4**2, 2 * zeta * 0.3 * 2e4)
    return found


@pytest.mark.parametrize("zeta", [0.0, 0.05, 3.0])
@pytest.mark.parametrize("samples", [5, 1000])
def test_the_ring_is_the_matrix_exponential(zeta: float, samples: int) -> None:
    """Undamped, damped and overdamped, to 1e-10 of the largest excursion."""
    found = structure(zeta).assemble()
    state = np.array([1e-6, 0.02, 2e-6, -0.03, 1e-8, 1e-4])
    ahead, dt, first = 0.37e-6, 1e-6, 3
    out = np.zeros(samples)
    add_free_ring(out, first, ahead, dt, found.accelerations, found.reading, 2.0, state.copy())
    reading = np.zeros(6)
    reading[0::2] = found.reading
    wanted = np.zeros(samples)
    for i in range(first, samples):
        wanted[i] = 2.0 * reading @ expm(found.system * (ahead + (i - first) * dt)) @ state
    assert np.abs(out - wanted).max() < 1e-10 * np.abs(wanted).max()
