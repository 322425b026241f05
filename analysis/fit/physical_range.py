"""Physical ranges of the numbers of a finished fit, the same for all models.

=====================  ===========================================================================
natural frequency      one period in the longest window .. half the lowest sample rate: neither a
                       slower ring nor a faster one can be seen in the records
damping ratio          as the effect ``crystal_dynamics`` has it: beyond, nothing rings
gain, M, k, mu, c      cells that are made, a decade more on either side
moduli                 from the softest gel (1 Pa) to diamond (1.2e12 Pa, E' below 2e12 Pa)
an effect's numbers    ``low`` .. ``high`` of its `EffectParameter`
=====================  ===========================================================================

What a certificate of the cell states is possible, and a decade about it.

A number that the data hardly tell may end up beyond its limits by chance, so it is outside only
where two of its standard uncertainties do not lead back. Where the number is what shows that the
thing is there at all (``resolved``; the natural frequency), its best estimate counts.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from analysis.aliases import Json
from analysis.campaign import Sensor
from analysis.effects import crystal_dynamics
from analysis.effects.effect import Effect, EffectParameter
from analysis.fit.estimates import sensor_logs
from analysis.fit.joint import Fitted, nuisance_covariance
from analysis.fit.priors import SENSOR_FIELDS
from analysis.fit.problem import JointProblem
from analysis.parameters import DAMPING, FREQUENCY, GAIN, of_effect

SLACK_U = 2.0
"""Standard uncertainties by which chance takes an estimate beyond a limit, once in 40 times."""
HARDLY = 0.05
"""Share of the largest owner's amplitude below which another's is as good as neutral."""
DECADE = 10.0
"""Either side of what is made or stated: a cell of another make, not another kind of thing."""

_RING = {p.name: p for p in crystal_dynamics.EFFECT.parameters}
_GAIN_N_PER_V = (1e-2, 1e5)
# Cells that are made: 1 g to 1 kg, 1e7 to 1e10 N/m, 1 to 1e4 N s/m, 1e-10 to 1e-7 m/V.
_CELL = {
    "crystal_mass_kg": (1e-4, 10.0, "kg"),
    "crystal_stiffness_n_per_m": (1e6, 1e11, "N/m"),
    "crystal_damping_n_s_per_m": (0.1, 1e5, "N s/m"),
    "compliance_m_per_v": (1e-11, 1e-6, "m/V"),
}
_PLANE_STRAIN_PA = (1.0, 2e12, "Pa")


@dataclass(frozen=True)
class OutOfRange:
    """A number of a fit outside what it can be."""

    name: str
    value: float
    """As fitted. [``unit``]"""
    low: float
    high: float
    """``low`` and ``high`` are the limits of what it can be. [``unit``]"""
    unit: str

    @property
    def sentence(self) -> str:
        """Return what is wrong with it."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"{self.name} comes out as {self.value:.3g}{unit}, outside of what it can be, "
            f"{self.low:.3g} .. {self.high:.3g}{unit}"
        )

    def to_json(self) -> Json:
        """Return it with its sentence; a value that is not finite is null."""
        value = self.value if math.isfinite(self.value) else None
        return dataclasses.asdict(self) | {"value": value, "sentence": self.sentence}


def out_of_range(problem: JointProblem, fitted: Fitted) -> list[OutOfRange]:
    """Return the numbers of a fit that are not possible: of cell, materials, effects.

    None of them if the fit has no solution.
    """
    if fitted.failed:
        return []
    found = [*_of_cell(problem, fitted), *_of_materials(problem, fitted)]
    for effect in problem.model.effects:
        found.extend(effect_out_of_range(problem, fitted, effect))
    return found


def advice(found: list[OutOfRange]) -> str:
    """Return the violated range in words, with a remedy."""
    told = "; ".join(one.sentence for one in found)
    return (
        f"{told}: the model is not accepted, and no modulus is stated. It lacks something that "
        "these recordings show, or they cannot tell this number: diagnose them, or state what is "
        "known of it."
    )


def _width(fitted: Fitted, j: int) -> float:
    return SLACK_U * math.sqrt(max(float(fitted.covariance[j, j]), 0.0))


def _exp(log: float) -> float:
    return math.exp(min(log, 700.0))


def _of_logs(
    name: str, log: float, width: float, limits: tuple[float, float, str]
) -> Iterator[OutOfRange]:
    """Return a number whose logarithm is out of range, else nothing."""
    low, high, unit = limits
    if _exp(log + width) < low or _exp(log - width) > high:
        yield OutOfRange(name, _exp(log), low, high, unit)


