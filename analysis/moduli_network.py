"""The adjustment behind the moduli: observation equations and their least-squares solution."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Array
from analysis.campaign import Sphere, Surface
from analysis.errors import AnalysisError
from analysis.fit.freed_inputs import without_inputs
from analysis.fit.problem import UNKNOWN_LOG_U, Prior, modulus_prior
from analysis.pair_observation import PairObservation
from analysis.parameters import ParameterName, of_material

SensorCovariance = Array | Mapping[str, Array]
CalibrationInputs = Mapping[str, Array]
"""Change of the logarithms that a calibration found, by one u of each input it rests on."""

ITERATIONS = 50
TOLERANCE = 1e-10
ROUNDING = 1e-13
"""A decrease of chi2 by this share of it drowns in the rounding of its sum: no search along the
step could see it. With chi2 = 1e4 the step is 3e-5 of the standard uncertainties."""


@dataclass(frozen=True)
class Block:
    """The observations under one calibration, and how they follow common errors."""

    rows: NDArray[np.int64]
    """Which observations, shape (m,)."""
    columns: NDArray[np.int64]
    """Its calibration's errors, and those of stated inputs, among all common errors. Shape
    (width,)."""
    slopes: Array
    """d ln E* / d error. Shape (m, width)."""


@dataclass(frozen=True)
class System:
    """The adjustment's fixed part; its columns are materials, then the calibrations' errors."""

    names: list[ParameterName]
    priors: list[Prior | None]
    """Stated ln E' by material."""
    pairs: list[tuple[str, str]]
    """Sphere and surface of each pair, in the order of first appearance."""
    pair: NDArray[np.int64]
    """Each observation's pair. Shape (rows,)."""
    left: NDArray[np.int64]
    """Each pair's column of the sphere. Shape (pairs,)."""
    right: NDArray[np.int64]
    """Each pair's column of the surface. Shape (pairs,)."""
    group: NDArray[np.int64]
    """Each observation's pair and calibration, as one number below ``groups``. Shape (rows,)."""
    group_pair: NDArray[np.int64]
    """Each group's pair. Shape (groups,)."""
    blocks: tuple[Block, ...]
    observed: Array
    """ln E*, shape (rows,)."""
    weight: Array
    """1 / u_random^2. Shape (rows,)."""
    precision: Array
    """Of what is known of the columns beforehand, shape (n + c, n + c)."""
    mean: Array
    """Of the same, shape (n + c,)."""
    calibrations: tuple[str, ...]
    inputs: tuple[str, ...]
    """Names of the last columns; the columns of the calibrations' errors come before these."""


@dataclass(frozen=True)
class Groups:
    r"""The observations of a system, summed over each pair under each calibration.

    All observations of a group have the same slopes with respect to the moduli, and those with
    respect to the calibration's errors e do not depend on the point. With the group's weighted
    means the cost is therefore

    .. math:: \sum_g W_g \bar r_g^2 + q - 2 b^T e + e^T S e,

    whose last three terms are the observations about their group's mean. It is exact, and an
    iteration costs as many rows as there are groups, however many shots were dropped.
    """

    weight: Array
    """Sum of weights, shape (groups,)."""
    observed: Array
    """Weighted mean of ln E*, shape (groups,)."""
    common: Array
    """Weighted mean of how observations follow the calibrations' errors. Shape (groups, c)."""
    scatter: Array
    """S, shape (c, c)."""
    slope: Array
    """b, shape (c,)."""
    rest: float


def grouped(system: System) -> Groups:
    """Return a system's observations summed by group, in the order of the groups' numbers."""
    count, errors = system.group_pair.size, system.precision.shape[0] - len(system.names)
    weight = np.asarray(np.bincount(system.group, system.weight, count), dtype=np.float64)
    observed = np.bincount(system.group, system.weight * system.observed, count) / weight
    common = np.zeros((count, errors))
    scatter, slope = np.zeros((errors, errors)), np.zeros(errors)
    about_mean = system.observed - observed[system.group]
    for block in system.blocks:
        at, w = system.group[block.rows], system.weight[block.rows]
        for i, values in enumerate(block.slopes.T):
            common[:, block.columns[i]] += np.bincount(at, w * values, count) / weight
        d = block.slopes - common[np.ix_(at, block.columns)]
        scatter[np.ix_(block.columns, block.columns)] += d.T @ (w[:, None] * d)
        slope[block.columns] += d.T @ (w * about_mean[block.rows])
    return Groups(weight, observed, common, scatter, slope, float(system.weight @ about_mean**2))


