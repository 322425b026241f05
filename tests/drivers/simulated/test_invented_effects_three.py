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


def test_a_hopping_cell_lands_later_and_harder_after_a_harder_hit(lab: Lab) -> None:
    """Delay and size of the thump both go with the pulse's area, and the pulse is as it was."""
    rig = lab.with_effect("x_hopping_cell", {"share": 0.05, "hop_s": 3e-4})
    sizes, delays = [], []
    for height in (0.01, 0.04):
        base, _ = lab.drop(lab.a_rig(), height)
        added = lab.drop(rig, height)[0] - base
        peak = int(np.argmax(base))
        np.testing.assert_allclose(added[: peak + 100], 0.0, atol=1e-9)
        area = np.sum(base) / lab.RATE_HZ
        assert np.sum(added) / lab.RATE_HZ == pytest.approx(0.05 * area, rel=0.01)
        sizes.append(np.max(added) / area)
        delays.append((np.argmax(added) - peak - 100) / area)
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)
    assert delays[0] == pytest.approx(delays[1], rel=0.02)


def test_a_sinking_coupon_reaches_smaller_pulses_drop_by_drop(lab: Lab) -> None:
    """The kink is at half its height after n0 drops; beyond it a share is missing, below none."""
    values = {"share": 0.1, "begins_v": 3.0, "drops_to_halve": 20.0}
    rig = lab.with_effect("x_sinking_coupon", values)
    for number, kink in ((0, 3.0), (20, 1.5)):
        base, _ = lab.drop(lab.a_rig(), number=number)
        lost = base - lab.drop(rig, number=number)[0]
        np.testing.assert_allclose(lost[base < 0.8 * kink], 0.0, atol=1e-5)
        above = base > 1.2 * kink
        assert np.any(above)
        np.testing.assert_allclose(lost[above], 0.1 * (base[above] - kink), atol=1e-5)


def test_a_bulge_rings_with_the_square_of_the_pulse(lab: Lab) -> None:
    """It is in proportion to r, and per energy of the pulse nearly the same at any height."""
    late = []
    for height in (0.005, 0.04):
        base, _ = lab.drop(lab.a_rig(), height)
        rigs = [
            lab.with_effect("x_squared_mode", {"share": r, "frequency_hz": 4e3})
            for r in (1e-3, 2e-3)
        ]
        one, two = (lab.drop(rig, height)[0] - base for rig in rigs)
        np.testing.assert_allclose(two, 2.0 * one, atol=1e-9)
        np.testing.assert_allclose(one[: lab.BEFORE], 0.0, atol=1e-12)
        energy = np.sum(base**2)
        late.append(np.std(one[1500:2500]) / energy)
    assert late[1] == pytest.approx(late[0], rel=0.1)


def test_a_damp_crystal_leaks_from_large_pulses_only(lab: Lab) -> None:
    """The undershoot goes with the cube of the pulse, and heals in its time."""
    rig = lab.with_effect("x_damp_crystal", {"leak_per_s": 8.0, "return_s": 1e-3})
    left = []
    for height in (0.01, 0.04):
        base, _ = lab.drop(lab.a_rig(), height)
        added = lab.drop(rig, height)[0] - base
        np.testing.assert_allclose(added[: lab.BEFORE], 0.0, atol=1e-12)
        assert added[1500] < 0.0
        assert added[2500] / added[1500] == pytest.approx(math.exp(-1.0), rel=0.02)
        left.append(added[1500] / np.sum(base**3))
    assert left[1] == pytest.approx(left[0], rel=0.05)


def test_two_converters_make_a_zigzag_of_the_signal(lab: Lab) -> None:
    """Signs alternate from sample to sample, in proportion to the signal, either one first."""
    values = {"mismatch": 0.02, "skew_s": 0.0}
    rig = lab.with_effect("x_interleaved_converter", values)
    firsts = set()
    for number in range(8):
        base, _ = lab.drop(lab.a_rig(), number=number)
        added = lab.drop(rig, number=number)[0] - base
        np.testing.assert_allclose(np.abs(added), 0.01 * np.abs(base), atol=1e-9)
        loud = np.abs(base) > 1e-3
        sign = np.sign(added[loud] * base[loud]) * (-1.0) ** np.flatnonzero(loud)
        assert np.ptp(sign) == 0.0
        firsts.add(float(sign[0]))
    assert firsts == {-1.0, 1.0}


def test_skewed_converters_differ_where_the_signal_is_steep(lab: Lab) -> None:
    """Nothing at the peak, half the skew times the slope on the flanks."""
    values = {"mismatch": 0.0, "skew_s": 1e-7}
    base, _ = lab.drop(lab.a_rig())
    added = np.abs(lab.drop(lab.with_effect("x_interleaved_converter", values))[0] - base)
    slope = np.abs(np.gradient(base)) * lab.RATE_HZ
    steep = int(np.argmax(slope))
    assert added[steep] == pytest.approx(0.5e-7 * slope[steep], rel=0.02)
    assert added[np.argmax(base)] < 0.1 * added[steep]


def test_warmth_is_left_in_proportion_to_the_pulses_energy(lab: Lab) -> None:
    """A tail with one time constant and the same sign after any pulse."""
    rig = lab.with_effect("x_thermal_tail", {"offset_per_v_s": 50.0, "cooling_s": 2e-3})
    for height in (0.005, 0.04):
        base, _ = lab.drop(lab.a_rig(), height)
        added = lab.drop(rig, height)[0] - base
        np.testing.assert_allclose(added[: lab.BEFORE], 0.0, atol=1e-12)
        age_s = (1500 - np.arange(1501)) / lab.RATE_HZ
        heat = np.sum(base[:1501] ** 2 * np.exp(-age_s / 2e-3)) / lab.RATE_HZ
        assert added[1500] == pytest.approx(50.0 * heat, rel=1e-3)
        assert added[2500] / added[1500] == pytest.approx(math.exp(-0.5), rel=1e-3)
