r"""From reduced moduli of pairs to moduli of materials: a network of spheres and surfaces.

A contact knows only

.. math:: 1/E^*_{ij} = 1/E'_i + 1/E'_j, \quad E' = E / (1 - \nu^2),

which is additive, so pairs that hang together and contain a reference material fix every
plane-strain modulus. All observations, the stated moduli of the references and the common error of
each calibration are adjusted together, in logarithms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Sphere, Surface
from analysis.errors import AnalysisError
from analysis.fit.estimates import HSD_FIELDS
from analysis.fit.problem import SENSOR_FIELDS, UNKNOWN_LOG_U, Prior, modulus_prior
from analysis.fit.result import FitResult
from analysis.moduli_result import ModuliResult, Network, PairCheck

Json = dict[str, Any]
Array = NDArray[np.float64]
SensorCovariance = Array | Mapping[str, Array]

ITERATIONS = 50
TOLERANCE = 1e-10


@dataclass(frozen=True)
class PairObservation:
    """The reduced modulus that one fit found for one pair.

    Attributes
    ----------
    sphere, surface : str
        Names of the materials.
    log_reduced_modulus : float
        ln E*, E* in Pa.
    u_random : float
        Standard uncertainty of ln E* from this recording alone. [1]
    sensitivity : ndarray, shape (4,) or (1,)
        d ln E* / d ln(M, k, mu, c) for KV, d ln E* / d ln S for HSD: how E* follows an error of
        the calibration.
    shot : str
        Which recording.
    model : str
        Model of the fit.
    u_calibration : float
        Standard uncertainty of ln E* from the calibration, used where no covariance of the cell is
        at hand; then counted as one error common to all observations of a calibration. [1]
    calibration : str
        Which calibration; observations of different ones have different common errors.
    """

    sphere: str
    surface: str
    log_reduced_modulus: float
    u_random: float
    sensitivity: Array
    shot: str
    model: str
    u_calibration: float = 0.0
    calibration: str = ""

    @property
    def pair(self) -> str:
        """Return the pair's key."""
        return f"{self.sphere}/{self.surface}"


def observations_from_fit(
    fit: FitResult | Json, *, shot: str, calibration: str = ""
) -> tuple[PairObservation, ...]:
    """Return what a fit says about each of its pairs.

    Parameters
    ----------
    fit : FitResult or dict
        A fit with ``by_pair=True`` (else the fit has already used the references' moduli, which
        the network would use again), or its JSON.
    shot : str
        How messages call the recording.
    calibration : str
        Which calibration the cell's values came from.

    Returns
    -------
    tuple of PairObservation
        Empty where the fit did not converge or is in reduced units.
    """
    found: Json = fit if isinstance(fit, dict) else fit.to_json()
    if found["outcome"]["status"] != "converged":
        return ()
    observations = []
    for entry in found["pairs"].values():
        modulus = entry.get("reduced_modulus_Pa")
        if not modulus:
            continue
        value = float(modulus["value"])
        u, u_cell = float(modulus["u"]) / value, float(entry["u_calibration_Pa"]) / value
        by_field = entry["d_ln_reduced_modulus_d_ln_sensor"]
        fields = HSD_FIELDS if HSD_FIELDS[0] in by_field else SENSOR_FIELDS
        observations.append(
            PairObservation(
                sphere=str(entry["sphere"]),
                surface=str(entry["surface"]),
                log_reduced_modulus=math.log(value),
                u_random=math.sqrt(max(u**2 - u_cell**2, 1e-12)),
                sensitivity=np.array([float(by_field[name]) for name in fields]),
                shot=shot,
                model=str(found["model"]),
                u_calibration=u_cell,
                calibration=calibration,
            )
        )
    return tuple(observations)


def observation_from_fit(
    fit: FitResult | Json, *, shot: str, calibration: str = ""
) -> PairObservation | None:
    """Return what a fit of one shot says about its pair.

    Parameters
    ----------
    fit : FitResult or dict
        As in `observations_from_fit`, of one pair.
    shot : str
        How messages call the recording.
    calibration : str
        Which calibration the cell's values came from.

    Returns
    -------
    PairObservation or None
        None where the fit did not converge or is in reduced units.
    """
    found = observations_from_fit(fit, shot=shot, calibration=calibration)
    return found[0] if found else None


@dataclass(frozen=True)
class _System:
    """The adjustment's fixed part: columns are materials, then the calibrations' errors."""

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


def _system(
    observations: Sequence[PairObservation],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
    covariance: SensorCovariance | None,
) -> _System:
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
    return _System(observations, names, priors, left, right, common, weight, precision, mean)


def _linearise(system: _System, x: Array) -> tuple[Array, Array]:
    """Return (residual, design) at x; residual is observed minus computed."""
    rows = np.arange(len(system.observations))
    a, b = np.exp(-x[system.left]), np.exp(-x[system.right])
    n = len(system.names)
    design = np.zeros((rows.size, x.size))
    design[rows, system.left] += a / (a + b)
    design[rows, system.right] += b / (a + b)
    design[:, n:] = system.common
    observed = np.array([o.log_reduced_modulus for o in system.observations])
    return observed + np.log(a + b) - system.common @ x[n:], design


