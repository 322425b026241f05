"""Tell-tales of the effects that no library knows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.simulated.effects import Shot
from drivers.simulated.flight import begin_flight

if TYPE_CHECKING:
    from tests.drivers.simulated.conftest import Lab


@pytest.mark.parametrize(
    ("effect_id", "values"),
    [
        (
            "x_solenoid_pickup",
            {"amplitude_v": 0.1, "frequency_hz": 2000.0, "decay_s": 0.05},
        ),
        (
            "x_microphonic_cable",
            {"amplitude_v": 0.1, "frequency_hz": 2000.0, "decay_s": 0.05},
        ),
    ],
)
def test_what_the_release_makes_is_there_before_the_impact(
    lab: Lab, effect_id: str, values: Mapping[str, float]
) -> None:
    """It decays with the time since the release, so a higher drop meets less of it."""
    rig = lab.with_effect(effect_id, values)
    low, high = (lab.drop(rig, h, number=3)[0][:80] for h in (0.005, 0.05))
    assert 0.0 < np.max(np.abs(high)) < np.max(np.abs(low)) < 0.3


def test_a_solenoid_is_in_step_with_the_release_and_a_cable_is_not(lab: Lab) -> None:
    """Two shots from one height show the same pickup, and two different swings."""
    values = {"amplitude_v": 0.1, "frequency_hz": 2000.0, "decay_s": 0.05}
    for effect_id, same in (("x_solenoid_pickup", True), ("x_microphonic_cable", False)):
        rig = lab.with_effect(effect_id, values)
        first, second = (lab.drop(rig, number=n)[0][:80] for n in (1, 2))
        assert np.allclose(first, second) == same


def test_a_dead_zone_swallows_the_end_of_the_ring(lab: Lab) -> None:
    """What is far above its width only loses the width."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("x_dead_zone", {"width_v": 0.02}))
    assert np.max(base) - np.max(volts) == pytest.approx(0.02, rel=1e-6)
    late = np.abs(base) < 1e-3
    np.testing.assert_allclose(volts[late], 0.0, atol=1e-6)


def test_a_second_spot_and_a_snap_begin_at_their_depth(lab: Lab) -> None:
    """Slow drops that stay above it know nothing of it."""
    for effect_id, values in (
        ("x_second_asperity", {"share": 0.3, "gap_m": 1e-5}),
        ("x_snap_through", {"share": 0.2, "depth_m": 2e-5}),
    ):
        changes = []
        for height in (1e-4, 0.05):
            base, _ = lab.drop(lab.a_rig(), height)
            volts, _ = lab.drop(lab.with_effect(effect_id, values), height)
            changes.append(np.max(np.abs(volts - base)) / np.max(base))
        assert changes[0] < 1e-3
        assert changes[1] > 0.01


def test_drifts_grow_with_the_number_of_the_shot(lab: Lab) -> None:
    """The first release of a rig knows nothing of them."""
    for effect_id, values in (
        ("x_warming_sphere", {"final_change": -0.05, "shots_to_settle": 20.0}),
        ("x_loosening_seat", {"final_loss": 0.05, "shots_to_settle": 20.0}),
    ):
        rig = lab.with_effect(effect_id, values)
        sizes = [
            np.std(lab.drop(rig, number=n)[0] - lab.drop(lab.a_rig(), number=n)[0])
            for n in (0, 5, 50)
        ]
        assert sizes[0] < 1e-9
        assert 1e-4 < sizes[1] < sizes[2]


def test_a_loose_screw_rings_longer_than_the_crystal(lab: Lab) -> None:
    """And is a mode of its own: with the spring equally stiff both ways it is a linear one."""
    values = {"mass_ratio": 0.01, "frequency_hz": 8e3}
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("x_rattling_screw", values))
    assert np.std((volts - base)[900:1400]) > 3 * np.std(base[900:1400])


def test_an_uncertain_release_matters_most_at_low_drops(lab: Lab) -> None:
    """A swinging tube and a seal that drags add metres, not shares."""
    for effect_id, values in (
        ("x_swinging_tube", {"speed_m_per_s": 0.02}),
        ("x_dragged_release", {"mean_loss_m": 5e-4}),
    ):
        rig = lab.with_effect(effect_id, values)
        spread = []
        for height in (0.01, 0.05):
            shots = [Shot(n, "acetal", "pvc", height, np.random.default_rng(0)) for n in range(60)]
            speeds = [begin_flight(rig, s, 0.0, 0.0, (9, s.number)).speed_m_per_s for s in shots]
            spread.append(np.std(speeds) / math.sqrt(2 * 9.80665 * height))
        assert spread[0] > 1.5 * spread[1]


def test_a_wandering_clock_moves_the_flanks_and_not_the_charge(lab: Lab) -> None:
    """Misfit where the signal is steep, none where it is flat, and the same area."""
    base, _ = lab.drop(lab.a_rig())
    values = {"amplitude_s": 2e-7, "frequency_hz": 5e3}
    volts, _ = lab.drop(lab.with_effect("x_clock_wander", values))
    steep = np.argmax(np.abs(np.gradient(base)))
    assert np.abs(volts - base)[steep] > 5 * np.abs(volts - base)[np.argmax(base)]
    assert np.sum(volts) == pytest.approx(np.sum(base), rel=5e-3)


def test_a_drooping_supply_loses_gain_as_the_charge_grows(lab: Lab) -> None:
    """The rise is right, the ring is too small."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(
        lab.with_effect("x_supply_droop", {"loss_per_v_s": 200.0, "recovery_s": 5e-3})
    )
    gain = volts[base > 0.05 * np.max(base)] / base[base > 0.05 * np.max(base)]
    assert gain[0] > 0.999
    assert gain[-1] < 0.99


def test_sliding_ends_within_the_pulse(lab: Lab) -> None:
    """The shear is felt early and not in the ring."""
    base, _ = lab.drop(lab.a_rig())
    values = {"cross_share": 0.05, "slides_until": 0.4}
    volts, touch = lab.drop(lab.with_effect("x_oblique_friction", values))
    early = lab.BEFORE + round(0.25 * touch.contact_time_s * lab.RATE_HZ)
    assert volts[early] == pytest.approx(1.05 * base[early], rel=5e-3)
    np.testing.assert_allclose(volts[400:], base[400:], atol=1e-9)


def test_a_hit_off_the_centre_only_loses(lab: Lab) -> None:
    """Every shot's gain is its own, none above one."""
    base = np.max(lab.drop(lab.a_rig())[0])
    rig = lab.with_effect("x_off_centre", {"mean_loss": 0.01})
    peaks = [np.max(lab.drop(rig, number=n)[0]) / base for n in range(12)]
    assert max(peaks) <= 1.0 + 1e-6
    assert np.std(peaks) > 2e-3
