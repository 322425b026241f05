"""Tell-tales of the second lot of effects that no library knows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.simulated.effects import Shot, make_effect
from drivers.simulated.flight import begin_flight

if TYPE_CHECKING:
    from tests.drivers.simulated.conftest import Lab

G = 9.80665


def _lost_height(lab: Lab, effect_id: str, values: dict[str, float], height: float) -> list[float]:
    """Return by how much 60 drops fell short of their height. [m]"""
    rig = lab.with_effect(effect_id, values)
    shots = [Shot(n, "acetal", "pvc", height, np.random.default_rng(0)) for n in range(60)]
    speeds = [begin_flight(rig, s, 0.0, 0.0, (9, s.number)).speed_m_per_s for s in shots]
    return [height - v * v / (2.0 * G) for v in speeds]


def test_a_seal_sticks_or_does_not(lab: Lab) -> None:
    """There are two kinds of drops, the same loss at every height."""
    for height in (0.01, 0.05):
        lost = _lost_height(lab, "x_sticky_seal", {"lost_m": 1e-3, "share": 0.5}, height)
        stuck = [x for x in lost if x > 5e-4]
        assert 15 < len(stuck) < 45
        np.testing.assert_allclose(stuck, 1e-3, rtol=1e-9)
        np.testing.assert_allclose([x for x in lost if x < 5e-4], 0.0, atol=1e-12)


def test_a_clamp_slips_in_steps(lab: Lab) -> None:
    """After each so many drops the tube hangs lower by a step."""
    lost = _lost_height(lab, "x_slipping_clamp", {"step_m": 5e-4, "drops_between": 15.0}, 0.05)
    np.testing.assert_allclose(lost, 5e-4 * (np.arange(60) // 15), atol=1e-12)


def test_air_takes_more_from_a_higher_drop(lab: Lab) -> None:
    """The loss of height goes with its square, to first order (own series)."""
    low, high = (_lost_height(lab, "x_air_drag", {"drag_per_m": 0.1}, h)[0] for h in (0.01, 0.05))
    assert low == pytest.approx(0.1 * 0.01**2, rel=0.01)
    assert high / low == pytest.approx(25.0, rel=0.01)


def test_a_seat_that_hardens_raises_the_pitch_of_large_rings_only(lab: Lab) -> None:
    """What it changes grows with the square of the signal."""
    share = []
    for height in (0.002, 0.05):
        base, _ = lab.drop(lab.a_rig(), height)
        volts, _ = lab.drop(lab.with_effect("x_hardening_seat", {"hardening": 0.01}), height)
        share.append(np.std(volts - base) / np.std(base))
    assert share[1] > 2.0 * share[0] > 0.0


def test_rubbing_ends_a_ring_at_a_time(lab: Lab) -> None:
    """Late in the ring next to nothing is left of it, early nearly all."""
    base, _ = lab.drop(lab.a_rig())
    rig = lab.with_effect("x_rubbing_coupon", {"friction_n": 0.3})
    volts, _ = lab.drop(rig)
    assert np.max(volts) > 0.9 * np.max(base)
    assert np.std(volts[400:600]) < 0.2 * np.std(base[400:600])


def test_a_coupon_slides_and_is_pushed_back(lab: Lab) -> None:
    """The ring's pitch falls by half the share of mass at a step, and returns."""
    rig = lab.with_effect("x_slipping_coupon", {"mass_share": 0.01, "drops_between": 5.0})
    base = [lab.drop(lab.a_rig(), number=n)[0] for n in (0, 5, 10, 15)]
    volts = [lab.drop(rig, number=n)[0] for n in (0, 5, 10, 15)]
    away = [np.std(v - b) for v, b in zip(volts, base, strict=True)]
    assert away[0] == away[3] == 0.0
    assert away[2] > 1.5 * away[1] > 0.0


