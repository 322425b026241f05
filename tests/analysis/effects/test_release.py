"""Effects on how, how fast and how often the sphere arrives."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.effects.library import effect_named, library
from analysis.model.hertz import closed_damping_coefficient
from analysis.model.impact_model import model_named

from .conftest import Rig, apart

RIG = Rig()


@pytest.mark.parametrize("offset", [2e-3, -3e-3])
def test_a_height_offset_shifts_the_speed(offset: float) -> None:
    """The promised speed becomes sqrt(2 g (h + dh)), and matters less from higher up."""
    model = model_named("kv+release_speed_bias")
    local = RIG.local(model, {"release_speed_bias.height_offset_m": offset})
    shift = model.speed_shift(local, RIG.frame())
    promised = math.sqrt(2 * 9.80665 * RIG.drop_height)
    true = math.sqrt(2 * 9.80665 * (RIG.drop_height + offset))
    assert shift == pytest.approx(math.log(true / promised), rel=1e-12)
    assert abs(shift) > abs(model.speed_shift(local, RIG.but(drop_height=0.2).frame()))
    same = model.predict(local, RIG.frame()).signal
    assert np.array_equal(same, RIG.predict("kv").signal)


def test_a_sphere_below_the_coupon_has_no_speed() -> None:
    """An offset of more than the height has no logarithm, and says so without an exception."""
    speed = effect_named("release_speed_bias").speed
    assert speed is not None
    low = dataclasses.replace(RIG.context(), drop_height_m=1e-3)
    assert math.isnan(speed({"height_offset_m": -2e-3}, low))


def test_a_lookalike_of_it_takes_the_same_speed_from_every_drop() -> None:
    """It is no effect of the library's list, and its speed is v - d."""
    model = model_named("kv+release_speed_bias:same_loss")
    assert "release_speed_bias:same_loss" not in {
        e.id for listed in library().values() for e in (listed, *listed.variants)
    }
    for height in (0.02, 0.2):
        rig = RIG.but(drop_height=height)
        local = rig.local(model, {"release_speed_bias:same_loss.speed_loss_m_per_s": 0.03})
        promised = math.sqrt(2 * 9.80665 * height)
        shift = model.speed_shift(local, rig.frame())
        assert shift == pytest.approx(math.log((promised - 0.03) / promised), rel=1e-12)


@pytest.mark.parametrize("drag", [0.8, -0.4])
def test_the_other_lookalike_is_a_fall_with_drag(drag: float) -> None:
    """DOP853 of a fall under gravity less k v^2."""

    def slopes(_: float, s: NDArray[np.float64]) -> list[float]:
        return [s[1], 9.80665 - drag * s[1] ** 2]

    def lands(_: float, s: NDArray[np.float64]) -> float:
        return float(s[0]) - 0.2

    lands.terminal = True  # type: ignore[attr-defined]
    model = model_named("kv+release_speed_bias:drag")
    rig = RIG.but(drop_height=0.2)
    local = rig.local(model, {"release_speed_bias:drag.drag_per_m": drag})
    fall = solve_ivp(
        slopes, (0.0, 1.0), np.zeros(2), method="DOP853", rtol=1e-12, atol=1e-14, events=lands
    )
    promised = math.sqrt(2 * 9.80665 * 0.2)
    shift = model.speed_shift(local, rig.frame())
    assert shift == pytest.approx(math.log(fall.y[1, -1] / promised), rel=1e-9)


def test_a_second_contact_is_a_slower_impact_later() -> None:
    """The trace is the sum of two base traces, the second at a fraction of the speed."""
    values = {"recontact.speed_ratio": 0.3, "recontact.delay_s": 612.5e-6}
    found = RIG.predict("kv+recontact", values).signal
    second = RIG.but(speed=0.3 * RIG.speed, touch_down_us=RIG.touch_down_us + 612.5)
    assert apart(found, RIG.predict("kv").signal + second.predict("kv").signal) < 1e-6
    assert found[700:].max() > 3 * RIG.predict("kv").signal[700:].max()


