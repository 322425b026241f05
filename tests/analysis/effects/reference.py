"""An impact with any force law on any structure, integrated in time by DOP853.

Independent of the code under test: the states are the indentation, the sphere's velocity and the
structure's positions in time, the laws and the structure are plain Python, the ring after lift-off
is a matrix exponential.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

Array = NDArray[np.float64]
Law = Callable[[float, float, Array], tuple[float, float, Sequence[float]]]
"""(indentation, its rate, memories) -> elastic force, dissipative force, rates of the memories."""

GRAVITY = 9.80665
RTOL = 1e-11


def hertz(stiffness: float) -> Law:
    """Return Hertz's law without loss."""
    return lambda d, r, z: (stiffness * d**1.5, 0.0, ())


def base_dashpot(stiffness: float, mass: float, restitution: float) -> Callable[..., float]:
    """Return Eq. 3 with Eq. 5."""
    log = math.log(restitution)
    alpha = -math.sqrt(5) * log / math.sqrt(log**2 + math.pi**2)
    return lambda d, r: alpha * math.sqrt(mass * stiffness) * d**0.25 * r


@dataclass
class Ground:
    """Masses and ``links`` of (one, other, stiffness, damping); -1 is the frame."""

    masses: list[float]
    links: list[tuple[int, int, float, float]]
    top: int = 0
    crystal: int = 0
    base: int = -1

    def system(self) -> Array:
        """Return the matrix of (q, w)' without load."""
        n = len(self.masses)
        stiff, damp = np.zeros((n, n)), np.zeros((n, n))
        for one, other, k, c in self.links:
            pull = np.zeros(n)
            pull[one] = 1.0
            if other >= 0:
                pull[other] = -1.0
            stiff += k * np.outer(pull, pull)
            damp += c * np.outer(pull, pull)
        inverse = np.diag(1 / np.array(self.masses))
        return np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiff, -inverse @ damp]])

    def reading(self, states: Array) -> Array:
        """Return the crystal's compression."""
        found = states[self.crystal]
        return found - states[self.base] if self.base >= 0 else found


@dataclass
class Outcome:
    """What the reference found: force and compression at the times, contact time, rebound."""

    load: Array
    compression: Array
    contact_time: float
    rebound: float
    deepest: float


def impact(
    times: Array,
    *,
    mass: float,
    speed: float,
    law: Law,
    ground: Ground,
    memories: int = 0,
    recession: float = 0.0,
    mobility: float = 0.0,
    share: float = 0.0,
    reach: float = 0.0,
    bears: float = math.inf,
    counted: float = 1.0,
    after_turn: Callable[[float], Law] | None = None,
) -> Outcome:
    """Integrate one impact.

    ``recession`` is in metres per second per newton of elastic force, ``mobility`` of the whole
    force; ``share`` of the dissipative force loads the ground; the contact ends at the indentation
    ``-reach``, or where the elastic force with this ``counted`` part of the dissipative one is a
    pull of ``bears``; ``after_turn`` makes the law of the way back from the deepest point.
    """
    n = len(ground.masses)
    system = ground.system()
    at, size = 2 + 2 * n, 2 + 2 * n + memories
    present = [law]

    def forces(s: Array) -> tuple[float, float, Sequence[float], float]:
        depth = max(s[0], -reach)
        rate = s[1] - s[2 + n + ground.top]
        if recession:
            # the receding ground sees the plain elastic force, which does not depend on the rate
            rate -= recession * present[0](depth, 0.0, s[at:])[0]
        if mobility:
            # rate = u - mobility * F(rate): a bracketed root, F grows with the rate
            rate = brentq(
                lambda v: v - rate + mobility * sum(present[0](depth, v, s[at:])[:2]),
                rate - 10.0,
                rate + 10.0,
                xtol=1e-14,
            )
        return (*present[0](depth, rate, s[at:]), rate)

    def slope(_t: float, s: Array) -> Array:
        elastic, lost, memory, rate = forces(s)
        out = np.empty(size)
        out[0] = rate
        out[1] = GRAVITY - (elastic + lost) / mass
        out[2:at] = system @ s[2:at]
        out[2 + n + ground.top] += (elastic + share * lost) / ground.masses[ground.top]
        out[at:] = memory
        return out

    scale = speed * 1e-5
    absolute = np.full(size, 1e-13 * scale)
    absolute[1] = 1e-13 * speed
    absolute[at:] = 1e-10
    state = np.zeros(size)
    state[1] = speed
    load, compression = np.zeros(times.size), np.zeros(times.size)
    begin, deepest, done = 0.0, 0.0, False
    while not done:

        def lift_off(t: float, s: Array) -> float:
            return float(s[0]) + reach if t > 0 else 1.0

        def let_go(t: float, s: Array) -> float:
            elastic, lost, _, rate = forces(s)
            return elastic + counted * lost + bears if rate < 0 else 1.0

        def turn(t: float, s: Array) -> float:
            return float(forces(s)[3])

        lift_off.terminal, lift_off.direction = True, -1  # type: ignore[attr-defined]
        let_go.terminal, let_go.direction = True, -1  # type: ignore[attr-defined]
        turn.terminal, turn.direction = True, -1  # type: ignore[attr-defined]
        turning = after_turn is not None and present[0] is law
        part = solve_ivp(
            slope,
            (begin, begin + 2e-3),
            state,
            method="DOP853",
            rtol=RTOL,
            atol=absolute,
            max_step=2e-6,
            events=[turn] if turning else [lift_off, let_go],
            dense_output=True,
        )
        assert part.status == 1, "the reference contact did not end"
        end, state = float(part.t[-1]), part.y[:, -1]
        deepest = max(deepest, float(part.y[0].max()))
        for i in np.flatnonzero((times >= begin) & (times <= end)):
            s = part.sol(times[i])
            elastic, lost, _, _ = forces(s)
            load[i] = elastic + share * lost
            compression[i] = ground.reading(s[2 : 2 + n])
        begin = end
        done = not turning
        if turning and after_turn is not None:
            present[0] = after_turn(deepest)
    later = np.flatnonzero(times > begin)
    if later.size:
        ring = expm(system * (times[later[0]] - begin)) @ state[2:at]
        step = expm(system * (times[1] - times[0]))
        for i in later:
            compression[i] = ground.reading(ring[:n])
            ring = step @ ring
    return Outcome(load, compression, begin, -float(state[1]), deepest)
