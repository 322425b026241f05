"""The sources of a joint fit's uncertainty, and how each moves the global parameters.

The covariance of the globals is the sum of what its sources contribute, exactly: with precision P
of what was stated and information N of the shots, :math:`C = C P C + C N C`, and both P and N are
sums over sources.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.aliases import Array
from analysis.campaign import UNKNOWN_POISSONS_RATIO, Quantity, Sphere, Surface, Uncertainty
from analysis.fit.blocks import ShotBlock
from analysis.fit.first_order_input import FirstOrderInput
from analysis.fit.inputs import LAW, LINEAR
from analysis.fit.joint import Fitted
from analysis.fit.priors import (
    LEAST_RELATIVE_U,
    SEEN,
    SENSOR_FIELDS,
    UNKNOWN_LOG_U,
    sensor_transform,
)
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.stated_effects import stated_effects
from analysis.model import solver
from analysis.parameters import CELL, GAIN, ParameterName

_CELL_LABELS = {
    "crystal_mass_kg": ("sensor.crystal_mass_kg", "mass of the load cell's crystal", "kg"),
    "crystal_stiffness_n_per_m": (
        "sensor.crystal_stiffness_N_per_m",
        "stiffness of the load cell's crystal",
        "N/m",
    ),
    "crystal_damping_n_s_per_m": (
        "sensor.crystal_damping_N_s_per_m",
        "damping of the load cell's crystal",
        "N s/m",
    ),
    "compliance_m_per_v": ("sensor.compliance_m_per_V", "compliance of the load cell", "m/V"),
}
INPUT_LABELS = {
    "mass": "mass of the sphere {}",
    "radius": "radius of the sphere {}",
    "coupon_mass": "mass of the coupon {}",
    "coupon_ratio": "Poisson's ratio of the coupon {}, in how a thin one stiffens",
    "height_offset": "offset that all drop heights share",
    "time_base": "time base (true over stated sample rate)",
    "gravity": "acceleration of fall",
    "air_resistance": "drag of the air in the fall (true over steady drag)",
    "converter_gain": "gain of the converter (true over stated)",
    LAW: "inexactness of the law of {}",
}


@dataclass(frozen=True)
class Source:
    """One source of uncertainty."""

    name: str
    label: str
    value: float | None
    """Best estimate in ``unit``; None if the source is no single number."""
    uncertainty: Uncertainty
    """In ``unit``."""
    unit: str
    relative: bool
    """Whether ``spread`` is by the source's logarithm."""
    common: bool
    """Acts on all shots alike, so that no repetition lessens it."""
    spread: Array = field(repr=False)
    """What r independent standard deviations of it do to the globals. Shape (g, r)."""
    remedy: str = ""
    """What reduces it, where that is not to measure or to repeat it."""
    stated: ParameterName | None = None
    """The stated number that it is, where it is one of ``analysis.fit.inputs``."""


def nu_slope(ratio: Quantity) -> float:
    """Return d ln E' / d nu at a Poisson's ratio."""
    return 2 * ratio.value / (1 - ratio.value**2)


def sources(problem: JointProblem, fitted: Fitted, degrees_of_freedom: float) -> list[Source]:
    """Return all sources of the covariance of a fit.

    Their spreads' squares add up to the covariance. Poisson's ratios follow as sources of their own
    even where no modulus was stated, with a spread of zero.
    """
    covariance = fitted.covariance
    rest = problem.prior_precision.copy()
    found: list[Source] = []
    for precision, source in _stated(problem, covariance):
        rest -= precision
        found.append(source)
    found.extend(_remaining(problem, covariance, rest))
    found.extend(_of_shots(problem, fitted, degrees_of_freedom))
    return found


def _stated(problem: JointProblem, covariance: Array) -> Iterator[tuple[Array, Source]]:
    """Yield each stated number's source with the part of the precision that it explains."""
    yield from _of_inputs(problem, covariance)
    yield from _of_effects(problem, covariance)
    known = problem.campaign.spheres, problem.campaign.surfaces
    yield from of_moduli(problem.names, problem.prior_precision, covariance, *known)
    yield from _of_cell(problem, covariance)


def _unit_precision(size: int, direction: Array, u: float) -> Array:
    return np.outer(direction, direction) / u**2 if u > 0 else np.zeros((size, size))