def test_a_second_contact_fades_with_its_speed() -> None:
    """The second pulse goes with the speed to the power 6/5, so its neutral value is a limit."""

    def added(ratio: float) -> float:
        rig = RIG.but(cell_stiffness=4.16e11)  # a stiff cell reads the force
        values = {"recontact.speed_ratio": ratio, "recontact.delay_s": 6e-4}
        both = rig.predict("kv+recontact", values).signal - rig.predict("kv").signal
        return float(both.max())

    assert added(0.2) / added(0.1) == pytest.approx(2**1.2, rel=0.02)


def test_a_slow_second_contact_bounces_on() -> None:
    """The third contact comes a free flight after the second, with the speed of its rebound."""
    ratio, delay = 0.01, 4e-4
    rig = RIG.but(samples=4000)
    second = rig.but(speed=ratio * rig.speed)
    model = model_named("kv")
    seen = model.predict(second.local(model, {}), second.frame())
    rebound = seen.rebound_ratio * second.speed
    later = delay + seen.contact_time_s + 2 * rebound / 9.80665
    expected = (
        rig.predict("kv").signal
        + second.but(touch_down_us=rig.touch_down_us + 1e6 * delay).predict("kv").signal
        + rig.but(speed=rebound, touch_down_us=rig.touch_down_us + 1e6 * later).predict("kv").signal
    )
    values = {"recontact.speed_ratio": ratio, "recontact.delay_s": delay}
    found = rig.predict("kv+recontact", values).signal
    until = int(rig.touch_down_us + 1e6 * later) + 150  # before a fourth
    assert later < 3e-3
    added = np.abs(found - rig.predict("kv").signal).max()
    assert np.abs(found - expected)[:until].max() < 1e-3 * added


def _left_behind(rig: Rig) -> tuple[float, float]:
    """Return where a force that ends leaves a sphere, and how fast, by DOP853. [m, m/s]"""
    c = closed_damping_coefficient(rig.restitution) * math.sqrt(rig.mass * rig.stiffness)

    def force(x: float, v: float) -> float:
        """Return what presses the sphere up."""
        return rig.stiffness * max(x, 0.0) ** 1.5 + c * max(x, 0.0) ** 0.25 * v

    def ends(t: float, s: NDArray[np.float64]) -> float:
        """Return the force, which ends when it is zero on the way up."""
        return force(*s) if t > 1e-6 and s[1] < 0.0 else 1.0

    ends.terminal = True  # type: ignore[attr-defined]  # solve_ivp's own way
    found = solve_ivp(
        lambda t, s: [s[1], 9.80665 - force(*s) / rig.mass], (0.0, 1e-2), [0.0, rig.speed],
        method="DOP853", rtol=1e-10, atol=1e-14, max_step=1e-6, events=ends,
    )  # fmt: skip
    return float(found.y[0, -1]), -float(found.y[1, -1])


def test_the_next_touch_is_at_the_surface_and_not_where_the_force_ended() -> None:
    """On a closed base it comes earlier than 2 u / g: the surface recovers behind the sphere."""
    ratio, delay = 0.01, 4e-4
    rig = RIG.but(samples=4000, cell_mass=35.4, cell_stiffness=4.16e11, coupon_mass=0.0)
    second = rig.but(speed=ratio * rig.speed)
    depth, rebound = _left_behind(second)
    above = math.sqrt(rebound**2 - 2 * 9.80665 * depth)
    seen = second.predict("kv2")
    assert seen.rebound_ratio * second.speed == pytest.approx(rebound, rel=1e-3)
    later = delay + seen.contact_time_s + (rebound + above) / 9.80665
    third = rig.but(speed=rebound, touch_down_us=rig.touch_down_us + 1e6 * later)
    expected = (
        rig.predict("kv2").signal
        + second.but(touch_down_us=rig.touch_down_us + 1e6 * delay).predict("kv2").signal
        + third.predict("kv2").signal
    )
    values = {"recontact.speed_ratio": ratio, "recontact.delay_s": delay}
    found = rig.predict("kv2+recontact", values).signal
    until = int(third.touch_down_us) + 150  # before a fourth
    added = np.abs(third.predict("kv2").signal).max()
    assert np.abs(found - expected)[:until].max() < 0.01 * added
    assert 2 * rebound / 9.80665 - (rebound + above) / 9.80665 > 2e-6  # what is at stake


