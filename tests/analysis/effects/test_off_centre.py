"""An off-centre hit: a crystal that is compressed and tilts, integrated in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .conftest import Rig, apart

RIG = Rig(restitution=1.0)
EFFECT = "coupon_mode:off_centre"


def _tilting(ratio: float) -> tuple[np.ndarray, float]:
    """Return the compression at the rig's times, in volts, and the rebound over the impact speed.

    The disc's tilt, a state of its own: inertia M a^2/4 and stiffness k a^2/4 about a diameter,
    pushed with the arm b = a/2 sqrt(ratio).
    """
    K, m, M = RIG.stiffness, RIG.mass, RIG.cell_mass
    k, mu, a = RIG.cell_stiffness, RIG.cell_damping, 6e-3
    b = 0.5 * a * math.sqrt(ratio)

    def rates(_t: float, s: np.ndarray, touching: bool) -> list[float]:
        x, v, down, w, angle, turning = s
        force = K * max(x - down - b * angle, 0.0) ** 1.5 if touching else 0.0
        push, torque = force - k * down - mu * w, b * force
        torque -= 0.25 * a**2 * (k * angle + mu * turning)
        return [v, 9.80665 - force / m, w, push / M, turning, torque / (0.25 * M * a**2)]

    def leaves(t: float, s: np.ndarray, _touching: bool) -> float:
        return float(s[0] - s[2] - b * s[4]) if t > 0 else 1.0

    leaves.terminal, leaves.direction = True, -1  # type: ignore[attr-defined]
    start = [0.0, RIG.speed, 0.0, 0.0, 0.0, 0.0]
    absolute = [1e-17, 1e-13, 1e-20, 1e-16, 1e-18, 1e-14]
    how = {"method": "DOP853", "rtol": 1e-11, "atol": absolute, "dense_output": True}
    contact = solve_ivp(rates, (0, 1e-3), start, args=(True,), events=leaves, **how)
    end, last = float(contact.t[-1]), contact.y[:, -1]
    ring = solve_ivp(rates, (end, float(RIG.times[-1])), last, args=(False,), **how)
    found = np.zeros(RIG.samples)
    during, after = (RIG.times >= 0) & (RIG.times <= end), RIG.times > end
    found[during], found[after] = contact.sol(RIG.times[during])[2], ring.sol(RIG.times[after])[2]
    return found / RIG.compliance_m_per_v, -float(last[1]) / RIG.speed


@pytest.mark.parametrize("ratio", [0.25, 1.0])
def test_a_crystal_that_tilts_agrees_with_an_integration_of_both_motions(ratio: float) -> None:
    """Compression and rebound are those of a disc that is compressed and tilts."""
    found = RIG.predict(f"kv+{EFFECT}", {f"{EFFECT}.tilt_over_compression": ratio})
    wanted, rebound = _tilting(ratio)
    assert apart(found.signal, wanted) < 2e-6
    assert found.rebound_ratio == pytest.approx(rebound, abs=3e-6)
    assert apart(found.signal, RIG.predict("kv").signal) > 1e-4


def test_all_hits_alike_beside_the_middle_are_a_lighter_crystal() -> None:
    """At the same frequency, damping and gain, a crystal of M / (1 + r) gives the same trace."""
    ratio = 0.5
    found = RIG.predict(f"kv+{EFFECT}", {f"{EFFECT}.tilt_over_compression": ratio})
    light = RIG.but(
        cell_mass=RIG.cell_mass / (1 + ratio),
        cell_stiffness=RIG.cell_stiffness / (1 + ratio),
        cell_damping=RIG.cell_damping / (1 + ratio),
        compliance_m_per_v=RIG.compliance_m_per_v * (1 + ratio),
    )
    assert apart(found.signal, light.predict("kv").signal) < 1e-9


def test_a_tape_carries_the_tilt_too() -> None:
    """With the coupon on its tape the crystal still recoils more, and the ring keeps its pitch."""
    values = {"adhesive_layer.stiffness_n_per_m": 5e9, "adhesive_layer.damping_n_s_per_m": 400.0}
    values |= {f"{EFFECT}.tilt_over_compression": 1.0}
    found = RIG.predict(f"kv2+adhesive_layer+{EFFECT}", values)
    alone = RIG.predict(f"kv2+{EFFECT}", {f"{EFFECT}.tilt_over_compression": 1.0})
    plain = RIG.predict("kv2+adhesive_layer", values)
    assert found.rebound_ratio == pytest.approx(alone.rebound_ratio, abs=2e-3)
    assert found.rebound_ratio < plain.rebound_ratio
