"""Starting values of a fit, from the records themselves.

Each shot is compared with traces of graded contact times; the best one gives K and, where the gain
is known, the speed. No derivative is taken here, so a start can be decades off and still be found.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Sensor
from analysis.fit import joint
from analysis.fit.nuisances import fresh
from analysis.fit.problem import UNKNOWN_LOG_U, FitShot, JointProblem
from analysis.fit.ring import FREQUENCY_STEP, ring_in_tails
from analysis.fit.scan import best_contact_time, stiffness_for
from analysis.fit.start_moduli import choose_start, start_moduli
from analysis.fit.stated_effects import effect_prior
from analysis.model import solver
from analysis.parameters import CRYSTAL, DAMPING, FREQUENCY, GAIN, ParameterName

START_RESTITUTION = 0.75
"""Where none was seen: the middle of what polymers do."""
FREQUENCIES = 14
DAMPING_RATIOS = (0.02, 0.07, 0.25)
NEAR_CERTIFICATE = 0.3
"""How far, in the logarithm, a ring may be from the certificate's and still be the crystal's."""
HELD = 1e-6
"""Width of a coordinate that is to stay where it is."""
STEPS_BESIDE = 12
"""Enough to come near: what follows starts from there with everything free."""
HEAVIEST_SENSOR_SEARCH = 3
"""How many shots are looked at when nothing is known of the cell's ring."""


def _restitution(item: FitShot) -> float:
    known = item.shot.restitution
    return known.value if known is not None and 0 < known.value < 1 else START_RESTITUTION


def _crystal_mass(problem: JointProblem, omega0: float | None = None) -> float:
    """Return the crystal's mass: stated, or by its spring, or 100 times the heaviest sphere's."""
    sensor = problem.campaign.sensor
    if sensor.crystal_mass_kg is not None:
        return sensor.crystal_mass_kg.value
    if omega0 is not None and sensor.crystal_stiffness_n_per_m is not None:
        return sensor.crystal_stiffness_n_per_m.value / omega0**2
    return 100.0 * max(s.frame.mass_kg for s in problem.shots)


def _slower(item: FitShot, crystal_kg: float) -> float:
    """Return the factor by which the coupon on the crystal lowers frequency and damping ratio."""
    return math.sqrt(1.0 + item.frame.coupon_on_crystal_kg / crystal_kg)