def _touch_twice(rig: Rig, delay_s: float, speed_m_per_s: float) -> NDArray[np.float64]:
    """Return the cell's compression over two contacts by DOP853, the second relative to the ring.

    States are x, x', D, D'; the sphere falls freely in between and is put down where it is told.
    """

    def slopes(_: float, s: NDArray[np.float64], touching: bool) -> list[float]:
        x, v, d, w = s
        depth = max(x - d, 0.0) if touching else 0.0
        elastic = rig.stiffness * depth**1.5
        loss = rig.dashpot(depth, v - w) if touching else 0.0
        pull = elastic - rig.cell_stiffness * d - rig.cell_damping * w
        return [v, 9.80665 - (elastic + loss) / rig.mass, w, pull / rig.cell_mass]

    def leaves(_: float, s: NDArray[np.float64], touching: bool) -> float:
        return s[0] - s[2] if touching else 1.0

    leaves.terminal, leaves.direction = True, -1.0  # type: ignore[attr-defined]
    end_s = float(rig.times[-1])
    compression = np.zeros(rig.samples)
    start_s, state = 0.0, np.array([0.0, rig.speed, 0.0, 0.0])
    while start_s < end_s:
        for touching in (True, False):
            until = delay_s if not touching and start_s < delay_s else end_s
            part = solve_ivp(
                slopes, (start_s, until), state, method="DOP853", rtol=1e-11, atol=1e-16,
                dense_output=True, events=leaves, args=(touching,), max_step=2e-6,
            )  # fmt: skip
            inside = (rig.times >= start_s) & (rig.times <= part.t[-1])
            if inside.any():
                compression[inside] = part.sol(rig.times[inside])[2]
            start_s, state = float(part.t[-1]), part.y[:, -1]
        state = np.array([state[2], state[3] + speed_m_per_s, state[2], state[3]])
    return compression


def test_a_second_contact_may_meet_the_ring_of_the_first() -> None:
    """A sphere that comes back while the cell rings is kicked by it: DOP853 of both contacts."""
    form = next(v for v in library()["recontact"].variants if v.rides)
    model = dataclasses.replace(model_named("kv"), effects=(form,))
    ratio, delay = 0.08, 1.61e-4
    values = {f"{form.id}.speed_ratio": ratio, f"{form.id}.delay_s": delay}
    rig = RIG.but(samples=520)
    found = model.predict(rig.local(model, values), rig.frame()).signal
    expected = _touch_twice(rig, delay, ratio * rig.speed) / rig.compliance_m_per_v
    assert apart(found, expected) < 2e-6
    added = {"recontact.speed_ratio": ratio, "recontact.delay_s": delay}
    assert apart(rig.predict("kv+recontact", added).signal, expected) > 1e-3


def test_a_sphere_that_comes_to_rest_leaves_its_weight() -> None:
    """Long after a hop that is not seen, the cell bears the sphere."""
    rig = RIG.but(samples=12000, speed=0.5, restitution=0.3)
    values = {"recontact.speed_ratio": 1e-3, "recontact.delay_s": 6e-4}
    left = rig.predict("kv+recontact", values).signal[-500:]
    weight_v = rig.mass * 9.80665 / (rig.cell_stiffness * rig.compliance_m_per_v)
    assert left.mean() == pytest.approx(weight_v, rel=0.02)


def test_a_second_contact_has_the_law_of_the_first() -> None:
    """Under a thin coupon both contacts are stiffer."""
    thin = {"finite_thickness.thickness_m": 2e-3}
    again = {"recontact.speed_ratio": 0.3, "recontact.delay_s": 612.5e-6}
    found = RIG.predict("kv+finite_thickness+recontact", thin | again).signal
    second = RIG.but(speed=0.3 * RIG.speed, touch_down_us=RIG.touch_down_us + 612.5)
    expected = sum(r.predict("kv+finite_thickness", thin).signal for r in (RIG, second))
    assert apart(found, expected) < 1e-6