def _of_inputs(problem: JointProblem, covariance: Array) -> Iterator[tuple[Array, Source]]:
    size = covariance.shape[0]
    laws: dict[str, list[int]] = {}  # by effect id
    for j, one in enumerate(problem.inputs, start=size - len(problem.inputs)):
        if isinstance(one, FirstOrderInput) and one.kind == LAW:
            laws.setdefault(one.effect_id, []).append(j)
            continue
        column = covariance[:, [j]] / one.u
        label = INPUT_LABELS[one.kind].format(one.owner)
        relative = one.kind not in LINEAR
        said, unit = one.uncertainty, one.unit
        source = Source(one.path, label, one.value, said, unit, relative, True, column)
        precision = _unit_precision(size, np.eye(size)[j], one.u)
        yield precision, replace(source, stated=one.name)
    for effect_id, at in laws.items():
        yield _of_law(problem, covariance, effect_id, at)


def _of_law(
    problem: JointProblem, covariance: Array, effect_id: str, at: list[int]
) -> tuple[Array, Source]:
    """Return the inexactness of one law: all coefficients of its discrepancy together."""
    known = np.diag(problem.prior_precision)[at]
    precision = np.zeros_like(covariance)
    precision[at, at] = known
    said = Uncertainty(float(known[0] ** -0.5))
    path, label = f"{LAW}.{effect_id}", INPUT_LABELS[LAW].format(effect_id)
    spread = covariance[:, at] * np.sqrt(known)
    return precision, Source(path, label, None, said, "1", False, True, spread)


def _of_effects(problem: JointProblem, covariance: Array) -> Iterator[tuple[Array, Source]]:
    """Yield what is stated of effects' numbers, such as a coupon's thickness."""
    size = covariance.shape[0]
    for j, one in stated_effects(problem):
        precision = float(problem.prior_precision[j, j])
        said = one.uncertainty or Uncertainty(LEAST_RELATIVE_U * one.value)
        # by the logarithm of the value, whose coordinate rises or falls with it
        sign = math.copysign(1.0, one.parameter.slope(one.prior.mean))
        column = covariance[:, [j]] * math.sqrt(precision) * sign
        whole = _unit_precision(size, np.eye(size)[j], precision**-0.5)
        unit = one.parameter.unit
        yield whole, Source(one.path, one.label, one.value, said, unit, True, True, column)


def of_moduli(
    names: Sequence[ParameterName],
    prior_precision: Array,
    covariance: Array,
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
) -> Iterator[tuple[Array, Source]]:
    """Yield E and nu of every material, each with the precision that it explains.

    The prior on ln E' is that of their sum. ``names`` are of the first parameters; the moduli
    count. The precision and the covariance, shape (g, g), are of the parameters before and after.
    """
    size = covariance.shape[0]
    for j, name in enumerate(names):
        if not name.is_modulus:
            continue
        side, short = name.kind, name.owner
        material = (spheres if side == "sphere" else surfaces)[short]
        young, ratio = material.youngs_modulus_pa, material.poissons_ratio
        precision = float(prior_precision[j, j])
        told, zero = ratio or UNKNOWN_POISSONS_RATIO, np.zeros((size, size))
        u_nu = nu_slope(told) * told.u
        if young is not None:
            # the part of the prior's variance that is not Poisson's ratio's, its floor included
            u_young = math.sqrt(max(1 / precision - u_nu**2, 0.0))
            column = covariance[:, [j]] * precision * u_young
            said = Uncertainty(u_young * young.value)
            path = f"{side}s.{short}.youngs_modulus_Pa"
            label = f"stated Young's modulus of the {side} {short}"
            whole = _unit_precision(size, np.eye(size)[j], precision**-0.5)
            yield whole, Source(path, label, young.value, said, "Pa", True, True, column)
        if ratio is not None or young is not None:
            column = covariance[:, [j]] * (precision * u_nu if young is not None else 0.0)
            path = f"{side}s.{short}.poissons_ratio"
            label = f"Poisson's ratio of the {side} {short}"
            said = Uncertainty(told.u)
            yield zero, Source(path, label, told.value, said, "1", False, True, column)


def _of_cell(problem: JointProblem, covariance: Array) -> Iterator[tuple[Array, Source]]:
    size, sensor = covariance.shape[0], problem.campaign.sensor
    if problem.model.kind == solver.HSD:
        at, gain = problem.index(GAIN), sensor.hsd_n_per_v
        if at is not None and gain is not None:
            precision = float(problem.prior_precision[at, at])
            column = covariance[:, [at]] * math.sqrt(precision)
            # without what the inputs of its calibration carry, which have rows of their own
            said, unit = Uncertainty(gain.value * precision**-0.5), "N/V"
            label = "gain of the load cell"
            yield (
                _unit_precision(size, np.eye(size)[at], precision**-0.5),
                Source("sensor.hsd_N_per_V", label, gain.value, said, unit, True, True, column),
            )
        return
    places = problem.positions(CELL)
    if places is None:
        return
    if sensor.covariance is not None and all(getattr(sensor, n) for n in SENSOR_FIELDS):
        block = problem.prior_precision[np.ix_(places, places)]
        column = covariance[:, places] @ np.linalg.cholesky(block)
        whole = np.zeros((size, size))
        whole[np.ix_(places, places)] = block
        said = Uncertainty(1.0, traceable_to="the load cell's calibration")
        label = "load cell, as calibrated"
        yield whole, Source("sensor", label, None, said, "1", True, True, column)
        return
    for name, row in zip(SENSOR_FIELDS, sensor_transform(), strict=True):
        known = getattr(sensor, name)
        if known is None:
            continue
        direction = np.zeros(size)
        direction[places] = row
        u = max(known.u / known.value, 1e-6)  # the floor of `sensor_prior`
        column = (covariance @ direction / u)[:, None]
        path, label, unit = _CELL_LABELS[name]
        said = Uncertainty(known.u)
        yield (
            _unit_precision(size, direction, u),
            Source(path, label, known.value, said, unit, True, True, column),
        )