def _ring_start(problem: JointProblem) -> tuple[float, float]:
    """Return (omega0, zeta) of the bare crystal from its certificate, else from the records."""
    item_list = problem.shots[:: max(1, len(problem.shots) // HEAVIEST_SENSOR_SEARCH)]
    item_list = item_list[:HEAVIEST_SENSOR_SEARCH]
    sensor = problem.campaign.sensor
    mass, stiffness = sensor.crystal_mass_kg, sensor.crystal_stiffness_n_per_m
    damping = sensor.crystal_damping_n_s_per_m
    # what is looked for is a ring with coupons on the crystal
    crystal = _crystal_mass(problem)
    slower = float(np.median([_slower(i, crystal) for i in item_list]))
    if mass and stiffness:
        zeta = 0.07
        if damping:
            zeta = damping.value / (2 * math.sqrt(stiffness.value * mass.value))
        stated = math.sqrt(stiffness.value / mass.value)
        if _stated_frequency_u(sensor) < FREQUENCY_STEP:
            return stated, zeta  # a calibration knows better than the search's grid
        omega0, zeta = _nearest_ring(problem, item_list, stated / slower, zeta / slower)
        return omega0 * slower, zeta * slower
    rate = item_list[0].frame.sample_rate_hz
    width = float(np.median([i.window.width_s for i in item_list]))
    grid = 2 * math.pi * np.geomspace(0.3 / width, min(0.4 * rate, 30 / width), FREQUENCIES)
    candidates = [(float(omega0), zeta) for omega0 in grid for zeta in DAMPING_RATIOS]
    seen = ring_in_tails(item_list)
    if seen is not None:
        candidates.append(seen)
    omega0, zeta = min(candidates, key=lambda c: _ring_mismatch(problem, item_list, *c))
    return omega0 * slower, zeta * slower


def _stated_frequency_u(sensor: Sensor) -> float:
    """Return u of ln omega0 as certificate or calibration state it; infinite where they do not."""
    mass, stiffness = sensor.crystal_mass_kg, sensor.crystal_stiffness_n_per_m
    if mass is None or stiffness is None:
        return math.inf
    if sensor.covariance is not None:
        c = sensor.covariance  # of ln M, ln k, ...; omega0 = sqrt(k / M)
        return 0.5 * math.sqrt(max(float(c[0, 0] + c[1, 1] - 2 * c[0, 1]), 0.0))
    return 0.5 * math.hypot(mass.u / mass.value, stiffness.u / stiffness.value)


def _nearest_ring(
    problem: JointProblem, items: list[FitShot], stated: float, zeta: float
) -> tuple[float, float]:
    """Return the certificate's ring, or the one in the records where it is near and fits better.

    A certificate good to 7 % is several radians off after ten periods, and a fit that starts there
    has to climb over the beats between the two.
    """
    seen = ring_in_tails(items, near=(stated, NEAR_CERTIFICATE))
    if seen is None:
        return stated, zeta
    return min([(stated, zeta), seen], key=lambda c: _ring_mismatch(problem, items, *c))


def _ring_mismatch(
    problem: JointProblem, items: list[FitShot], omega0: float, zeta: float
) -> float:
    """Return the squared error that the best contact times leave with this ring."""
    return sum(
        best_contact_time(
            i, problem.model, speed=_speed(i), omega0=omega0, zeta=zeta, e=_restitution(i)
        )[0]
        for i in items
    )


def _speed(item: FitShot) -> float:
    return math.exp(item.speed_prior.mean) if item.speed_prior else 1.0


def with_start(problem: JointProblem) -> tuple[JointProblem, NDArray[np.float64]]:
    """Return the problem with its start, and the shots' nuisances to start from.

    What nothing is known of has a prior that says nothing. The nuisances, shape (shots, 4), are
    ln v0, ln e, t0 [us] and baseline.
    """
    omega0, zeta = _ring_start(problem) if problem.model.kind == solver.KV else (1.0, 0.1)
    crystal = _crystal_mass(problem, omega0)
    nuisances = fresh(problem.model, len(problem.shots))
    stiffness = np.empty(len(problem.shots))
    log_gain = np.empty(len(problem.shots))
    known_gain = _known_gain(problem)
    for row, item in enumerate(problem.shots):
        speed, e, slower = _speed(item), _restitution(item), _slower(item, crystal)
        _, duration, amplitude, shift = best_contact_time(
            item, problem.model, speed=speed, omega0=omega0 / slower, zeta=zeta / slower, e=e
        )
        gain = item.fixed_gain if item.fixed_gain is not None else known_gain
        if item.speed_prior is None and gain is not None:
            # at a given contact time the force goes like the speed
            speed *= amplitude * math.exp(gain)
        log_gain[row] = -math.log(amplitude)
        stiffness[row] = math.log(stiffness_for(duration, item.frame.mass_kg, speed))
        t0_us = shift / item.frame.sample_rate_hz * 1e6
        nuisances[row, :4] = math.log(speed), math.log(e), t0_us, item.window.baseline
    problem = _with_globals(problem, stiffness, log_gain, omega0, zeta)
    start, nuisances = choose_start(problem, stiffness, nuisances)
    return _beside_known_effects(replace(problem, start=start), nuisances)


def _beside_known_effects(
    problem: JointProblem, nuisances: NDArray[np.float64]
) -> tuple[JointProblem, NDArray[np.float64]]:
    """Move the start to where all else fits effects' numbers as they are known beforehand.

    Far from the minimum any effect helps, even a hard coupon of a tenth of a millimetre, from which
    no slope leads back.
    """
    known = [j for j, name in enumerate(problem.names) if effect_prior(problem, name) is not None]
    if not known:
        return problem, nuisances
    precision = problem.prior_precision.copy()
    precision[known, known] = HELD**-2
    held = replace(problem, prior_precision=precision)
    found = joint.fit(held, nuisances, max_iterations=STEPS_BESIDE)
    if found.failed:
        return problem, nuisances
    return replace(problem, start=found.theta), found.nuisances


def _known_gain(problem: JointProblem) -> float | None:
    j = problem.index(GAIN)
    if j is None or problem.prior_precision[j, j] <= 0:
        return None
    sensor = problem.campaign.sensor
    if problem.model.kind == solver.HSD:
        return math.log(sensor.hsd_n_per_v.value) if sensor.hsd_n_per_v else None
    if sensor.compliance_m_per_v and sensor.crystal_stiffness_n_per_m:
        return math.log(sensor.compliance_m_per_v.value * sensor.crystal_stiffness_n_per_m.value)
    return None


def _with_globals(
    problem: JointProblem,
    stiffness: NDArray[np.float64],
    log_gain: NDArray[np.float64],
    omega0: float,
    zeta: float,
) -> JointProblem:
    """Turn per-shot values into globals, then give every unknown a prior that says nothing."""
    start = np.zeros(len(problem.names))
    free_gain = [g for g, s in zip(log_gain, problem.shots, strict=True) if s.fixed_gain is None]
    crystal = _crystal_mass(problem, omega0)
    known_gain = _known_gain(problem)
    cell = {
        GAIN: known_gain
        if known_gain is not None
        else float(np.median(free_gain))
        if free_gain
        else 0.0,
        FREQUENCY: math.log(omega0),
        DAMPING: math.log(zeta),
        CRYSTAL: math.log(crystal),
    }
    for j, name in enumerate(problem.names):
        if name in cell:
            start[j] = cell[name]
        elif name.kind == "pair":
            rows = [i for i, s in enumerate(problem.shots) if s.pair == name.owner]
            start[j] = float(np.median(stiffness[rows]))
        else:
            start[j] = _effect_start(problem, name)
    start_moduli(problem, stiffness, start)
    unknown = np.diag(problem.prior_precision) <= 0
    precision = problem.prior_precision.copy()
    precision[unknown, unknown] = UNKNOWN_LOG_U**-2
    mean = np.where(unknown, start, problem.prior_mean)
    return replace(problem, start=start, prior_mean=mean, prior_precision=precision)


def _effect_start(problem: JointProblem, name: ParameterName) -> float:
    """Return the coordinate an effect's parameter starts from; 0 for anything else."""
    known = effect_prior(problem, name)
    if known is not None:
        return known.mean
    for effect in problem.model.effects:
        for parameter in effect.parameters:
            if name.is_of(effect.id, parameter.name):
                return parameter.coordinate(parameter.starts[0])
    return 0.0
