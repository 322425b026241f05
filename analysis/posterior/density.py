"""The log density that a fit maximises, for samplers of any kind.

Both are relative to the density at the fit, where they are 0; noise and priors are the fit's own,
widened as the fit's uncertainties were.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.aliases import Array
from analysis.errors import AnalysisError
from analysis.fit.blocks import linearise_shot
from analysis.fit.joint import total_cost
from analysis.fit.problem import FitShot
from analysis.fit.result import FitResult

_NEGLIGIBLE = 0.01
"""Fall of a shot's squares that is taken as promised; the density is then good to half a per cent
of itself, however far from linear the last step is."""
_NEWTON_STEPS = 8
"""Where as many do not reach the minimum, the globals are far from any that explain the shot."""


def require_a_fit(result: FitResult) -> None:
    """Refuse a fit that has no solution with an AnalysisError in the fit's own words."""
    if result.outcome.status == "not_evaluable":
        raise AnalysisError(f"There is no posterior: {result.outcome.message}")


class JointDensity:
    """The log posterior density of all parameters, with its gradient.

    ``names`` are the globals as in ``impactd-fit/1``, then each shot's own as ``shot[i].<name>``;
    ``mode``, shape (n,), is the fit. Without ``priors`` it leaves out what was known of the globals
    before the shots (``problem.prior_mean`` and ``problem.prior_precision``), for whoever states
    that anew; a shot's own priors, on its speed and restitution, stay.
    """

    def __init__(self, result: FitResult, *, priors: bool = True) -> None:
        require_a_fit(result)
        self.problem, fitted = result.problem, result.fitted
        self._globals = fitted.theta.size
        self._shape = fitted.nuisances.shape
        self._cost = fitted.cost
        self._blocks = fitted.blocks
        self._left_out = np.zeros_like(fitted.covariance)
        if not priors:
            self._left_out = self.problem.prior_precision
        self.mode = np.concatenate([fitted.theta, fitted.nuisances.ravel()])
        own = self.problem.model.nuisances
        self.names = list(self.problem.names) + [
            f"shot[{i}].{name}" for i in range(self._shape[0]) for name in own
        ]

    def split(self, x: Array) -> tuple[Array, Array]:
        """Return globals, shape (g,), and nuisances, shape (shots, q)."""
        return x[: self._globals], x[self._globals :].reshape(self._shape)

    def __call__(self, x: Array) -> float:
        """Return the log density relative to the fit's; minus infinity without a trace."""
        away = x[: self._globals] - self.problem.prior_mean
        cost = total_cost(self.problem, *self.split(x)) - float(away @ self._left_out @ away)
        return -0.5 * (cost - self._cost)

    def with_gradient(self, x: Array) -> tuple[float, Array]:
        """Return the log density and its gradient, as samplers with gradients take them.

        The density is minus infinity where the model has no trace; the gradient is then zero.
        """
        theta, nuisances = self.split(x)
        away = theta - self.problem.prior_mean
        pull = (self.problem.prior_precision - self._left_out) @ away
        cost, slope, own = float(away @ pull), -pull, np.zeros(self._shape)
        for i, item in enumerate(self.problem.shots):
            block = linearise_shot(self.problem, item, theta, nuisances[i])
            if block is None:
                return -math.inf, np.zeros_like(x)
            shared = block.chain.shape[0]
            cost += block.cost
            slope += block.chain.T @ block.vector[:shared]
            own[i] = block.vector[shared:]
        return -0.5 * (cost - self._cost), np.concatenate([slope, own.ravel()])

    def root(self) -> Array:
        """Return L with the covariance L L' of Laplace's approximation, priors included.

        Shape (n, n). In z, with x = mode + L z, the density is near a standard Gaussian.
        """
        size, own = self._globals, self._shape[1]
        matrix = np.zeros((self.mode.size, self.mode.size))
        matrix[:size, :size] = self.problem.prior_precision
        for i, block in enumerate(self._blocks):
            s = block.chain.shape[0]
            at = slice(size + i * own, size + (i + 1) * own)
            matrix[:size, :size] += block.chain.T @ block.matrix[:s, :s] @ block.chain
            cross = block.chain.T @ block.matrix[:s, s:]
            matrix[:size, at] = cross
            matrix[at, :size] = cross.T
            matrix[at, at] = block.matrix[s:, s:]
        return np.asarray(np.linalg.cholesky(np.linalg.inv(matrix)), dtype=np.float64)


class GlobalDensity:
    r"""The log posterior density of the globals, each shot's own parameters integrated out.

    ``mode``, shape (g,), and ``covariance`` are of Laplace's approximation, which is what the fit
    states. For each shot with cost c and Hessian H of its own parameters n (half of it, in the
    convention :math:`p \propto e^{-c/2}`), Laplace's integral over n is

    .. math:: \ln \int e^{-c/2} dn = -\tfrac12 \min_n c - \tfrac12 \ln \det H + const

    (Tierney & Kadane 1986). The minimum is searched by Newton steps from where the fit's linear
    response puts n; near the fit none is needed. Only n is taken for Gaussian, at each value of the
    globals anew; whatever makes the globals' posterior bend is kept.
    """

    def __init__(self, result: FitResult) -> None:
        require_a_fit(result)
        self.problem, self._fitted = result.problem, result.fitted
        self.names = list(self.problem.names)
        self.mode, self.covariance = self._fitted.theta, self._fitted.covariance
        self._follows = []
        for block in self._fitted.blocks:
            s = block.chain.shape[0]
            self._follows.append(
                np.linalg.solve(block.matrix[s:, s:], block.matrix[s:, :s]) @ block.chain
            )
        self._at_mode = 0.0
        self._at_mode = self(self.mode)

    def root(self) -> Array:
        """Return L with ``covariance`` L L', shape (g, g)."""
        return np.asarray(np.linalg.cholesky(self.covariance))

    def __call__(self, theta: Array) -> float:
        """Return the log density relative to the mode; minus infinity without a trace."""
        away = theta - self.problem.prior_mean
        found = -0.5 * float(away @ self.problem.prior_precision @ away)
        moved = theta - self.mode
        for i, item in enumerate(self.problem.shots):
            nuisance = self._fitted.nuisances[i] - self._follows[i] @ moved
            found -= 0.5 * self._integrated(item, theta, nuisance)
            if not math.isfinite(found):
                return -math.inf
        return found - self._at_mode

    def _integrated(self, item: FitShot, theta: Array, nuisance: Array) -> float:
        """Return -2 ln of a shot's integral, infinite where there is no trace."""
        for _ in range(_NEWTON_STEPS):
            block = linearise_shot(self.problem, item, theta, nuisance)
            if block is None:
                return math.inf
            s = block.chain.shape[0]
            inner, pull = block.matrix[s:, s:], block.vector[s:]
            step = np.linalg.solve(inner, pull)
            promised = float(pull @ step)
            if promised < _NEGLIGIBLE:
                return block.cost - promised + float(np.linalg.slogdet(inner)[1])
            nuisance = nuisance + step
        return math.inf