def _cost(system: _System, x: Array) -> float:
    r, _ = _linearise(system, x)
    d = x - system.mean
    return float(system.weight @ r**2 + d @ system.precision @ d)


def _solve(system: _System) -> tuple[Array, Array]:
    """Return the adjusted values and their covariance (Gauss-Newton, steps halved if uphill)."""
    x = system.mean.copy()
    cost = _cost(system, x)
    for _ in range(ITERATIONS):
        r, design = _linearise(system, x)
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
    _, design = _linearise(system, x)
    normal = design.T @ (system.weight[:, None] * design) + system.precision
    return x, np.asarray(np.linalg.inv(normal))


def _checks(system: _System, x: Array, covariance: Array) -> tuple[PairCheck, ...]:
    """Return how each pair's observations agree with all the rest.

    The residuals' covariance is that of the observations less that of their adjusted values; a pair
    that nothing else controls has none left and no score.
    """
    r, design = _linearise(system, x)
    found = []
    pairs = list(dict.fromkeys(o.pair for o in system.observations))
    for pair in pairs:
        rows = np.array([i for i, o in enumerate(system.observations) if o.pair == pair])
        share = system.weight[rows] / float(system.weight[rows].sum())
        mean_design = share @ design[rows]
        own = float(share**2 @ (1 / system.weight[rows]))
        left = own - float(mean_design @ covariance @ mean_design)
        residual = float(share @ r[rows])
        log = float(share @ [system.observations[i].log_reduced_modulus for i in rows])
        scatter = float(system.weight[rows] @ (r[rows] - residual) ** 2)
        first = system.observations[rows[0]]
        found.append(
            PairCheck(
                sphere=first.sphere,
                surface=first.surface,
                observations=int(rows.size),
                log_observed=log,
                log_adjusted=log - residual,
                u_observed=math.sqrt(own),
                score=residual / math.sqrt(left) if left > 1e-6 * own else None,
                scatter_chi2=scatter,
            )
        )
    return tuple(found)


def _network(system: _System, x: Array, covariance: Array) -> Network:
    """Return chi2 of observations, references and calibrations, and its degrees of freedom."""
    r, design = _linearise(system, x)
    stated = system.precision.copy()
    for j, prior in enumerate(system.priors):
        if prior is None:
            stated[j, j] = 0.0  # the weak prior of an unknown is no observation
    d = x - system.mean
    chi2 = float(system.weight @ r**2 + d @ stated @ d)
    information = design.T @ (system.weight[:, None] * design) + stated
    fitted = float(np.trace(covariance @ information))
    references = sum(p is not None for p in system.priors)
    count = len(system.observations) + references + system.common.shape[1]
    return Network(chi2, max(round(count - fitted), 0))


def _anchored(system: _System) -> list[bool]:
    """Tell which materials hang together with a reference through dropped pairs."""
    reached = [p is not None for p in system.priors]
    for _ in system.names:
        for a, b in zip(system.left, system.right, strict=True):
            reached[a] = reached[b] = reached[a] or reached[b]
    return reached


def adjust_moduli(
    observations: Sequence[PairObservation],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
    sensor_covariance: SensorCovariance | None = None,
) -> ModuliResult:
    """Return every material's modulus from the reduced moduli of pairs.

    Parameters
    ----------
    observations : sequence of PairObservation
        At least one, all of one model.
    spheres, surfaces : mapping
        By name; a stated modulus makes a material a reference of that width.
    sensor_covariance : ndarray, shape (4, 4) or (1, 1), or mapping of calibration to such, optional
        Covariance of ln(M, k, mu, c), or of ln S for HSD. Without it each observation's
        ``u_calibration`` counts as one error common to its calibration. Either way the
        calibration's uncertainty is not averaged away.

    Returns
    -------
    ModuliResult
        Moduli, full covariance, the network's chi2 and the pairs that contradict it.

    Raises
    ------
    AnalysisError
        If there is no observation, a material is unknown, or models are mixed.

    Notes
    -----
    Source: physics of Eq. 4; generalised least squares with the common errors as parameters, scores
    after W. Baarda, A testing procedure for use in geodetic networks (1968). Validation:
    ``tests/analysis/test_moduli.py``.
    """
    if not observations:
        raise AnalysisError("There is no reduced modulus to adjust; fit some shots first.")
    models = sorted({o.model for o in observations})
    if len(models) > 1:
        raise AnalysisError(
            f"Reduced moduli of different models ({', '.join(models)}) cannot be adjusted together;"
            " choose one."
        )
    system = _system(observations, spheres, surfaces, sensor_covariance)
    x, covariance = _solve(system)
    n = len(system.names)
    return ModuliResult(
        model=models[0],
        names=tuple(system.names),
        log_plane_strain=x[:n],
        covariance=covariance[:n, :n],
        network=_network(system, x, covariance),
        checks=_checks(system, x, covariance),
        anchored=tuple(_anchored(system)),
        spheres=dict(spheres),
        surfaces=dict(surfaces),
        shots=tuple(dict.fromkeys(o.shot for o in observations)),
        calibrations=tuple(sorted({o.calibration for o in observations if o.calibration})),
    )
