"""Tell-tales of the third lot of effects that no library knows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drivers.simulated.effects import Shot, make_effect
from drivers.simulated.electronics import Stage
from drivers.simulated.flight import begin_flight

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.drivers.simulated.conftest import Lab

G = 9.80665
STEP_S = 1e-7


def _stage(effect_id: str, values: dict[str, float], number: int = 1) -> Stage:
    """Return an effect's part of the chain."""
    shot = Shot(number, "acetal", "pvc", 0.03, np.random.default_rng(number))
    stage = make_effect(effect_id, values).stage(shot)
    assert stage is not None
    return stage


def _hump(t: NDArray[Any], middle_s: float = 5e-4) -> NDArray[np.float64]:
    """Return a smooth pulse of one volt, 40 us wide. [V]"""
    return np.asarray(np.exp(-0.5 * ((t - middle_s) / 4e-5) ** 2), dtype=np.float64)


def test_a_wire_that_differentiates_gives_the_slope() -> None:
    """``V + c V'`` of a pulse slower than the wire's end, late by its time constant."""
    t = STEP_S * np.arange(1, 12000)
    out = _stage("x_feedthrough", {"lead_s": 1e-5}).process(_hump(t), STEP_S)
    late = t - 1.0 / (2.0 * math.pi * 5e5)
    slope = -(late - 5e-4) / 4e-5**2 * _hump(late)
    np.testing.assert_allclose(out - _hump(t), 1e-5 * slope, atol=3e-4)


def test_a_baseline_walks_as_the_root_of_the_time() -> None:
    """Over many shots the way grows with the root of the time, and begins before the impact."""
    effect = make_effect("x_wandering_baseline", {"walk_v": 0.01})
    t = np.asarray(1e-5 * np.arange(2001), dtype=np.float64)
    ways = []
    for number in range(400):
        shot = Shot(number, "acetal", "pvc", 0.03, np.random.default_rng(number))
        way = effect.after_release(shot, t)
        assert way is not None
        ways.append(way)
    spread = np.std(ways, axis=0)
    assert spread[100] == pytest.approx(0.01, rel=0.15)
    assert spread[1600] / spread[400] == pytest.approx(2.0, rel=0.15)


def test_a_lost_block_moves_what_follows_by_whole_samples(lab: Lab) -> None:
    """Before the gap all is late by it, after it nothing is; where it falls differs by shot."""
    base, _ = lab.drop(lab.a_rig())
    rig = lab.with_effect("x_lost_samples", {"lost_s": 4e-6})
    gaps = []
    for number in (1, 2, 3):
        volts, _ = lab.drop(rig, number=number)
        same = np.flatnonzero(np.abs(volts - lab.drop(lab.a_rig(), number=number)[0]) > 1e-6)
        gap = int(same[-1]) + 1
        gaps.append(gap)
        np.testing.assert_allclose(
            volts[lab.BEFORE + 4 : gap], base[lab.BEFORE : gap - 4], atol=1e-6
        )
    assert len(set(gaps)) == 3


def test_a_faster_blow_meets_a_stiffer_material(lab: Lab) -> None:
    """Contact time of a lossless impact goes as v^-(1 + 2 n)/5 (own: Hertz's with E ~ v^n)."""
    times = []
    for height in (0.01, 0.04):
        rig = lab.a_rig(
            make_effect("x_speed_stiffening", {"exponent": 0.1}), restitution=1.0, cell="hsd"
        )
        times.append(lab.drop(rig, height)[1].contact_time_s)
    assert math.log(times[1] / times[0]) / math.log(2.0) == pytest.approx(-1.2 / 5.0, rel=2e-3)


def test_a_brake_takes_the_same_speed_at_every_height(lab: Lab) -> None:
    """No height and no share."""
    rig = lab.with_effect("x_brush_brake", {"lost_m_per_s": 0.03})
    for height in (0.01, 0.05):
        shot = Shot(1, "acetal", "pvc", height, np.random.default_rng(0))
        speed = begin_flight(rig, shot, 0.0, 0.0, (9, 1)).speed_m_per_s
        assert math.sqrt(2.0 * G * height) - speed == pytest.approx(0.03, rel=1e-6)


