"""Draws of a fit's globals: from Laplace's approximation, and from the posterior itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.errors import AnalysisError
from analysis.fit.result import FitResult
from analysis.posterior.density import GlobalDensity, JointDensity, require_a_fit

TAIL_DEGREES = 5.0
"""Of the multivariate t that proposes independent draws. Its tails are heavier than any Gaussian's,
so that no place where the posterior is wider than Laplace's is left out; in 11 dimensions it still
has two thirds of its proposals accepted where the posterior is a Gaussian."""
WALKERS_PER_DIMENSION = 2
"""The least that emcee takes for its stretch moves."""


@dataclass(frozen=True)
class Draws:
    """Draws of the globals."""

    names: list[str]
    theta: Array
    """In the fit's coordinates. Shape (chains, draws, g)."""
    log_density: Array
    """Relative to the mode. Shape (chains, draws)."""
    method: str
    """``laplace`` or ``emcee``."""
    accepted: float
    """Share of the proposals that were accepted; 1 for independent draws."""


def laplace_draws(result: FitResult, count: int = 2000, *, seed: int) -> Draws:
    """Return independent draws, one chain, from the Gaussian that the fit states."""
    require_a_fit(result)
    mode, covariance = result.fitted.theta, result.fitted.covariance
    root = np.linalg.cholesky(covariance)
    unit = np.random.default_rng(seed).standard_normal((count, mode.size))
    theta = mode + unit @ root.T
    log_density = -0.5 * np.sum(unit**2, axis=1)
    return Draws(list(result.problem.names), theta[None], log_density[None], "laplace", 1.0)


def posterior_draws(
    result: FitResult,
    steps: int = 100,
    *,
    seed: int,
    every_parameter: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Draws:
    """Return draws from the posterior, by emcee.

    One chain a walker. Walkers begin at draws of a Gaussian about the fit; the first fifth of their
    steps is left out.

    Parameters
    ----------
    steps : int, optional
        Of each walker; there are two walkers a parameter.
    every_parameter : bool, optional
        Draw each shot's own parameters too instead of integrating them by Laplace's method. For a
        few shots: the stretch move needs ever more steps in tens of dimensions.

    Raises
    ------
    AnalysisError
        If emcee is not installed, or the fit has no solution.

    Notes
    -----
    Half of the steps are the affine-invariant stretch move (Goodman & Weare 2010), half are
    independent proposals from a multivariate t about the fit. Both follow a straight ridge and
    no bent one. A shot tells 1/E* = 1/E'_sphere + 1/E'_surface to some 1e-5, which is a line in
    the compliances 1/E' and a sharp bend in ln E'; so walkers go through compliances.
    """
    try:
        import emcee  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise AnalysisError(
            "Draws from the posterior need emcee: pip install 'impactd[mcmc]'."
        ) from error
    density = JointDensity(result) if every_parameter else GlobalDensity(result)
    mode = density.mode
    path = _Path(density, mode)
    root = path.signs[:, None] * density.root()
    rng = np.random.default_rng(seed)
    walkers = WALKERS_PER_DIMENSION * mode.size + 2
    start = rng.standard_normal((walkers, mode.size)) @ root.T
    start[(start[:, path.moduli] <= -1.0).any(axis=1)] *= -1.0  # stiffer than infinitely stiff
    sampler = emcee.EnsembleSampler(
        walkers,
        mode.size,
        path,
        moves=[
            (emcee.moves.MHMove(_Independent(root)), 0.5),
            (emcee.moves.StretchMove(), 0.5),
        ],
    )
    sampler._random = np.random.RandomState(seed)
    for count, _ in enumerate(sampler.sample(start, iterations=steps), start=1):
        if progress is not None:
            progress("posterior", count / steps)
    kept = steps // 5
    size = len(result.problem.names)
    walked = sampler.get_chain(discard=kept)
    theta = path.parameters(walked)[..., :size]
    log_density = sampler.get_log_prob(discard=kept) - path.log_slope(walked)
    return Draws(
        list(result.problem.names),
        np.ascontiguousarray(np.swapaxes(theta, 0, 1)),
        np.ascontiguousarray(np.swapaxes(log_density, 0, 1)),
        "emcee",
        float(np.mean(sampler.acceptance_fraction)),
    )


class _Path:
    """The coordinates of the walkers: zero at the fit, relative compliances for moduli."""

    def __init__(self, density: JointDensity | GlobalDensity, mode: Array) -> None:
        self._density, self._mode = density, mode
        self.moduli = [j for j, name in enumerate(density.problem.names) if name.is_modulus]
        self.signs = np.ones(mode.size)
        self.signs[self.moduli] = -1.0  # a stiffer material gives way less

    def parameters(self, walked: Array) -> Array:
        """Return the fit's coordinates; the last axis keeps its order."""
        found = self._mode + walked
        compliance = 1.0 + walked[..., self.moduli]
        found[..., self.moduli] = self._mode[self.moduli] - np.log(compliance)
        return np.asarray(found)

    def log_slope(self, walked: Array) -> Array:
        """Return ln |d parameters / d walked|, which turns one density into the other."""
        return np.asarray(-np.sum(np.log1p(walked[..., self.moduli]), axis=-1))

    def __call__(self, walked: Array) -> float:
        if (walked[self.moduli] <= -1.0).any():  # a material stiffer than infinitely stiff
            return -math.inf
        return self._density(self.parameters(walked)) + float(self.log_slope(walked))


class _Independent:
    """Proposals that do not depend on where a walker is, and the ratio that corrects for it."""

    def __init__(self, root: Array) -> None:
        self._root = root

    def __call__(self, at: Array, rng: np.random.RandomState) -> tuple[Array, Array]:
        unit = rng.standard_normal(at.shape)
        spread = np.sqrt(rng.chisquare(TAIL_DEGREES, at.shape[0]) / TAIL_DEGREES)
        proposed = (unit / spread[:, None]) @ self._root.T
        return proposed, self._log_t(at) - self._log_t(proposed)

    def _log_t(self, at: Array) -> Array:
        unit = np.linalg.solve(self._root, at.T)
        power = -0.5 * (TAIL_DEGREES + at.shape[1])
        return np.asarray(power * np.log1p(np.sum(unit**2, axis=0) / TAIL_DEGREES))


def interval95(values: Array) -> tuple[float, float]:
    """Return the 2.5 % and the 97.5 % quantile of draws."""
    low, high = np.quantile(values, [0.025, 0.975])
    if not math.isfinite(float(high - low)):
        raise AnalysisError("Some draws are no numbers; the model has no trace there.")
    return float(low), float(high)
