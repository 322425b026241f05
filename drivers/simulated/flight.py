"""A flight: release, fall, impact, bounces, and the signal at the converter's input."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.drawn_rig import DrawnRig
from drivers.simulated.effects import Effect, Shot
from drivers.simulated.electronics import Stage
from drivers.simulated.fall import fly
from drivers.simulated.impact import ImpactTrace, simulate_impact

OVERSAMPLING = 8
QUIET_V = 2e-5  # less than a tenth of a code at +/-10 V
WINDOW_S = 0.02  # longest ring that is followed
SLOWEST_BOUNCE_M_PER_S = 0.02
MOST_BOUNCES = 25
LOCKED_TAIL_S = 0.3  # how long after landing a transient of the release is followed
LEAST_HEIGHT_M = 1e-4  # no tube hangs lower
TAIL_S = 1.5  # longest tail of a filter that is followed after the last bounce


@dataclass(frozen=True)
class Segment:
    """A stretch of signal on the converter's grid."""

    first: int
    """Position of its first sample on that grid."""
    volts: NDArray[np.float64]
    """Signal above the baseline."""
    replaces_noise: bool = False
    """The stretch is a recording and brings its own noise and baseline."""


@dataclass(slots=True)
class Touch:
    """One touch-down of a flight."""

    time_s: float
    """Rig time."""
    speed_m_per_s: float
    """Of the impact."""
    restitution_eq6: float
    """eps of Eq. 6."""
    rebound_speed_m_per_s: float
    """Upwards."""
    contact_time_s: float
    peak_force_n: float
    """Of the elastic force."""


_SPENT = np.random.default_rng(0)


@dataclass(slots=True)
class Flight:
    """One release and all that follows."""

    shot: Shot
    """After the release effects."""
    landing_s: float
    """Rig time of the first touch-down."""
    speed_m_per_s: float
    """At the first touch-down."""
    fall_s: float
    """From the release to the first touch-down."""
    seed: tuple[int, ...]
    """Of this flight's random numbers."""
    touches: list[Touch] = field(default_factory=list)
    """Filled when the flight is rendered."""

    def keep_first_touch(self) -> None:
        """Forget the bounces, and the random numbers, which are drawn anew when needed."""
        del self.touches[1:]
        self.shot.rng = _SPENT


def begin_flight(
    rig: DrawnRig, shot: Shot, released_s: float, speed_repeatability: float, seed: tuple[int, ...]
) -> Flight:
    """Let a sphere go at a rig time.

    The shot has the stated height; the release effects change it. ``speed_repeatability`` is the
    relative standard deviation of the impact speed; ``seed`` is that of this flight's random
    numbers.
    """
    rng = np.random.default_rng([*seed, 11])
    for i, effect in enumerate(rig.acting(shot.sphere, shot.surface)):
        shot.rng = np.random.default_rng([*seed, 12, i])
        effect.at_release(shot)
    g, air = rig.gravity_m_per_s2, rig.model
    factor = shot.speed_factor * (1.0 + speed_repeatability * rng.standard_normal())
    off = rig.inputs.height_offset_m + rig.inputs.height_scatter_m * rng.standard_normal()
    shot.drop_height_m = max(shot.drop_height_m + off, LEAST_HEIGHT_M)
    if air.drag == "none":
        fall_s = math.sqrt(2.0 * shot.drop_height_m / g)
        speed = g * fall_s
    else:
        fall_s, speed = fly(
            rig.body(shot.sphere), shot.drop_height_m, drag=air.drag, added_mass=air.added_mass
        )
    return Flight(shot, released_s + fall_s, speed * factor, fall_s, seed)