def _blocks(
    observations: Sequence[PairObservation],
    covariance: SensorCovariance | None,
    calibrated_by: Mapping[str, CalibrationInputs],
    calibrations: Sequence[str],
    inputs: Sequence[str],
) -> tuple[tuple[Block, ...], NDArray[np.int64], Array]:
    """Return each calibration's block, each observation's calibration, the errors' precision.

    The errors of stated inputs come last, in units of their standard uncertainty: they are common
    to all calibrations, and to the shots that a calibration rests on itself.
    """
    numbers = {name: i for i, name in enumerate(calibrations)}
    calibration = np.array([numbers[o.calibration] for o in observations])
    blocks: list[Block] = []
    inner: list[Array] = []
    owns: list[Array] = []
    at = 0
    for number, name in enumerate(calibrations):
        known = covariance.get(name) if isinstance(covariance, Mapping) else covariance
        rows = np.flatnonzero(calibration == number)
        mine = [observations[i] for i in rows.tolist()]
        own = np.array([[o.inputs.get(one, 0.0) for one in inputs] for o in mine])
        if known is None:
            # one error common to all; the sign cannot matter to a fully correlated part
            slopes = np.array([[o.u_calibration] for o in mine])
            inner.append(np.eye(1))
        else:
            width = known.shape[0]
            wrong = [o.shot for o in mine if o.sensitivity.size != width]
            if wrong:
                raise AnalysisError(
                    f"{wrong[0]}: its sensitivity has not the cell covariance's {width} parameters;"
                    " was it fitted with another model than the calibration?"
                )
            slopes = np.array([o.sensitivity for o in mine])
            cell = calibrated_by.get(name, {})
            if cell:
                follows = np.array([cell.get(one, np.zeros(width)) for one in inputs])
                own = own + slopes @ follows.T
                known = without_inputs(known, follows)
            inner.append(np.asarray(np.linalg.inv(known)))
        blocks.append(Block(rows, np.arange(at, at + slopes.shape[1]), slopes))
        owns.append(own)
        at += slopes.shape[1]
    precision = np.eye(at + len(inputs))
    for block, one in zip(blocks, inner, strict=True):
        precision[np.ix_(block.columns, block.columns)] = one
    last = np.arange(at, at + len(inputs))
    whole = tuple(
        Block(b.rows, np.concatenate([b.columns, last]), np.hstack([b.slopes, own]))
        for b, own in zip(blocks, owns, strict=True)
    )
    return whole, calibration, precision


def _start(
    observed: Array,
    priors: list[Prior | None],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
) -> Array:
    """Give every unknown modulus what the pairs leave for it."""
    inverse = np.array([math.exp(-p.mean) if p else math.nan for p in priors])
    totals = np.exp(-observed)
    for _ in range(2 + len(priors)):
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
    calibrated_by: Mapping[str, CalibrationInputs] | None = None,
) -> System:
    """Return the network's equations, ready for `solve`.

    ``covariance`` and ``calibrated_by`` are as `analysis.moduli.adjust_moduli` takes them. An
    AnalysisError says that a material is unknown or that a sensitivity does not fit the covariance.
    """
    names = sorted({of_material("sphere", o.sphere) for o in observations})
    names += sorted({of_material("surface", o.surface) for o in observations})
    priors: list[Prior | None] = []
    for name in names:
        material = (spheres if name.kind == "sphere" else surfaces).get(name.owner)
        if material is None:
            raise AnalysisError(
                f"The {name.kind} {name.owner!r} was dropped but is not among the materials; add "
                "it to the materials file (without a modulus, if that is what is sought)."
            )
        priors.append(modulus_prior(material.youngs_modulus_pa, material.poissons_ratio))
    pairs = list(dict.fromkeys((o.sphere, o.surface) for o in observations))
    numbers = {pair: i for i, pair in enumerate(pairs)}
    pair = np.array([numbers[o.sphere, o.surface] for o in observations])
    left = np.array([names.index(of_material("sphere", sphere)) for sphere, _ in pairs])
    right = np.array([names.index(of_material("surface", surface)) for _, surface in pairs])
    known = calibrated_by or {}
    calibrations = sorted({o.calibration for o in observations})
    inputs = sorted({one for o in observations for one in o.inputs}.union(*known.values()))
    blocks, calibration, inner = _blocks(observations, covariance, known, calibrations, inputs)
    together, group = np.unique(pair + len(pairs) * calibration, return_inverse=True)
    observed = np.array([o.log_reduced_modulus for o in observations])
    size = len(names) + inner.shape[0]
    precision, mean = np.zeros((size, size)), np.zeros(size)
    precision[len(names) :, len(names) :] = inner
    mean[: len(names)] = _start(observed, priors, left[pair], right[pair])
    for j, prior in enumerate(priors):
        precision[j, j] = prior.u**-2 if prior else UNKNOWN_LOG_U**-2
    return System(
        names=names,
        priors=priors,
        pairs=pairs,
        pair=pair,
        left=left,
        right=right,
        group=group,
        group_pair=together % len(pairs),
        blocks=blocks,
        observed=observed,
        weight=np.array([o.u_random**-2 for o in observations]),
        precision=precision,
        mean=mean,
        calibrations=tuple(calibrations),
        inputs=tuple(inputs),
    )