def test_a_dispersed_echo_keeps_the_area_and_loses_the_shape() -> None:
    """It takes ``r`` of the area away, later, lower and longer than a copy."""
    t = STEP_S * np.arange(1, 40000)
    values = {"ratio": 0.1, "delay_s": 1e-4, "smear_hz": 3e3}
    echo = _stage("x_dispersed_echo", values).process(_hump(t), STEP_S) - _hump(t)
    assert np.sum(echo) == pytest.approx(-0.1 * np.sum(_hump(t)), rel=1e-3)
    assert -np.min(echo) < 0.1 * 0.9
    assert t[np.argmin(echo)] > 5e-4 + 1e-4 + 2e-5
    assert np.all(np.abs(echo[t < 4e-4]) < 1e-4)


def test_an_amplifier_changes_range_at_two_heights() -> None:
    """Up at the threshold, down at half of it."""
    t = STEP_S * np.arange(1, 12000)
    gain = _stage("x_auto_range", {"change": 0.1, "threshold_v": 0.5}).process(_hump(t), STEP_S)
    gain /= _hump(t)
    upper = np.flatnonzero(gain > 1.05)
    assert _hump(t)[upper[0]] == pytest.approx(0.5, rel=0.01)
    assert _hump(t)[upper[-1]] == pytest.approx(0.25, rel=0.01)
    np.testing.assert_allclose(gain[upper[0] : upper[-1]], 1.1)
    np.testing.assert_allclose(gain[upper[-1] + 1 :], 1.0)


def test_two_poles_swing_back_through_zero() -> None:
    """An undershoot of 2 zeta w times the area, then a half-wave of the other sign."""
    w, area = 2.0 * math.pi * 200.0, math.sqrt(2.0 * math.pi) * 4e-5
    t = 1e-6 * np.arange(1, 20000)
    stage = _stage("x_two_pole_coupler", {"frequency_hz": 200.0, "damping_ratio": 0.3})
    out = stage.process(_hump(t), 1e-6)
    after = out[t > 7e-4]
    damped = w * math.sqrt(1.0 - 0.3**2)
    since = t[t > 7e-4] - 5e-4
    # The derivative of what an impulse does to the second integral, in full (own).
    wave = np.cos(damped * since) * 2.0 * 0.3 + np.sin(damped * since) * (1.0 - 2.0 * 0.3**2) / (
        math.sqrt(1.0 - 0.3**2)
    )
    expected = -area * w * np.exp(-0.3 * w * since) * wave
    np.testing.assert_allclose(after, expected, atol=0.02 * np.max(np.abs(expected)))
    assert np.max(after) > 0.1 * -np.min(after)
    assert np.sum(out) * 1e-6 == pytest.approx(0.0, abs=0.02 * area)


def test_a_ripple_moves_the_gain_and_nothing_else() -> None:
    """The gain has the ripple's depth and period, and a phase of its own in each shot."""
    t = 1e-6 * np.arange(1, 4001)
    values = {"depth": 0.02, "frequency_hz": 1000.0}
    gains = [_stage("x_modulated_gain", values, n).process(np.ones(4000), 1e-6) for n in (1, 2)]
    wave = np.sin(2.0 * math.pi * 1000.0 * t), np.cos(2.0 * math.pi * 1000.0 * t)
    for gain in gains:
        found = math.hypot(*(2.0 * np.mean(gain * part) for part in wave))
        assert found == pytest.approx(0.02, rel=1e-6)
    assert np.max(np.abs(gains[0] - gains[1])) > 1e-3


def test_a_skin_is_felt_by_slow_drops(lab: Lab) -> None:
    """Twice the force at first touch; deep contacts forget it."""
    times = []
    for height in (2e-4, 0.05):
        bare, skin = (
            lab.drop(rig, height)[1].contact_time_s
            for rig in (
                lab.a_rig(),
                lab.with_effect("x_hard_skin", {"share": 1.0, "depth_m": 3e-6}),
            )
        )
        times.append(skin / bare)
    assert times[0] < times[1] - 0.02
    assert 0.9 < times[1] < 1.0


