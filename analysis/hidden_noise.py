"""Noise partly hidden by a converter's step, inferred from the codes that change.

Over a quiet stretch a coarse converter gives one code, and now and then its neighbour. How often it
does so bounds the noise; how these changes follow one another tells its colour.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from analysis.aliases import Array
from analysis.quantisation import Coarse

COARSE = 0.5
"""Noise below this share of the step, and the step counts: at half a step a resting signal keeps
3e-5 of the variance of the rounding error, see `analysis.quantisation.kept_share`."""
BLOCK = 256
"""Quiet samples that share one level: hum and drift move it little within so many."""
DOUBTED = 9.0
"""Fall of twice the logarithm of the likelihood, three standard deviations, that ends what the
noise may be."""
CODES_OF_COARSE = 6
"""Noise of half a step, with five standard deviations to either side, reaches so many codes."""
LEAST_CHANGES = 100
"""Samples off the level's own code from which colour is told: correlations are then good to 0.1."""
LAGS = 8
"""Samples over which colour is followed: the order of the whitening that it is for."""
SMALLEST_NOISE = 0.02
"""In steps; smaller noise is none beside a rounding error of 0.29."""
_SIGMAS = np.geomspace(SMALLEST_NOISE, 0.6, 81)
_CENTRES = np.linspace(-0.5, 0.5, 161)
_TERMS = 40


@lru_cache(maxsize=1)
def _log_shares() -> Array:
    """Return ln of the share of each code, for every noise and level; codes around the level's."""
    edges = np.arange(-CODES_OF_COARSE, CODES_OF_COARSE + 2) - 0.5
    below = norm.cdf((edges - _CENTRES[:, None]) / _SIGMAS[:, None, None])
    # upper tails by symmetry, so that they do not round to zero
    above = norm.sf((edges - _CENTRES[:, None]) / _SIGMAS[:, None, None])
    shares = np.maximum(np.diff(below, axis=-1), -np.diff(above, axis=-1))
    return np.asarray(np.log(np.maximum(shares, 1e-300)))


@dataclass(frozen=True)
class _Block:
    """How often each code was seen, around the most usual one, and products at each lag."""

    counts: NDArray[np.int64]
    products: Array


def hidden_noise(quiet: Sequence[Array], step: float) -> tuple[Coarse, Array] | None:
    """Return the noise that quiet stretches of a coarse converter allow.

    The quiet stretches are samples before anything happened. [unit of the signal]

    Returns
    -------
    covariance : ndarray, shape (LAGS + 1,)
        Of noise and rounding error together while the signal moves. [step^2] None for both where
        the noise is at least `COARSE`, or the codes move by more than such noise moves them.

    Notes
    -----
    The size by the likelihood of how often each code occurs, the level of each block at its best;
    as large as it may be, because what does not change a code is not seen. The colour by Mehler's
    expansion: rounded Gaussian noise of correlation r has the covariance sum a_k^2 r^k, a_k the
    staircase's Hermite coefficients (Van Vleck & Middleton, Proc. IEEE 54 (1966) 2). Validation:
    noise of known size and colour through a rounding in ``tests/analysis/test_quantisation.py``.
    """
    blocks = _blocks(quiet, step)
    if not blocks:
        return None
    table = _log_shares()
    total = np.zeros(_SIGMAS.size)
    of_block: dict[bytes, Array] = {}
    for block in blocks:
        key = block.counts.tobytes()
        if key not in of_block:
            of_block[key] = table @ block.counts
        total += of_block[key].max(axis=1)
    allowed = np.flatnonzero(2.0 * (total.max() - total) <= DOUBTED)
    at = int(allowed[-1])
    rms, least = float(_SIGMAS[at]), float(_SIGMAS[allowed[0]])
    if rms >= COARSE:
        return None
    centres = np.array([_CENTRES[of_block[b.counts.tobytes()][at].argmax()] for b in blocks])
    covariance = rms**2 * _correlations(blocks, centres, rms)
    covariance[0] += 1.0 / 12.0
    return Coarse(step, rms, least), covariance


def _blocks(quiet: Sequence[Array], step: float) -> list[_Block]:
    """Return quiet stretches by blocks; none where a block has too many codes."""
    found = []
    width = 2 * CODES_OF_COARSE + 1
    for stretch in quiet:
        codes = np.rint((stretch - stretch[:1]) / step).astype(np.int64)
        for at in range(0, codes.size, BLOCK):
            seen = codes[at : at + BLOCK]
            seen = seen - int(np.median(seen))
            if np.abs(seen).max() > CODES_OF_COARSE // 2:
                return []
            own = seen - seen.mean()
            products = [own[lag:] @ own[: max(own.size - lag, 0)] for lag in range(LAGS + 1)]
            counts = np.bincount(seen + CODES_OF_COARSE, minlength=width)
            found.append(_Block(counts, np.array(products)))
    return found


def _correlations(blocks: Sequence[_Block], centres: Array, noise: float) -> Array:
    """Return the noise's own correlations at lags 0 to `LAGS`; 0 where too few codes change."""
    found = np.zeros(LAGS + 1)
    found[0] = 1.0
    samples = np.array([b.counts.sum() for b in blocks])
    changes = samples.sum() - sum(int(b.counts[CODES_OF_COARSE]) for b in blocks)
    if changes < LEAST_CHANGES:
        return found
    powers = samples @ _hermite_powers(centres, noise)
    reached = np.linspace(-0.95, 0.95, 191)
    curve = np.polynomial.polynomial.polyval(reached, np.concatenate([[0.0], powers]))
    products = np.sum([b.products for b in blocks], axis=0)
    found[1:] = np.interp(products[1:], curve, reached)
    return found


def _hermite_powers(centres: Array, noise: float) -> Array:
    """Return a_k^2 for k = 1 .. `_TERMS` of the staircase around each level. Shape (c, terms)."""
    edges = np.arange(-CODES_OF_COARSE, CODES_OF_COARSE) + 0.5
    z = (edges - centres[:, None]) / noise
    # a_k = sum over edges of phi(z) He_(k-1)(z) / sqrt(k!), by the recursion of scaled polynomials
    before, here = np.zeros_like(z), norm.pdf(z)
    found = np.empty((centres.size, _TERMS))
    for k in range(1, _TERMS + 1):
        found[:, k - 1] = here.sum(axis=1) ** 2
        scale = math.sqrt(k + 1.0)
        before, here = here, (z * here - (k - 1) / math.sqrt(k) * before) / scale
    return found