def render_flight(
    rig: DrawnRig,
    flight: Flight,
    grid_start_s: float,
    sample_rate_hz: float,
    *,
    until_s: float = math.inf,
) -> list[Segment]:
    """Return the signal of a flight at the converter's input, bounces included.

    The segments are in order of time; between them nothing happens. What a release puts on the line
    by itself comes last and adds to the others. Grid and limit are rig times; the sample rate is
    the true one. The flight's ``touches`` are filled. Every bounce starts from a crystal at rest:
    the ring of the one before has died tens of milliseconds earlier. Filters remember across
    bounces.
    """
    step_s = 1.0 / sample_rate_hz
    stages = list(_stages(rig, flight))
    factor = OVERSAMPLING if any(effect.fine_grid for effect, _ in stages) else 1
    chain = [stage for _, stage in stages]
    gain_v = 1.0 / (rig.cell.hsd_n_per_v if _is_rigid(rig, flight) else rig.cell.compliance_m_per_v)
    segments: list[Segment] = []
    flight.touches.clear()
    time_s, speed = flight.landing_s, flight.speed_m_per_s
    at = math.floor((time_s - grid_start_s) / step_s) - 1
    for bounce in range(MOST_BOUNCES):
        if time_s > until_s or speed < SLOWEST_BOUNCE_M_PER_S:
            break
        first = max(at, math.floor((time_s - grid_start_s) / step_s) - 1)
        segments += _tail(chain, at, first - at, step_s)
        rng = np.random.default_rng([*flight.seed, 20, bounce])
        flight.shot.rng = np.random.default_rng([*flight.seed, 21])
        bodies = rig.mechanics(flight.shot, speed, rng)
        points = round(min(WINDOW_S, max(until_s - time_s, 0.0) + 2 * step_s) / step_s)
        offset_s = grid_start_s + first * step_s - time_s - (factor - 1) * step_s / factor
        impact = simulate_impact(
            bodies, speed, first_s=offset_s, step_s=step_s / factor, points=points * factor
        )
        raw = impact.elastic_force_n if bodies.rigid else impact.compression_m
        used = min(points, math.ceil((impact.ended_s - offset_s) / step_s) + 1)
        volts = raw[: used * factor] * gain_v
        for stage in chain:
            volts = stage.process(volts, step_s / factor)
        segments.append(Segment(first, volts[factor - 1 :: factor]))
        at = first + used
        flight.touches.append(_touch(time_s, speed, bodies.restitution, impact))
        if bounce == 0 and _peak(volts) == 0.0:
            break
        if impact.rebound_speed_m_per_s <= 0.0 or _peak(volts) < QUIET_V:
            break
        away_s, speed = _bounce(rig, flight.shot.sphere, impact)
        time_s += impact.contact_time_s + away_s
    tail_s = min(TAIL_S, max(until_s - (grid_start_s + at * step_s), 0.0))
    segments += _tail(chain, at, round(tail_s / step_s), step_s)
    segments += _locked_to_release(rig, flight, grid_start_s, sample_rate_hz, until_s)
    return [segment for segment in segments if segment.volts.size]


def _bounce(rig: DrawnRig, sphere: str, impact: ImpactTrace) -> tuple[float, float]:
    """Return how long a sphere is away after an impact, and how fast it comes back."""
    speed = impact.rebound_speed_m_per_s
    if rig.model.drag == "none":
        return 2.0 * speed / rig.gravity_m_per_s2, speed
    below_m = max(impact.lift_off_place_m, 0.0)  # it left from the dent and lands on its rim
    return fly(
        rig.body(sphere),
        -below_m,
        drag=rig.model.drag,
        added_mass=rig.model.added_mass,
        speed_up_m_per_s=speed,
    )


def _locked_to_release(
    rig: DrawnRig, flight: Flight, grid_start_s: float, sample_rate_hz: float, until_s: float
) -> list[Segment]:
    """Return what the release puts on the line by itself, until some time after landing."""
    released_s = flight.landing_s - flight.fall_s
    first = max(math.ceil((released_s - grid_start_s) * sample_rate_hz), 0)
    stop_s = min(until_s, flight.landing_s + LOCKED_TAIL_S)
    count = math.ceil((stop_s - grid_start_s) * sample_rate_hz) - first
    t = grid_start_s - released_s + (first + np.arange(max(count, 0))) / sample_rate_hz
    segments = []
    for i, effect in enumerate(rig.acting(flight.shot.sphere, flight.shot.surface)):
        flight.shot.rng = np.random.default_rng([*flight.seed, 14, i])
        volts = effect.after_release(flight.shot, t)
        if volts is not None:
            segments.append(Segment(first, volts))
    return segments


def _peak(volts: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(volts), initial=0.0))


def _touch(time_s: float, speed: float, eps: float, impact: ImpactTrace) -> Touch:
    return Touch(
        time_s,
        speed,
        eps,
        impact.rebound_speed_m_per_s,
        impact.contact_time_s,
        impact.peak_force_n,
    )


def _is_rigid(rig: DrawnRig, flight: Flight) -> bool:
    rng = np.random.default_rng(0)
    return rig.mechanics(flight.shot, flight.speed_m_per_s, rng).rigid


def _stages(rig: DrawnRig, flight: Flight) -> Iterator[tuple[Effect, Stage]]:
    for i, effect in enumerate(rig.acting(flight.shot.sphere, flight.shot.surface)):
        flight.shot.rng = np.random.default_rng([*flight.seed, 13, i])
        stage = effect.stage(flight.shot)
        if stage is not None:
            yield effect, stage


def _tail(chain: list[Stage], at: int, samples: int, step_s: float) -> list[Segment]:
    """Return the output of the filters while nothing happens, until they are quiet."""
    segments: list[Segment] = []
    block = round(0.01 / step_s)
    left = samples
    while left > 0 and not all(stage.is_quiet(QUIET_V) for stage in chain):
        volts = np.zeros(min(block, left))
        for stage in chain:
            volts = stage.process(volts, step_s)
        segments.append(Segment(at, volts))
        at += volts.size
        left -= volts.size
    return segments