def test_a_hard_blow_lowers_the_pitch(lab: Lab) -> None:
    """By half the loss of stiffness, which goes with the height."""
    pitches = []
    for softening in (0.0, 0.05):
        rig = lab.with_effect("x_conditioned_crystal", {"softening": softening})
        pitches.append(lab.ring_frequency(rig, "polycarbonate"))
    lost = 0.05 * 2.0 * G * 0.03 / 0.77**2
    assert pitches[1] / pitches[0] == pytest.approx(math.sqrt(1.0 - lost), rel=1e-3)


def test_a_symmetric_filter_rings_before() -> None:
    """Half of what it adds comes before the signal."""
    t = 1e-6 * np.arange(1, 1500)
    values = {"ratio": 0.05, "spacing_s": 2e-4}
    out = _stage("x_filter_pre_echo", values).process(_hump(t), 1e-6)
    for at, size in ((5e-4, 0.05), (7e-4, 1.0), (9e-4, 0.05)):
        assert out[np.argmin(np.abs(t - at))] == pytest.approx(size, abs=1e-3)


def test_jitter_is_noise_in_proportion_to_the_slope() -> None:
    """Nothing at the top, most on the flanks, another one in each shot."""
    t = 1e-6 * np.arange(1, 1000)
    runs = [
        _stage("x_sample_jitter", {"jitter_s": 1e-7}, n).process(_hump(t), 1e-6) for n in range(400)
    ]
    spread = np.std(runs, axis=0)
    np.testing.assert_allclose(
        spread, 1e-7 * np.abs(np.gradient(_hump(t), 1e-6)), rtol=0.2, atol=1e-9
    )


def test_a_mass_inside_the_sphere_is_heard_in_the_contact_only(lab: Lab) -> None:
    """Stiff, it is the same sphere; soft, the contact is that of the lighter shell."""
    base, touch = lab.drop(lab.a_rig())
    at = {"share": 0.1}
    stiff, _ = lab.drop(lab.with_effect("x_inner_mass", at | {"frequency_hz": 1e6}))
    assert np.max(np.abs(stiff - base)) < 2e-3 * np.max(base)
    light = lab.drop(lab.with_effect("x_inner_mass", at | {"frequency_hz": 10.0}))[1]
    assert light.contact_time_s / touch.contact_time_s == pytest.approx(0.9**0.4, rel=5e-3)


def test_a_tape_that_stiffens_is_the_linear_one_in_slow_drops(lab: Lab) -> None:
    """The change against a linear tape grows faster than the signal."""
    linear = {"stiffness_n_per_m": 1e8, "damping_n_s_per_m": 2.0 * 0.1 * math.sqrt(1e8 * 4e-3)}
    share = []
    for height in (1e-4, 0.05):
        base, _ = lab.drop(lab.with_effect("adhesive_layer", linear), height)
        values = {"stiffness_n_per_m": 1e8, "depth_m": 1e-6}
        volts, _ = lab.drop(lab.with_effect("x_stiffening_tape", values), height)
        share.append(np.max(np.abs(volts - base)) / np.max(base))
    assert share[1] > 3.0 * share[0] > 0.0


def test_a_large_ring_loses_more(lab: Lab) -> None:
    """What is changed grows with the square of the signal; the slope at rest stays."""
    share = []
    for height in (0.002, 0.05):
        base, _ = lab.drop(lab.a_rig(), height)
        volts, _ = lab.drop(lab.with_effect("x_amplitude_damping", {"growth": 0.3}), height)
        share.append(np.std(volts - base) / np.std(base))
    assert share[1] > 2.0 * share[0] > 0.0


def test_friction_holds_the_stand(lab: Lab) -> None:
    """Without it a linear stand; with much of it none, and with some a ring that ends."""
    values = {"base_mass_kg": 1.0, "frequency_hz": 2e3}
    still, _ = lab.drop(lab.a_rig())
    rings = []
    for friction in (0.0, 0.4, 1e3):
        rig = lab.with_effect("x_dry_stand", values | {"friction_n": friction})
        rings.append(lab.drop(rig)[0] - still)
    free, some, held = (np.std(ring[2000:]) for ring in rings)
    assert free > 3.0 * some
    assert held < 1e-3 * free
    linear = {"frequency_hz": 2e3, "damping_ratio": 0.005, "base_mass_kg": 1.0}
    same, _ = lab.drop(lab.with_effect("base_compliance", linear))
    np.testing.assert_allclose(rings[0] + still, same, atol=1e-9)
