"""The chance that any of many tests is as clear as the clearest, if there were only noise.

The tests of a residual ask overlapping columns, so their p-values go together. To first order all
of them are known functions of the whitened noise: noise is drawn, all tests are asked, and what
their smallest p-values do says how many independent tests they amount to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.stats import chi2 as chi2_distribution

from analysis.diagnosis.score_test.linearised import Linearised, Projection, ShotProjection

DRAWS = 200
"""The number of tests is known to its fourteenth part, and so is a p-value."""
SEED = 20_311
"""Any: it is kept, so that the same records have the same p-value."""

Array = NDArray[np.float64]
Part = tuple[str, str]


def family_wise(p_value: float, linearised: Linearised, parts: Sequence[Part]) -> float:
    r"""Return the chance that noise makes any of some tests as clear as the clearest.

    Parameters
    ----------
    p_value : float
        The smallest of all tests. [1]
    linearised : Linearised
        What was asked.
    parts : sequence of tuple
        (family, group) of each test.

    Returns
    -------
    float
        Uniform between 0 and 1 where there is only noise. [1]

    Notes
    -----
    .. math:: p = 1 - (1 - p_{min})^m

    of m independent tests; m is the one most likely to give the smallest p-values of noise that was
    drawn. Source: F. Dudbridge and B. P. C. Koeleman, Am. J. Hum. Genet. 75 (2004) 424.
    """
    return float(-np.expm1(independent_tests(linearised, parts) * np.log1p(-p_value)))


def independent_tests(linearised: Linearised, parts: Sequence[Part]) -> float:
    """Return how many independent tests some overlapping ones amount to.

    Parameters
    ----------
    linearised : Linearised
        What was asked.
    parts : sequence of tuple
        (family, group) of each test.

    Returns
    -------
    float
        Between 1 and their number.
    """
    scores = _drawn_scores(linearised, np.random.default_rng(SEED))
    least = np.min([_p_values(linearised, scores, part) for part in parts], axis=0)
    found = 1.0 / float(np.mean(-np.log1p(-np.minimum(least, 1.0 - 1e-12))))
    return min(max(found, 1.0), float(len(parts)))


def _drawn_scores(linearised: Linearised, rng: np.random.Generator) -> list[Array]:
    """Return what each shot's score would be in noise, globals fitted to it.

    Each of shape (s + q, draws): shared parameters, then columns.
    """
    precision = linearised.precision
    load = _drawn(rng, precision)
    whole = precision.copy()
    scores, chains = [], []
    for shot in linearised.shots:
        chain = np.zeros((shot.vector.size, precision.shape[0]))
        chain[: shot.chain.shape[0]] = shot.chain
        score = _drawn(rng, shot.matrix)
        whole += chain.T @ shot.matrix @ chain
        load += chain.T @ score
        scores.append(score)
        chains.append(chain)
    moved = np.linalg.lstsq(whole, load, rcond=None)[0]
    return [
        score - shot.matrix @ (chain @ moved)
        for score, shot, chain in zip(scores, linearised.shots, chains, strict=True)
    ]


def _drawn(rng: np.random.Generator, matrix: Array) -> Array:
    """Return draws of a Gaussian with a covariance. Shape (n, draws)."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    unit = np.where(scale > 0.0, scale, 1.0)
    # rounding and a coarse converter's stretches leave eigenvalues below zero
    values, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(scale[:, None] * (root @ rng.standard_normal((scale.size, DRAWS))))


def _p_values(linearised: Linearised, scores: list[Array], part: Part) -> Array:
    """Return the p-values of one test in every draw. Shape (draws,)."""
    family, scope = part
    at, _ = linearised.families[family]
    gain, dof = np.zeros(DRAWS), 0
    if scope == "shot":
        for shot, score in zip(linearised.shots, scores, strict=True):
            own = ShotProjection(shot, at)
            gain += own.gain(score[at])
            dof += own.rank
    else:
        system = linearised.system([part])
        load = np.zeros((system.whole.shape[0], DRAWS))
        for chain, score in zip(system.chains, scores, strict=True):
            load += np.asarray(csr_array(chain.T) @ score)  # next to nothing of a chain is not zero
        # the globals' own load is what fitting them has brought to nothing, priors included
        load[: system.globals_] = 0.0
        found = Projection(system.whole, system.globals_)
        gain, dof = found.gain(load), found.rank
    return np.asarray(chi2_distribution.sf(gain, dof)) if dof else np.ones(DRAWS)
