"""The adjustment behind the moduli: observation equations and their least-squares solution."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Sphere, Surface
from analysis.errors import AnalysisError
from analysis.fit.problem import UNKNOWN_LOG_U, Prior, modulus_prior
from analysis.pair_observation import PairObservation

Array = NDArray[np.float64]
SensorCovariance = Array | Mapping[str, Array]

ITERATIONS = 50
TOLERANCE = 1e-10


@dataclass(frozen=True)
class System:
    """The adjustment's fixed part; its columns are materials, then the calibrations' errors.

    Attributes
    ----------
    observations : sequence of PairObservation
        One row each.
    names : list of str
        Materials.
    priors : list of Prior or None
        Stated ln E' by material.
    left, right : ndarray of int, shape (rows,)
        Columns of sphere and surface.
    common : ndarray, shape (rows, c)
        How observations follow the calibrations' errors.
    weight : ndarray, shape (rows,)
        1 / u_random^2.
    precision, mean : ndarray, shape (n + c, n + c), (n + c,)
        Of what is known of the columns beforehand.
    """

    observations: Sequence[PairObservation]
    names: list[str]
    priors: list[Prior | None]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    common: Array
    weight: Array
    precision: Array
    mean: Array


def _common_errors(
    observations: Sequence[PairObservation], covariance: SensorCovariance | None
) -> tuple[Array, Array]:
    """Return how observations follow the calibrations' errors, and those errors' precision."""
    columns: list[Array] = []
    blocks: list[Array] = []
    for calibration in sorted({o.calibration for o in observations}):
        known = covariance.get(calibration) if isinstance(covariance, Mapping) else covariance
        mine = np.array([o.calibration == calibration for o in observations])
        if known is None:
            # one error common to all; the sign cannot matter to a fully correlated part
            column = np.array([[o.u_calibration] for o in observations])
            inner = np.eye(1)
        else:
            width = known.shape[0]
            wrong = [o.shot for o in observations if o.sensitivity.size != width]
            if wrong:
                raise AnalysisError(
                    f"{wrong[0]}: its sensitivity has not the cell covariance's {width} parameters;"
                    " was it fitted with another model than the calibration?"
                )
            column = np.array([o.sensitivity for o in observations])
            inner = np.asarray(np.linalg.inv(known))
        columns.append(column * mine[:, None])
        blocks.append(inner)
    sizes = [b.shape[0] for b in blocks]
    precision = np.zeros((sum(sizes), sum(sizes)))
    at = 0
    for block, size in zip(blocks, sizes, strict=True):
        precision[at : at + size, at : at + size] = block
        at += size
    return np.hstack(columns), precision


def _start(
    observations: Sequence[PairObservation],
    names: list[str],
    priors: list[Prior | None],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
) -> Array:
    """Give every unknown modulus what the pairs leave for it."""
    inverse = np.array([math.exp(-p.mean) if p else math.nan for p in priors])
    totals = np.exp([-o.log_reduced_modulus for o in observations])
    for _ in range(2 + len(names)):
        for j, prior in enumerate(priors):
            if prior is not None:
                continue
            others = np.where(left == j, right, left)
            rows = (left == j) | (right == j)
            rest = np.where(np.isnan(inverse[others]), 0.5 * totals, inverse[others])
            inverse[j] = float(np.median(np.maximum(totals - rest, 0.1 * totals)[rows]))
    return np.asarray(-np.log(inverse))


def build(
    observations: Sequence[PairObservation],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
    covariance: SensorCovariance | None,
) -> System:
    """Return the network's equations.

    Parameters
    ----------
    observations : sequence of PairObservation
        At least one.
    spheres, surfaces : mapping
        By name.
    covariance : ndarray, mapping or None
        As `analysis.moduli.adjust_moduli` takes it.

    Returns
    -------
    System
        Ready for `solve`.

    Raises
    ------
    AnalysisError
        If a material is unknown or a sensitivity does not fit the covariance.
    """
    names = sorted({f"sphere.{o.sphere}" for o in observations})
    names += sorted({f"surface.{o.surface}" for o in observations})
    priors: list[Prior | None] = []
    for name in names:
        side, _, plain = name.partition(".")
        material = (spheres if side == "sphere" else surfaces).get(plain)
        if material is None:
            raise AnalysisError(
                f"The {side} {plain!r} was dropped but is not among the materials; add it to the "
                "materials file (without a modulus, if that is what is sought)."
            )
        priors.append(modulus_prior(material.youngs_modulus_pa, material.poissons_ratio))
    left = np.array([names.index(f"sphere.{o.sphere}") for o in observations])
    right = np.array([names.index(f"surface.{o.surface}") for o in observations])
    common, inner = _common_errors(observations, covariance)
    size = len(names) + inner.shape[0]
    precision, mean = np.zeros((size, size)), np.zeros(size)
    precision[len(names) :, len(names) :] = inner
    mean[: len(names)] = _start(observations, names, priors, left, right)
    for j, prior in enumerate(priors):
        precision[j, j] = prior.u**-2 if prior else UNKNOWN_LOG_U**-2
    weight = np.array([o.u_random**-2 for o in observations])
    return System(observations, names, priors, left, right, common, weight, precision, mean)


def linearise(system: System, x: Array) -> tuple[Array, Array]:
    """Return residuals and design at x.

    Parameters
    ----------
    system : System
        The network.
    x : ndarray, shape (n + c,)
        ln E' of the materials, then the calibrations' errors.

    Returns
    -------
    residual : ndarray, shape (rows,)
        Observed minus computed ln E*.
    design : ndarray, shape (rows, n + c)
        d computed / d x.
    """
    rows = np.arange(len(system.observations))
    a, b = np.exp(-x[system.left]), np.exp(-x[system.right])
    n = len(system.names)
    design = np.zeros((rows.size, x.size))
    design[rows, system.left] += a / (a + b)
    design[rows, system.right] += b / (a + b)
    design[:, n:] = system.common
    observed = np.array([o.log_reduced_modulus for o in system.observations])
    return observed + np.log(a + b) - system.common @ x[n:], design


def _cost(system: System, x: Array) -> float:
    r, _ = linearise(system, x)
    d = x - system.mean
    return float(system.weight @ r**2 + d @ system.precision @ d)


def solve(system: System) -> tuple[Array, Array]:
    """Return the adjusted values and their covariance (Gauss-Newton, steps halved if uphill).

    Parameters
    ----------
    system : System
        The network.

    Returns
    -------
    x, covariance : ndarray, shape (n + c,), (n + c, n + c)
        By column.
    """
    x = system.mean.copy()
    cost = _cost(system, x)
    for _ in range(ITERATIONS):
        r, design = linearise(system, x)
        normal = design.T @ (system.weight[:, None] * design) + system.precision
        step = np.linalg.solve(
            normal, design.T @ (system.weight * r) - system.precision @ (x - system.mean)
        )
        length = 1.0
        while length > 1e-6 and not _cost(system, x + length * step) <= cost:
            length /= 2
        if length <= 1e-6:
            break
        x = x + length * step
        cost = _cost(system, x)
        if float(np.abs(step).max()) < TOLERANCE:
            break
    _, design = linearise(system, x)
    normal = design.T @ (system.weight[:, None] * design) + system.precision
    return x, np.asarray(np.linalg.inv(normal))
