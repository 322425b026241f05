"""Ting's exact law of a relaxing contact, integrated in time: what the effect approximates.

While the contact shrinks, its force is that of the earlier moment t1 at which it was as large,
with the stress relaxed since (Ting, J. Appl. Mech. 33 (1966) 845). The law needs the way in as a
function of time, hence two integrations by DOP853, the second looking back into the first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TingImpact:
    """A sphere on a closed rig: third law, an end by force, a crystal with what lies on it. SI.

    ``relaxed`` and the arms (strength, time) make up psi = relaxed + sum g exp(-t / tau);
    ``viscous`` is the factor of delta^(1/4) delta', and a rigid cell has an infinite mass.
    """

    stiffness: float
    mass: float
    speed: float
    arms: tuple[tuple[float, float], ...]
    relaxed: float = 1.0
    viscous: float = 0.0
    top_mass: float = math.inf
    cell_stiffness: float = 0.0
    cell_damping: float = 0.0
    gravity: float = 0.0
    exact: bool = True
    rtol: float = 1e-10

    def solve(self, times: Array) -> tuple[Array, float, float]:
        """Return the crystal's compression, the contact time and the rebound speed.

        With ``exact`` false the integral over the whole history is taken on the way back as well.
        """
        g = np.array([arm[0] for arm in self.arms])
        tau = np.array([arm[1] for arm in self.arms])
        n = g.size
        # x, v, crystal, its rate; then int exp(-(t - s)/tau) of d(delta^(3/2)) and of d(delta)
        scale = (1.25 * self.mass * self.speed**2 / self.stiffness) ** 0.4

        def history(depth: float, held: Array) -> float:
            return self.stiffness * (self.relaxed * max(depth, 0.0) ** 1.5 + float(g @ held))

        def looked_up(t: float, s: Array) -> float:
            depth, held = float(s[0] - s[2]), s[4 + n :]
            now = self.relaxed * depth + float(g @ held)

            def excess(t1: float) -> float:
                then = before(t1)
                faded = g * np.exp(-(t - t1) / tau)
                return now - self.relaxed * (then[0] - then[2]) - float(faded @ then[4 + n :])

            if now <= 0.0:
                return 0.0
            if excess(turned) >= 0.0:
                return history(depth, s[4 : 4 + n])
            t1 = float(brentq(excess, 0.0, turned, xtol=1e-16, rtol=1e-13))
            then = before(t1)
            return history(then[0] - then[2], np.exp(-(t - t1) / tau) * then[4 : 4 + n])

        def rates(t: float, s: Array, *, back: bool) -> Array:
            depth, rate = max(float(s[0] - s[2]), 0.0), float(s[1] - s[3])
            elastic = looked_up(t, s) if back and self.exact else history(depth, s[4 : 4 + n])
            force = elastic + self.viscous * depth**0.25 * rate
            out = np.empty_like(s)
            out[0], out[1] = s[1], self.gravity - force / self.mass
            spring = self.cell_stiffness * s[2] + self.cell_damping * s[3]
            out[2], out[3] = s[3], (force - spring) / self.top_mass
            out[4 : 4 + n] = 1.5 * math.sqrt(depth) * rate - s[4 : 4 + n] / tau
            out[4 + n :] = rate - s[4 + n :] / tau
            return out

        def turns(_t: float, s: Array) -> float:
            return float(s[1] - s[3])

        def leaves(t: float, s: Array) -> float:
            depth = max(float(s[0] - s[2]), 0.0)
            elastic = looked_up(t, s) if self.exact else history(depth, s[4 : 4 + n])
            return elastic + self.viscous * depth**0.25 * float(s[1] - s[3]) - 1e-9 * peak

        for event in (turns, leaves):
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        size = 4 + 2 * n
        units = np.array([scale, self.speed, scale * 1e-3, self.speed * 1e-3])
        absolute = 1e-12 * np.concatenate([units, np.full(n, scale**1.5), np.full(n, scale)])
        state = np.zeros(size)
        state[1] = self.speed
        usual = {"method": "DOP853", "rtol": self.rtol, "atol": absolute, "dense_output": True}
        last = 100.0 * scale / self.speed
        way_in = solve_ivp(
            lambda t, s: rates(t, s, back=False), (0.0, last), state, events=turns, **usual
        )
        assert way_in.status == 1, "the sphere did not turn round"
        before, turned = way_in.sol, float(way_in.t[-1])
        at_turn = way_in.y[:, -1]
        peak = history(float(at_turn[0] - at_turn[2]), at_turn[4 : 4 + n])
        way_out = solve_ivp(
            lambda t, s: rates(t, s, back=True), (turned, last), at_turn, events=leaves, **usual
        )
        assert way_out.status == 1, "the contact did not end"
        end, left = float(way_out.t[-1]), way_out.y[:, -1]
        crystal = np.zeros(times.size)
        first = (times >= 0) & (times <= turned)
        second = (times > turned) & (times <= end)
        crystal[first], crystal[second] = before(times[first])[2], way_out.sol(times[second])[2]
        if math.isfinite(self.top_mass):
            ring = np.array([[0.0, 1.0], [-self.cell_stiffness, -self.cell_damping]])
            ring[1] /= self.top_mass
            for i in np.flatnonzero(times > end):
                crystal[i] = (expm(ring * (times[i] - end)) @ left[2:4])[0]
        return crystal, end, -float(left[1])