def _remaining(problem: JointProblem, covariance: Array, rest: Array) -> Iterator[Source]:
    """Yield what else was known beforehand: next to nothing, or of an effect."""
    size = covariance.shape[0]
    weak = np.zeros((size, size))
    for j, name in enumerate(problem.names):
        precision = float(rest[j, j])
        # what subtraction leaves of a precision that is explained is rounding
        if not precision > 1e-9 * problem.prior_precision[j, j]:
            continue
        if precision <= 2 * UNKNOWN_LOG_U**-2:
            weak[j, j] = precision
            continue
        column = covariance[:, [j]] * math.sqrt(precision)
        label = "when stated rebounds were seen" if name == SEEN else f"prior on {name}"
        unit = "ms" if name == SEEN else "1"
        mean, said = float(problem.prior_mean[j]), Uncertainty(precision**-0.5)
        yield Source(name, label, mean, said, unit, False, True, column)
    if weak.any():
        column = covariance @ np.sqrt(weak)
        label = "start values of what nothing is known about"
        said = Uncertainty(UNKNOWN_LOG_U)
        yield Source("unknown", label, None, said, "1", True, True, column[:, weak.any(axis=0)])


def _of_shots(problem: JointProblem, fitted: Fitted, degrees_of_freedom: float) -> Iterator[Source]:
    """Yield what averages out over the shots: noise, scatter of the speed, stated rebounds."""
    size = fitted.theta.size
    rows: dict[str, list[Array]] = {}
    noise = np.zeros((size, size))
    for item, block in zip(problem.shots, fitted.blocks, strict=True):
        s = block.chain.shape[0]
        inner = block.matrix[s:, s:]
        # how the globals' score follows the residuals once the shot's own parameters are gone
        reach = np.vstack([np.eye(s), -np.linalg.solve(inner, block.matrix[s:, :s])])
        score = reach @ block.chain
        samples = block.matrix - block.known.T @ block.known
        noise += score.T @ samples @ score
        for label, row in zip(_known_labels(problem, item, block), block.known, strict=True):
            rows.setdefault(label, []).append(row @ score)
    values, vectors = np.linalg.eigh(noise)
    root = fitted.covariance @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    rms = float(np.mean([i.noise.rms for i in problem.shots]))
    said = Uncertainty(rms, degrees_of_freedom=max(degrees_of_freedom, 1.0))
    yield Source("noise", "noise of the records", None, said, "signal", False, False, root)
    for label, found in rows.items():
        column = fitted.covariance @ np.array(found).T
        name, words, said, unit = _known_words(problem, label)
        yield Source(name, words, None, said, unit, unit == "1", False, column)


def _known_labels(problem: JointProblem, item: FitShot, block: ShotBlock) -> list[str]:
    """Return what each row of `ShotBlock.known` is, in the order of `blocks.prior_rows`."""
    labels = ["speed"] if item.speed_prior is not None else []
    stated = item.shot.restitution
    labels.append("rebound" if stated is not None and stated.u > 0 else "own")
    return labels + ["own"] * (block.known.shape[0] - len(labels))


def _known_words(problem: JointProblem, label: str) -> tuple[str, str, Uncertainty, str]:
    if label == "speed":
        spread = [i.speed_prior.u for i in problem.shots if i.speed_prior is not None]
        said = Uncertainty(float(np.median(spread)))
        return "release.speed_repeatability", "impact speed, shot to shot", said, "1"
    if label == "rebound":
        told = [i.shot.restitution.u for i in problem.shots if i.shot.restitution is not None]
        said = Uncertainty(float(np.median(told)))
        return "shots.restitution", "stated restitutions", said, "1"
    return "shots", "shots' own parameters that nothing is known about", Uncertainty(4.0), "1"