def _of_cell(problem: JointProblem, fitted: Fitted) -> Iterator[OutOfRange]:
    sensor = problem.campaign.sensor
    k, mass = sensor.crystal_stiffness_n_per_m, sensor.crystal_mass_kg
    stated = math.sqrt(k.value / mass.value) / (2 * math.pi) if k and mass else None
    frames = [s.frame for s in problem.shots]
    slowest = 1.0 / max(f.samples / f.sample_rate_hz for f in frames)
    fastest = 0.5 * min(f.sample_rate_hz for f in frames)
    ratio = _RING["damping_ratio"]
    for name, label, less, limits in (
        (GAIN, "gain_N_per_V", 0.0, (*_about(*_GAIN_N_PER_V, _stated_gain(sensor)), "N/V")),
        (
            FREQUENCY,
            "natural_frequency_Hz",
            math.log(2 * math.pi),
            (*_about(slowest, fastest, stated), "Hz"),
        ),
        (DAMPING, "damping_ratio", 0.0, (ratio.low, ratio.high, "1")),
    ):
        j = problem.index(name)
        if j is not None:
            width = 0.0 if name == FREQUENCY else _width(fitted, j)
            log = problem.value_of(name, fitted.theta) - less
            yield from _of_logs(f"sensor.{label}", log, width, limits)
    cell = sensor_logs(problem, fitted)
    if cell is None:
        return
    for at, field in enumerate(SENSOR_FIELDS):
        low, high, unit = _CELL[field]
        known = getattr(sensor, field)
        low, high = _about(low, high, None if known is None else known.value)
        width = SLACK_U * math.sqrt(max(float(cell[1][at, at]), 0.0))
        yield from _of_logs(f"sensor.{field}", float(cell[0][at]), width, (low, high, unit))


def _stated_gain(sensor: Sensor) -> float | None:
    """Return the gain that a certificate states, by itself or as k c. [N/V]"""
    if sensor.hsd_n_per_v is not None:
        return sensor.hsd_n_per_v.value
    k, c = sensor.crystal_stiffness_n_per_m, sensor.compliance_m_per_v
    return None if k is None or c is None else k.value * c.value


def _about(low: float, high: float, stated: float | None) -> tuple[float, float]:
    """Return limits that hold what a certificate states, and a decade about it."""
    if stated is None:
        return low, high
    return min(low, stated / DECADE), max(high, stated * DECADE)


def _of_materials(problem: JointProblem, fitted: Fitted) -> Iterator[OutOfRange]:
    for j, name in enumerate(problem.names):
        if name.is_modulus:
            width = _width(fitted, j)
            yield from _of_logs(name, float(fitted.theta[j]), width, _PLANE_STRAIN_PA)


def effect_out_of_range(
    problem: JointProblem, fitted: Fitted, effect: Effect
) -> Iterator[OutOfRange]:
    """Return an effect's numbers that are not possible; its free signals are not asked."""
    for parameter in effect.parameters:
        if parameter.scope == "shot":
            yield from _of_shots(problem, fitted, effect, parameter)
            continue
        places = [
            j for j, name in enumerate(problem.names) if name.is_of(effect.id, parameter.name)
        ]
        largest = float(np.abs(fitted.theta[places]).max(initial=0.0))
        for j in places:
            at = float(fitted.theta[j])
            if parameter.form != "log" and abs(at) < HARDLY * largest:
                continue  # next to another owner's it is neutral
            width = 0.0 if parameter.resolved else _width(fitted, j)
            if not _is_within_reach(parameter, at, width):
                yield _outside(problem.names[j], _value(parameter, at), parameter)


def _of_shots(
    problem: JointProblem, fitted: Fitted, effect: Effect, parameter: EffectParameter
) -> Iterator[OutOfRange]:
    """Yield the number that is farthest out of range among those that each shot has for itself.

    One of n is outside as often by chance as a single number is beyond `SLACK_U`.
    """
    name = of_effect(effect.id, parameter.name)
    own = problem.model.nuisances.index(name)
    felt = [
        row
        for row, item in enumerate(problem.shots)
        if effect.acts_on(item.shot.sphere, item.shot.surface)
    ]
    if not felt:
        return
    slack = float(norm.isf(norm.sf(SLACK_U) / len(felt)))
    neutral = HARDLY * float(np.abs(fitted.nuisances[felt, own]).max())
    worst: tuple[float, OutOfRange] | None = None
    for row in felt:
        at = float(fitted.nuisances[row, own])
        value = _value(parameter, at)
        if parameter.low <= value <= parameter.high or (
            parameter.form != "log" and abs(at) < neutral
        ):
            continue
        width = slack * math.sqrt(
            max(float(nuisance_covariance(problem, fitted, row)[own, own]), 0)
        )
        beyond = max(parameter.low - value, value - parameter.high)
        if not _is_within_reach(parameter, at, width) and (worst is None or beyond > worst[0]):
            worst = beyond, _outside(name, value, parameter)
    if worst is not None:
        yield worst[1]


def _is_within_reach(parameter: EffectParameter, at: float, width: float) -> bool:
    if parameter.form == "inverse" and at - width <= 0.0 <= at + width:
        return True  # neutral
    reached = [_value(parameter, c) for c in (at - width, at, at + width)]
    return any(parameter.low <= v <= parameter.high for v in reached)


def _value(parameter: EffectParameter, coordinate: float) -> float:
    """Return the physical value, also where only an infinite uncertainty leads to it."""
    try:
        return parameter.value(coordinate)
    except OverflowError:
        return math.inf


def _outside(name: str, value: float, parameter: EffectParameter) -> OutOfRange:
    return OutOfRange(name, value, parameter.low, parameter.high, parameter.unit)