def test_pull_has_a_gain_of_its_own(lab: Lab) -> None:
    """What is positive stays as it was."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("x_push_pull_gain", {"change": 0.1}))
    np.testing.assert_array_equal(volts[base > 0], base[base > 0])
    np.testing.assert_allclose(volts[base < 0], 1.1 * base[base < 0], rtol=1e-12)


def test_a_room_warms_and_cools(lab: Lab) -> None:
    """After half a turn and a whole one the gain is what it was; softness adds a little."""
    rig = lab.with_effect("x_room_temperature", {"change": 0.02, "drops_a_turn": 20.0})
    base = np.max(lab.drop(lab.a_rig())[0])
    gains = [np.max(lab.drop(rig, number=n)[0]) / base for n in (0, 5, 10, 15, 20)]
    np.testing.assert_allclose(gains, [1.0, 1.02, 1.0, 0.98, 1.0], atol=4e-3)


def test_a_table_is_linear_and_heard_after_the_cell_is_silent(lab: Lab) -> None:
    """Its answer is in proportion to the pulse; low notes last."""
    base, _ = lab.drop(lab.a_rig())
    at = {"frequency_hz": 800.0}
    one, _ = lab.drop(lab.with_effect("x_table_wave", {"share": 0.01, **at}))
    two, _ = lab.drop(lab.with_effect("x_table_wave", {"share": 0.02, **at}))
    np.testing.assert_allclose(two - base, 2.0 * (one - base), atol=1e-9)
    assert np.std((one - base)[1500:2500]) > 30 * np.std(base[1500:2500])


def test_another_exponent_changes_how_force_goes_with_speed(lab: Lab) -> None:
    """Peak force of a lossless impact goes as v^(2p/(p+1)), p the exponent (own: energy)."""
    rig = lab.a_rig(make_effect("x_conical_tip", {"exponent": 0.1}), restitution=1.0)
    forces = [lab.drop(rig, height)[1].peak_force_n for height in (0.01, 0.04)]
    assert math.log(forces[1] / forces[0]) / math.log(2.0) == pytest.approx(3.2 / 2.6, rel=2e-3)


def test_dust_is_crushed(lab: Lab) -> None:
    """A soft toe, less of it drop by drop, and worse in slow drops."""
    values = {"share": 0.5, "depth_m": 3e-6, "drops_to_crush": 10.0}
    rig = lab.with_effect("x_dust_layer", values)

    def change(number: int, height: float) -> float:
        """Return what dust does to a drop, over the drop."""
        base, _ = lab.drop(lab.a_rig(), height, number=number)
        volts, _ = lab.drop(rig, height, number=number)
        return float(np.std(volts - base) / np.std(base))

    assert change(0, 0.03) > 3.0 * change(20, 0.03) > 0.0
    assert change(0, 0.003) > 1.5 * change(0, 0.05)


def test_a_seam_changes_contact_times_from_shot_to_shot(lab: Lab) -> None:
    """Contact time goes as R^(-1/5): K as its root, time as K^(-2/5)."""
    rig = lab.with_effect("x_seam", {"spread": 0.02})
    times = [lab.drop(rig, number=n)[1].contact_time_s for n in range(40)]
    assert np.std(np.log(times)) == pytest.approx(0.2 * 0.02, rel=0.3)


def test_charge_is_seen_before_the_touch_and_turns_at_it(lab: Lab) -> None:
    """In step with the landing, whatever the height."""
    values = {"amplitude_v": 0.1, "left_share": 2.0}
    for height in (0.01, 0.05):
        base, _ = lab.drop(lab.a_rig(), height)
        volts, _ = lab.drop(lab.with_effect("x_charged_sphere", values), height)
        added = volts - base
        assert added[lab.BEFORE - 60] > 0.02
        assert added[lab.BEFORE + 60] == pytest.approx(-added[lab.BEFORE - 60], rel=0.05)
        assert abs(added[2900]) < 0.8 * abs(added[lab.BEFORE + 60])


def test_a_stuck_bit_is_always_set() -> None:
    """Codes that have it stay, all others are lifted by it."""
    codes = make_effect("x_stuck_bit", {"bit": 5.0}).conversion()
    assert codes is not None
    assert np.all(codes & 32)
    assert set(np.unique(codes.astype(int) - np.arange(65536))) == {0, 32}


@pytest.mark.parametrize(
    ("effect_id", "values"),
    [
        ("x_popcorn_noise", {"amplitude_v": 0.02, "dwell_s": 2e-4}),
        ("x_glitches", {"amplitude_v": 0.02, "rate_hz": 5e3}),
    ],
)
def test_what_has_its_own_times_differs_from_shot_to_shot(
    lab: Lab, effect_id: str, values: dict[str, float]
) -> None:
    """It is there at any time of a record, as often as it says."""
    rig = lab.with_effect(effect_id, values)
    added = [lab.drop(rig, number=n)[0] - lab.drop(lab.a_rig(), number=n)[0] for n in range(20)]
    assert not np.allclose(added[0], added[1])
    each = [float(np.mean(np.abs(part))) for part in np.array_split(np.array(added), 3, axis=1)]
    assert max(each) < 2.0 * min(each)


def test_burst_noise_dwells_as_long_as_it_says(lab: Lab) -> None:
    """It knows two levels, and changes every so often on average."""
    rig = lab.with_effect("x_popcorn_noise", {"amplitude_v": 0.02, "dwell_s": 2e-4})
    added = np.array(
        [lab.drop(rig, number=n)[0] - lab.drop(lab.a_rig(), number=n)[0] for n in range(20)]
    )
    np.testing.assert_allclose(np.abs(added), 0.02, atol=1e-9)
    changes = np.sum(added[:, 1:] * added[:, :-1] < 0)
    assert changes == pytest.approx(added.size / 200.0, rel=0.2)