def linearise(system: System, groups: Groups, x: Array) -> tuple[Array, Array]:
    """Return residuals and design of the groups' means at x.

    x has ln E' of the materials, then the calibrations' errors, shape (n + c,). The residuals are
    observed minus computed ln E*, shape (groups,); the design is d computed / d x,
    shape (groups, n + c).
    """
    left, right = system.left[system.group_pair], system.right[system.group_pair]
    rows = np.arange(left.size)
    a, b = np.exp(-x[left]), np.exp(-x[right])
    n = len(system.names)
    design = np.zeros((rows.size, x.size))
    design[rows, left] += a / (a + b)
    design[rows, right] += b / (a + b)
    design[:, n:] = groups.common
    return groups.observed + np.log(a + b) - groups.common @ x[n:], design


def chi2(system: System, groups: Groups, x: Array, known: Array) -> float:
    """Return the weighted squares of the observations and of what is known beforehand.

    ``known`` is the precision of what is known of the columns, shape (n + c, n + c).
    """
    r, _ = linearise(system, groups, x)
    d, e = x - system.mean, x[len(system.names) :]
    about_means = groups.rest - 2 * groups.slope @ e + e @ groups.scatter @ e
    return float(groups.weight @ r**2 + about_means + d @ known @ d)


def information(system: System, groups: Groups, design: Array, known: Array) -> Array:
    """Return the normal matrix of the observations with what is known beforehand.

    ``design`` is from `linearise`; ``known`` and the result have shape (n + c, n + c).
    """
    found = design.T @ (groups.weight[:, None] * design) + known
    n = len(system.names)
    found[n:, n:] += groups.scatter
    return np.asarray(found)


def solve(system: System, groups: Groups) -> tuple[Array, Array]:
    """Return the adjusted values and their covariance (Gauss-Newton, steps halved if uphill)."""

    def cost_at(place: Array) -> float:
        """Return what is minimised."""
        return chi2(system, groups, place, system.precision)

    n = len(system.names)
    x = system.mean.copy()
    cost = cost_at(x)
    for _ in range(ITERATIONS):
        r, design = linearise(system, groups, x)
        downhill = design.T @ (groups.weight * r) - system.precision @ (x - system.mean)
        downhill[n:] += groups.slope - groups.scatter @ x[n:]
        step = np.linalg.solve(information(system, groups, design, system.precision), downhill)
        if float(downhill @ step) <= ROUNDING * cost:
            x = x + step
            break
        length = 1.0
        while length > 1e-6 and not cost_at(x + length * step) <= cost:
            length /= 2
        if length <= 1e-6:
            break
        x = x + length * step
        cost = cost_at(x)
        if float(np.abs(step).max()) < TOLERANCE:
            break
    _, design = linearise(system, groups, x)
    normal = information(system, groups, design, system.precision)
    return x, np.asarray(np.linalg.inv(normal))


def linearise_rows(system: System, x: Array) -> Iterator[tuple[Block, Array]]:
    """Yield each calibration's block with the design of its observations one by one.

    The design has shape (m, n + c) and does not depend on the errors in ``x``.
    """
    n = len(system.names)
    for block in system.blocks:
        pairs, rows = system.pair[block.rows], np.arange(block.rows.size)
        left, right = system.left[pairs], system.right[pairs]
        a, b = np.exp(-x[left]), np.exp(-x[right])
        design = np.zeros((rows.size, x.size))
        design[rows, left] += a / (a + b)
        design[rows, right] += b / (a + b)
        design[:, n + block.columns] = block.slopes
        yield block, design


def errors_of_rows(system: System, x: Array) -> Array:
    """Return what the calibrations' errors make of ln E* of every observation."""
    found, errors = np.zeros(system.observed.size), x[len(system.names) :]
    for block in system.blocks:
        found[block.rows] = block.slopes @ errors[block.columns]
    return found
