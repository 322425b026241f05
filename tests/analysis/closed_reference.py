"""A closed impact as mechanics has it, by DOP853 in time; shares no code with ``analysis``.

Positions of sphere and crystal, both counted downwards, are the states. The dashpot pushes both
bodies, the coupon's mass is on the crystal, and the contact ends when its force does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

GRAVITY = 9.80665
Array = NDArray[np.float64]


def linear_force_end(damping_ratio: float) -> float:
    """Return the rebound ratio of a damped linear spring that lets go when its force is zero.

    In closed form where underdamped, in the words of Schwager & Poeschel 2007, Eqs 8 and 12.
    """
    b, w = damping_ratio, math.sqrt(1 - damping_ratio**2)
    turn = math.atan(2 * b * w / (w * w - b * b)) if w != b else math.pi / 2
    angle = math.pi - turn if b < math.sqrt(0.5) else -turn
    return math.exp(-b / w * angle)


def fallen(height: float, radius: float, mass: float) -> float:
    """Return the speed by the equation of motion in time: weight, buoyancy, added mass, drag."""
    air, eta = 1.204, 1.81e-5
    volume, area = 4 / 3 * math.pi * radius**3, math.pi * radius**2

    def rates(_t: float, state: list[float]) -> list[float]:
        v = state[1]
        drag = 0.0
        if v > 0:
            re = 2 * radius * v * air / eta
            drag = 24 / re * (1 + 0.15 * re**0.687) * 0.5 * air * area * v**2
        force = (mass - air * volume) * GRAVITY - drag
        return [v, force / (mass + 0.5 * air * volume)]

    def arrives(_t: float, state: list[float]) -> float:
        return state[0] - height

    arrives.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        rates, (0, 10), [0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-13, events=arrives
    )
    return float(found.y[1, -1])


@dataclass(frozen=True)
class ClosedImpact:
    """One impact of a sphere on a coupon that rides on a crystal. SI; alpha of Eq. 3."""

    stiffness: float
    mass: float
    speed: float
    alpha: float
    crystal_mass: float
    crystal_stiffness: float
    crystal_damping: float
    coupon_mass: float = 0.0
    gravity: float = GRAVITY
    rtol: float = 1e-12

    def forces(self, state: Array) -> tuple[float, float]:
        """Return elastic and dissipative force."""
        x, v, crystal, w = state
        depth = max(x - crystal, 0.0)
        viscous = self.alpha * math.sqrt(self.mass * self.stiffness)
        return self.stiffness * depth**1.5, viscous * depth**0.25 * (v - w)

    def rates(self, _t: float, state: Array) -> list[float]:
        """Return the derivative of (x, x', Delta, Delta')."""
        elastic, lost = self.forces(state)
        _, v, crystal, w = state
        spring = self.crystal_stiffness * crystal + self.crystal_damping * w
        heavy = self.crystal_mass + self.coupon_mass
        force = elastic + lost
        return [v, self.gravity - force / self.mass, w, (force - spring) / heavy]

    def solve(self, times: Array) -> tuple[Array, float, float]:
        """Return the crystal's compression at ``times``, the contact time, the rebound speed."""
        scale = (1.25 * self.mass * self.speed**2 / self.stiffness) ** 0.4

        def force_over_depth(_t: float, state: Array) -> float:
            # F / delta^(1/4): the same zero, not the one at touch-down; odd, to be seen to cross
            depth = float(state[0] - state[2])
            viscous = self.alpha * math.sqrt(self.mass * self.stiffness)
            elastic = self.stiffness * math.copysign(abs(depth) ** 1.25, depth)
            return elastic + viscous * float(state[1] - state[3])

        force_over_depth.terminal, force_over_depth.direction = True, -1  # type: ignore[attr-defined]
        contact = solve_ivp(
            self.rates,
            (0.0, 100 * scale / self.speed),
            [0.0, self.speed, 0.0, 0.0],
            method="DOP853",
            rtol=self.rtol,
            atol=1e-14 * scale,
            events=force_over_depth,
            dense_output=True,
        )
        assert contact.status == 1, "the contact did not end"
        end, last = float(contact.t[-1]), contact.y[:, -1]
        crystal = np.zeros(times.size)
        during, after = (times >= 0) & (times <= end), times > end
        crystal[during] = contact.sol(times[during])[2]
        heavy = self.crystal_mass + self.coupon_mass
        ring = solve_ivp(
            lambda _t, s: [
                s[1],
                -(self.crystal_stiffness * s[0] + self.crystal_damping * s[1]) / heavy,
            ],
            (end, max(float(times[-1]), end * 1.01)),
            last[2:],
            method="DOP853",
            rtol=self.rtol,
            atol=1e-14 * float(np.abs(contact.y[2]).max()),
            dense_output=True,
        )
        crystal[after] = ring.sol(times[after])[0]
        return crystal, end, -float(last[1])
