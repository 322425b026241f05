"""Tell-tales of the third lot of effects that no library knows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.simulated.effects import Shot, make_effect
from drivers.simulated.flight import begin_flight

if TYPE_CHECKING:
    from drivers.simulated.drawn_rig import DrawnRig
    from tests.drivers.simulated.conftest import Lab

G = 9.80665


def _speed(rig: DrawnRig, height: float, number: int = 1) -> float:
    """Return the speed of one impact. [m/s]"""
    shot = Shot(number, "acetal", "pvc", height, np.random.default_rng(0))
    return begin_flight(rig, shot, 0.0, 0.0, (9, number)).speed_m_per_s


def test_a_swinging_stand_is_met_at_a_phase_of_the_fall(lab: Lab) -> None:
    """The surplus of speed is the swing at the end of the fall: either sign, never by chance."""
    values = {"speed_m_per_s": 0.01, "frequency_hz": 10.0, "decay_s": 0.2}
    rig = lab.with_effect("x_recoiling_stand", values)
    for fall_s in (0.025, 0.05, 0.075, 0.1):
        height = 0.5 * G * fall_s**2
        swing = 0.01 * math.exp(-fall_s / 0.2) * math.sin(20.0 * math.pi * fall_s)
        surplus = [_speed(rig, height, n) - G * fall_s for n in (1, 2)]
        np.testing.assert_allclose(surplus, swing, atol=1e-9)


def test_a_pinion_off_its_axle_is_right_after_half_a_turn(lab: Lab) -> None:
    """The error of height comes back with another sign, and in every drop alike."""
    rig = lab.with_effect("x_eccentric_pinion", {"eccentricity_m": 5e-4, "turn_m": 0.04})
    heights = (0.01, 0.02, 0.03, 0.04)
    for number in (1, 7):
        errors = [_speed(rig, h, number) ** 2 / (2.0 * G) - h for h in heights]
        np.testing.assert_allclose(errors, [5e-4, 0.0, -5e-4, 0.0], atol=1e-9)


def test_a_void_makes_pulses_shorter_and_never_longer(lab: Lab) -> None:
    """Contact time goes as m^(2/5), and the mean of sin^2 over all directions is 2/3."""
    base = lab.drop(lab.a_rig())[1].contact_time_s
    rig = lab.with_effect("x_eccentric_sphere", {"offset": 0.2})
    times = np.array([lab.drop(rig, number=n)[1].contact_time_s for n in range(60)]) / base
    assert np.max(times) <= 1.0 + 1e-9
    assert np.min(times) == pytest.approx(1.1**-0.4, rel=3e-3)
    assert np.mean(1.0 - times) == pytest.approx(0.4 * 0.1 * 2.0 / 3.0, rel=0.15)


def test_friction_inside_takes_the_same_share_at_every_speed(lab: Lab) -> None:
    """Of a lossless sphere it leaves ``sqrt((1 - h)/(1 + h))`` of the speed (own: energy)."""
    rig = lab.a_rig(make_effect("x_internal_friction", {"share": 0.1}), restitution=1.0, cell="hsd")
    left = [1.0 - lab.loss(rig, h) for h in (0.005, 0.05)]
    np.testing.assert_allclose(left, math.sqrt(0.9 / 1.1), rtol=2e-3)
    volts, _ = lab.drop(rig)
    base, _ = lab.drop(lab.a_rig(restitution=1.0, cell="hsd"))
    assert np.min(np.diff(volts)) < 3.0 * np.min(np.diff(base))


def test_charge_stays_when_the_sphere_has_gone(lab: Lab) -> None:
    """Nothing before the touch, all of it at the peak, then an exponential; ~ V^(2/3)."""
    values = {"amplitude_v": 0.05, "leak_s": 2e-3}
    left = []
    for height in (0.01, 0.04):
        base, _ = lab.drop(lab.a_rig(), height)
        volts, _ = lab.drop(lab.with_effect("x_contact_charge", values), height)
        added = volts - base
        np.testing.assert_array_equal(added[: lab.BEFORE], 0.0)
        peak = int(np.argmax(base))
        assert np.argmax(added) == pytest.approx(peak, abs=2)
        assert added[2500] / added[1500] == pytest.approx(math.exp(-0.5), rel=1e-6)
        left.append((added[1500], np.max(base)))
    charge, peaks = (left[1][i] / left[0][i] for i in range(2))
    assert charge == pytest.approx(peaks ** (2.0 / 3.0), rel=5e-3)


def test_a_bubble_only_softens_and_most_where_contact_is_stiff(lab: Lab) -> None:
    """Every shot has a contact time of its own, none shorter than that on a coupon that holds."""
    rig = lab.with_effect("x_air_bubble", {"compliance_m_per_n": 2e-7})
    spread = {}
    for sphere, surface in (("steel", "aluminium"), ("hdpe", "ptfe")):
        base = lab.drop(lab.a_rig(), sphere=sphere, surface=surface)[1].contact_time_s
        times = np.array(
            [
                lab.drop(rig, sphere=sphere, surface=surface, number=n)[1].contact_time_s
                for n in range(12)
            ]
        )
        assert np.min(times) > (1.0 - 1e-3) * base
        spread[sphere] = float(np.std(times / base))
    assert spread["steel"] > 3.0 * spread["hdpe"] > 0.0
