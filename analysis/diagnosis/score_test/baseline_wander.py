"""Does a zero line move as slow noise does, which is too faint to be seen before the trigger?

Noise of density 1/f moves every order of a zero line, the first most, by amounts that stand in a
known ratio. Its size is only known to a limit: quiet stretches are short. So a zero line that moves
says nothing as long as some 1/f part that they allow moves it like that. Hum moves one order and
hardly the next.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from analysis.diagnosis.basis.modulation import BASELINE_ORDERS
from analysis.diagnosis.score_test.linearised import Linearised, LinearisedShot
from analysis.noise import NoiseModel
from analysis.noise_slow import FURTHEST_CORNER, LEAST_CORNER
from analysis.quiet_spectrum import drift_basis, slow_powers

Array = NDArray[np.float64]

FAMILY = "baseline"
CORNERS_TRIED = 40
"""Corner frequencies of slow noise, evenly over their logarithm."""
LEAST_SHARE = 1e-6
"""Of an order, that a shot's own parameters must leave of it for it to be seen."""


def p_of_wander(linearised: Linearised) -> float:
    """Return how likely zero lines move as they do by slow noise that may be there unseen.

    Parameters
    ----------
    linearised : Linearised
        With the family of zero lines.

    Returns
    -------
    float
        For the 1/f part that suits best among those which the quiet stretches allow.

    Notes
    -----
    The squares of N shots along an order, over what is expected, are chi-square over N; of the
    ratios' deviance, N sum(r - 1 - ln r), the smallest over all allowed corners is compared with
    chi-square of as many degrees of freedom as there are orders, which is on the safe side.
    Validation: zero lines moved by noise and by hum in ``tests/analysis/diagnosis``.
    """
    at, _ = linearised.families[FAMILY]
    by_noise: dict[int, list[LinearisedShot]] = {}
    for shot in linearised.shots:
        by_noise.setdefault(id(shot.item.noise), []).append(shot)
    deviance = sum(_deviance(shots, at) for shots in by_noise.values())
    return float(chi2.sf(deviance, len(at) * len(by_noise)))


def _deviance(shots: list[LinearisedShot], at: list[int]) -> float:
    """Return the smallest deviance of one instrument's zero lines over all allowed corners."""
    squares = np.array([_by_order(shot, at) for shot in shots])
    slow = np.array([_slow_powers(shot.item.window.signal.size) for shot in shots])
    noise = shots[0].item.noise
    least = np.inf
    for corner in _corners(noise):
        expected = (1.0 + corner * slow) / (1.0 + noise.corner * slow)
        ratio = np.maximum(np.mean(squares / expected, axis=0), 1e-300)
        least = min(least, len(shots) * float(np.sum(ratio - 1.0 - np.log(ratio))))
    return least


def _by_order(shot: LinearisedShot, at: list[int]) -> Array:
    """Return what each order explains beyond those before it, in units of the noise. Shape (q,)."""
    inner = shot.matrix[np.ix_(at, at)]
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    values, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
    sound = (vectors * np.maximum(values, LEAST_SHARE)) @ vectors.T
    root = np.linalg.cholesky(sound)
    return np.square(solve_triangular(root, shot.vector[at] / scale, lower=True))


def _corners(noise: NoiseModel) -> Array:
    """Return the corners to try, from none to the largest that is allowed. [1/sample]"""
    largest = FURTHEST_CORNER if noise.corner_below is None else noise.corner_below
    return np.append(0.0, np.geomspace(LEAST_CORNER, max(largest, LEAST_CORNER), CORNERS_TRIED))


@lru_cache(maxsize=256)
def _slow_powers(samples: int) -> Array:
    """Return how much noise of density 1/f moves each order of a zero line. Shape (q,)."""
    return slow_powers(drift_basis(samples, max(BASELINE_ORDERS))[:, list(BASELINE_ORDERS)])
