"""Each effect of the simulator: nothing at its neutral value, its tell-tale at a usual one."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.simulated.draw import draw_effect, draw_rig
from drivers.simulated.drawn_rig import DrawnRig
from drivers.simulated.effects import EFFECTS, INVENTED, LIBRARY, Effect, Scope, Shot, make_effect
from drivers.simulated.flight import Touch, begin_flight, render_flight
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec

RATE_HZ = 1e6
BEFORE = 100
TOUCH_AT = 100.5  # sample at which the sphere touches


def a_rig(*effects: Effect, cell: str = "kv", restitution: float | None = None) -> DrawnRig:
    """Return a rig that is exactly what its labels say."""
    given = {} if restitution is None else {(a, b): restitution for a in SPHERES for b in SURFACES}
    return draw_rig(
        3,
        SPHERES,
        SURFACES,
        CellSpec(),
        effects,
        exact=True,
        restitution=given,
        restitution_scatter=0.0,
        rigid_cell=cell == "hsd",
    )


def drop(
    rig: DrawnRig,
    height_m: float = 0.03,
    *,
    sphere: str = "acetal",
    surface: str = "polycarbonate",
    samples: int = 3000,
    number: int = 1,
) -> tuple[NDArray[np.float64], Touch]:
    """Return a noiseless record on a grid that does not follow the landing, and its touch."""
    shot = Shot(number, sphere, surface, height_m, np.random.default_rng(0))
    flight = begin_flight(rig, shot, 0.0, 0.0, (9, number))
    expected_s = math.sqrt(2.0 * height_m / rig.gravity_m_per_s2)
    start_s = expected_s - TOUCH_AT / RATE_HZ
    volts = np.zeros(samples)
    stop_s = start_s + samples / RATE_HZ
    for piece in render_flight(rig, flight, start_s, RATE_HZ, until_s=stop_s):
        a, b = max(piece.first, 0), min(piece.first + piece.volts.size, samples)
        volts[a:b] += piece.volts[a - piece.first : b - piece.first]
    for effect in rig.effects:
        hum = effect.ambient(start_s + np.arange(samples) / RATE_HZ)
        volts += 0.0 if hum is None else hum
    return volts, flight.touches[0]


def with_effect(
    effect_id: str, values: Mapping[str, float], scope: Scope | None = None, cell: str = "kv"
) -> DrawnRig:
    """Return a rig with one effect."""
    return a_rig(make_effect(effect_id, values, scope), cell=cell)


def loss(rig: DrawnRig, height_m: float) -> float:
    """Return 1 - rebound/impact."""
    touch = drop(rig, height_m)[1]
    return 1.0 - touch.rebound_speed_m_per_s / touch.speed_m_per_s


@pytest.mark.parametrize("effect_id", sorted(EFFECTS))
def test_neutral_value_is_the_base_model(effect_id: str) -> None:
    """At its neutral value an effect cannot be told from its absence."""
    cell = "hsd" if effect_id == "crystal_dynamics" else "kv"
    base, _ = drop(a_rig(cell=cell))
    same, _ = drop(with_effect(effect_id, EFFECTS[effect_id].neutral_values(), cell=cell))
    np.testing.assert_allclose(same, base, atol=2e-6 * np.max(base))
    conversion = make_effect(effect_id, EFFECTS[effect_id].neutral_values()).conversion()
    assert conversion is None


@pytest.mark.parametrize("effect_id", sorted(EFFECTS))
def test_a_drawn_effect_changes_the_record(effect_id: str) -> None:
    """Whatever size is drawn, the effect does something and the record stays finite."""
    cell = "hsd" if effect_id == "crystal_dynamics" else "kv"
    effect = EFFECTS[effect_id](EFFECTS[effect_id].draw(np.random.default_rng(1)))
    volts, _ = drop(a_rig(effect, cell=cell), number=20)
    assert np.all(np.isfinite(volts))
    base, _ = drop(a_rig(cell=cell), number=20)
    assert effect.conversion() is not None or np.max(np.abs(volts - base)) > 1e-5


def test_the_library_is_the_one_of_the_physics_notes_and_more_lies_outside() -> None:
    """Every named effect exists, and at least three kinds in each slot that no library knows."""
    assert len(LIBRARY) == 22
    slots = [kind.slot for kind in INVENTED.values()]
    assert set(slots) == {"release", "contact", "mounting", "sensor", "electronics"}
    assert min(slots.count(slot) for slot in set(slots)) >= 3


@pytest.mark.parametrize("effect_id", sorted(EFFECTS))
def test_sizes_are_drawn_even_in_the_logarithm(effect_id: str) -> None:
    """Half of all draws lie below the middle of the range, in decades, of each effect's size."""
    kind = EFFECTS[effect_id]
    size = kind.parameters[0]
    rng = np.random.default_rng(4)
    drawn = np.abs([kind.draw(rng)[size.name] for _ in range(400)])
    low, high = size.low, size.high
    if effect_id == "x_lifted_tape":  # its size is the distance from a tape that does not lift
        drawn, low, high = 1.0 - drawn, 1.0 - size.high, 1.0 - size.low
    assert low <= drawn.min() * (1 + 1e-9)
    assert drawn.max() <= high * (1 + 1e-9)
    assert np.mean(drawn < math.sqrt(low * high)) == pytest.approx(0.5, abs=0.1)


def test_viscoelastic_loss_falls_with_speed_as_the_fifth_root() -> None:
    """Kuwabara-Kono: 1 - eps ~ v^(1/5), h^(1/10)."""
    rig = a_rig(make_effect("viscoelastic_damping", {"relaxation_s": 1e-6}), restitution=1.0)
    bare = a_rig(restitution=1.0)
    gained = [loss(rig, h) - loss(bare, h) for h in (0.01, 0.05)]
    assert gained[1] / gained[0] == pytest.approx(5.0**0.1, rel=0.02)


def test_hunt_crossley_loss_grows_with_speed() -> None:
    """Hunt-Crossley: 1 - eps ~ v, h^(1/2)."""
    rig = a_rig(make_effect("hunt_crossley_damping", {"damping_s_per_m": 0.05}), restitution=1.0)
    bare = a_rig(restitution=1.0)
    gained = [loss(rig, h) - loss(bare, h) for h in (0.01, 0.05)]
    assert gained[1] / gained[0] == pytest.approx(5.0**0.5, rel=0.03)


def test_stress_relaxation_goes_from_relaxed_to_glassy() -> None:
    """A fast solid stays relaxed, a slow one is 1 + g times as stiff."""
    base = drop(a_rig())[1].contact_time_s
    fast = with_effect("stress_relaxation", {"strength": 0.2, "relaxation_time_s": 1e-9})
    slow = with_effect("stress_relaxation", {"strength": 0.2, "relaxation_time_s": 1e-2})
    assert drop(fast)[1].contact_time_s == pytest.approx(base, rel=1e-3)
    assert drop(slow)[1].contact_time_s == pytest.approx(base * 1.2**-0.4, rel=5e-3)


def test_yield_has_a_threshold_in_speed_and_cuts_the_peak() -> None:
    """Below the threshold nothing, above it a lower peak and a lower rebound."""
    rig = with_effect("plastic_yield", {"yield_pressure_pa": 5e7})
    low, low_base = drop(rig, 0.002)[1], drop(a_rig(), 0.002)[1]
    high, high_base = drop(rig, 0.05)[1], drop(a_rig(), 0.05)[1]
    assert low.peak_force_n == pytest.approx(low_base.peak_force_n, rel=1e-6)
    assert high.peak_force_n < 0.97 * high_base.peak_force_n
    assert high.rebound_speed_m_per_s < 0.97 * high_base.rebound_speed_m_per_s


def test_yield_conserves_nothing_it_should_not() -> None:
    """Of a lossless sphere, a yielding contact keeps energy, and rebounds slower than it came."""
    rig = a_rig(make_effect("plastic_yield", {"yield_pressure_pa": 6e7}), restitution=1.0)
    assert 0.5 < 1.0 - loss(rig, 0.05) < 0.99


def test_adhesion_pulls_at_the_end_and_is_invisible_unless_tacky() -> None:
    """A tacky contact lasts longer; one of 1 mJ/m2 shows less than the noise."""
    base, touch = drop(a_rig())
    weak, _ = drop(with_effect("adhesion", {"surface_energy_j_per_m2": 1e-3}))
    tacky, longer = drop(with_effect("adhesion", {"surface_energy_j_per_m2": 2.0}))
    assert np.max(np.abs(weak - base)) < 5e-4
    assert longer.contact_time_s > touch.contact_time_s
    assert longer.rebound_speed_m_per_s < touch.rebound_speed_m_per_s
    assert np.min(tacky) < np.min(base)


def test_a_thin_coupon_hardens_with_amplitude() -> None:
    """Contact shortens, and more so from higher up."""
    rig = with_effect("finite_thickness", {"thickness_m": 3e-3})
    low, high = (
        drop(rig, h)[1].contact_time_s / drop(a_rig(), h)[1].contact_time_s for h in (0.005, 0.05)
    )
    assert high < low < 1.0


def test_a_radiating_plate_takes_energy_without_ringing() -> None:
    """The rebound drops; the ring after the pulse does not grow."""
    base, touch = drop(a_rig())
    volts, slower = drop(with_effect("plate_radiation", {"impedance_n_s_per_m": 300.0}))
    assert slower.rebound_speed_m_per_s < 0.97 * touch.rebound_speed_m_per_s
    assert np.max(volts) < np.max(base)


def test_roughness_softens_low_drops_most() -> None:
    """The soft toe lengthens contact, worse at low speed."""
    rig = with_effect("surface_roughness", {"roughness_m": 3e-6})
    low, high = (
        drop(rig, h)[1].contact_time_s / drop(a_rig(), h)[1].contact_time_s for h in (0.002, 0.05)
    )
    assert low > high > 1.0


def test_the_dashpots_reaction_brings_the_peak_forward() -> None:
    """The dissipative force is largest while loading."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("dashpot_reaction", {"share": 1.0}))
    assert np.argmax(volts) < np.argmax(base)


def test_a_tape_moves_the_ring_with_the_coupon() -> None:
    """The heavier coupon rings slower on the same tape."""
    rig = with_effect("adhesive_layer", {"stiffness_n_per_m": 3e9, "damping_n_s_per_m": 400.0})
    assert ring_frequency(rig, "aluminium") < ring_frequency(rig, "polycarbonate")
    assert ring_frequency(a_rig(), "aluminium") == pytest.approx(
        ring_frequency(a_rig(), "polycarbonate"), rel=0.01
    )


def ring_frequency(rig: DrawnRig, surface: str) -> float:
    """Return the ring's frequency from its zero crossings. [Hz]"""
    volts, touch = drop(rig, surface=surface)
    ring = volts[BEFORE + round(touch.contact_time_s * RATE_HZ) + 40 :][:350]
    at = np.flatnonzero(np.signbit(ring[1:]) != np.signbit(ring[:-1]))
    exact = at + ring[at] / (ring[at] - ring[at + 1])
    return float(RATE_HZ * (len(exact) - 1) / 2.0 / (exact[-1] - exact[0]))


def test_a_coupon_mode_varies_from_shot_to_shot() -> None:
    """Repeated drops give different amplitudes of the mode."""
    values = {
        "frequency_hz": 3e4,
        "damping_ratio": 0.01,
        "mass_ratio": 0.05,
        "hit_scatter": 0.3,
    }
    rig = with_effect("coupon_mode", values)
    base, _ = drop(a_rig())
    sizes = [np.std(drop(rig, number=n)[0] - base) for n in range(8)]
    assert np.std(sizes) > 0.05 * np.mean(sizes)


def test_crystal_dynamics_turns_a_rigid_cell_into_one_that_rings() -> None:
    """The pulse comes later and rings after it."""
    rigid, touch = drop(a_rig(cell="hsd"))
    values = {"natural_frequency_hz": 17.3e3, "damping_ratio": 0.073}
    rings, _ = drop(with_effect("crystal_dynamics", values, cell="hsd"))
    after = BEFORE + round(touch.contact_time_s * RATE_HZ) + 5
    assert np.all(rigid[after:] == 0.0)
    assert np.ptp(rings[after:]) > 0.02 * np.max(rings)
    assert np.argmax(rings) > np.argmax(rigid)


def test_crystal_dynamics_on_a_cell_that_moves_is_refused() -> None:
    """The step from HSD to KV can be taken once."""
    values = {"natural_frequency_hz": 17.3e3, "damping_ratio": 0.073}
    with pytest.raises(ValueError, match="moves already"):
        drop(with_effect("crystal_dynamics", values))


def test_a_second_mode_appears_at_its_own_frequency() -> None:
    """The added signal has its line where it was put."""
    values = {"frequency_hz": 5e4, "damping_ratio": 0.01, "share": 0.2}
    extra = drop(with_effect("second_mode", values))[0] - drop(a_rig())[0]
    line = np.abs(np.fft.rfft(extra[900:2900]))  # the crystal's own ring has died by then
    assert np.argmax(line) * RATE_HZ / 2000 == pytest.approx(5e4, rel=0.02)


@pytest.mark.parametrize("sphere", ["acetal", "acetal_small"])
def test_a_soft_stand_rings_slowly_under_every_sphere(sphere: str) -> None:
    """Long after the crystal is silent, the base still swings at its own frequency."""
    values = {"frequency_hz": 2e3, "damping_ratio": 0.02, "base_mass_kg": 1.0}
    volts, _ = drop(with_effect("base_compliance", values), sphere=sphere, samples=6000)
    late = volts[2500:]
    line = np.abs(np.fft.rfft(late - late.mean(), 20_000))
    assert np.argmax(line) * RATE_HZ / 20_000 == pytest.approx(2e3, rel=0.05)


def test_nonlinearity_shows_at_the_peak() -> None:
    """The misfit is b V^2."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("sensor_nonlinearity", {"curvature_per_v": 0.01}))
    np.testing.assert_allclose(volts - base, 0.01 * base**2, atol=1e-9)


def test_a_highpass_undershoots_by_impulse_over_time_constant() -> None:
    """After the ring the signal lies at -impulse/tau."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("coupler_highpass", {"time_constant_s": 0.05}))
    assert volts[2000] == pytest.approx(-base.sum() / RATE_HZ / 0.05, rel=0.04)


@pytest.mark.parametrize("filter_order", [1.0, 2.0])
def test_a_lowpass_delays_and_smooths(filter_order: float) -> None:
    """The peak comes later and lower."""
    base, _ = drop(a_rig())
    values = {"cutoff_hz": 2.5e4, "filter_order": filter_order}
    volts, _ = drop(with_effect("amplifier_lowpass", values))
    assert np.argmax(volts) > np.argmax(base)
    assert np.max(volts) < np.max(base)


@pytest.mark.parametrize("softness", [0.0, 0.1])
def test_clipping_flattens_the_top(softness: float) -> None:
    """Nothing passes the limit, and a hard one is met by many samples."""
    volts, _ = drop(with_effect("clipping", {"limit_v": 1.5, "softness": softness}))
    assert np.max(volts) <= 1.5
    if softness == 0.0:
        assert np.count_nonzero(volts == 1.5) > 10


def test_an_echo_is_a_delayed_copy() -> None:
    """What is added is the signal itself, later and smaller."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("echo", {"delay_s": 2e-5, "ratio": 0.1}))
    np.testing.assert_allclose((volts - base)[20:], 0.1 * base[:-20], atol=2e-4 * np.max(base))


def test_hum_is_there_before_the_trigger() -> None:
    """A sine of the amplitude asked for runs through the whole record."""
    values = {"amplitude_v": 0.05, "frequency_hz": 50.0, "harmonics": 1.0}
    rig = with_effect("mains_hum", values)
    hum = rig.effects[0].ambient(np.arange(20_000) / RATE_HZ)
    assert hum is not None
    assert np.max(hum) == pytest.approx(0.05, rel=1e-3)
    volts, _ = drop(rig)
    assert np.any(volts[: BEFORE - 5] != 0.0)


def test_a_wrong_height_matters_most_at_low_drops() -> None:
    """Impact speed is that of the true height."""
    rig = with_effect("release_speed_bias", {"height_offset_m": 1e-3})
    speeds = [drop(rig, h)[1].speed_m_per_s for h in (0.01, 0.05)]
    ratios = [s / math.sqrt(2 * 9.80665 * h) for s, h in zip(speeds, (0.01, 0.05), strict=True)]
    assert ratios == pytest.approx([math.sqrt(1.1), math.sqrt(1.02)])


def test_a_recontact_is_a_second_pulse() -> None:
    """It comes when it was told to, smaller."""
    volts, _ = drop(with_effect("recontact", {"delay_s": 1e-3, "speed_ratio": 0.3}))
    second = volts[BEFORE + 990 :]
    assert 0.1 * np.max(volts) < np.max(second) < 0.5 * np.max(volts)


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
    effect_id: str, values: Mapping[str, float]
) -> None:
    """It decays with the time since the release, so a higher drop meets less of it."""
    rig = with_effect(effect_id, values)
    low, high = (drop(rig, h, number=3)[0][:80] for h in (0.005, 0.05))
    assert 0.0 < np.max(np.abs(high)) < np.max(np.abs(low)) < 0.3


def test_a_solenoid_is_in_step_with_the_release_and_a_cable_is_not() -> None:
    """Two shots from one height show the same pickup, and two different swings."""
    values = {"amplitude_v": 0.1, "frequency_hz": 2000.0, "decay_s": 0.05}
    for effect_id, same in (("x_solenoid_pickup", True), ("x_microphonic_cable", False)):
        rig = with_effect(effect_id, values)
        first, second = (drop(rig, number=n)[0][:80] for n in (1, 2))
        assert np.allclose(first, second) == same


def test_a_dead_zone_swallows_the_end_of_the_ring() -> None:
    """What is far above its width only loses the width."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("x_dead_zone", {"width_v": 0.02}))
    assert np.max(base) - np.max(volts) == pytest.approx(0.02, rel=1e-6)
    late = np.abs(base) < 1e-3
    np.testing.assert_allclose(volts[late], 0.0, atol=1e-6)


def test_a_second_spot_and_a_snap_begin_at_their_depth() -> None:
    """Slow drops that stay above it know nothing of it."""
    for effect_id, values in (
        ("x_second_asperity", {"share": 0.3, "gap_m": 1e-5}),
        ("x_snap_through", {"share": 0.2, "depth_m": 2e-5}),
    ):
        changes = []
        for height in (1e-4, 0.05):
            base, _ = drop(a_rig(), height)
            volts, _ = drop(with_effect(effect_id, values), height)
            changes.append(np.max(np.abs(volts - base)) / np.max(base))
        assert changes[0] < 1e-3
        assert changes[1] > 0.01


def test_drifts_grow_with_the_number_of_the_shot() -> None:
    """The first release of a rig knows nothing of them."""
    for effect_id, values in (
        ("x_warming_sphere", {"final_change": -0.05, "shots_to_settle": 20.0}),
        ("x_loosening_seat", {"final_loss": 0.05, "shots_to_settle": 20.0}),
    ):
        rig = with_effect(effect_id, values)
        sizes = [np.std(drop(rig, number=n)[0] - drop(a_rig(), number=n)[0]) for n in (0, 5, 50)]
        assert sizes[0] < 1e-9
        assert 1e-4 < sizes[1] < sizes[2]


def test_a_loose_screw_rings_longer_than_the_crystal() -> None:
    """And is a mode of its own: with the spring equally stiff both ways it is a linear one."""
    values = {"mass_ratio": 0.01, "frequency_hz": 8e3}
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("x_rattling_screw", values))
    assert np.std((volts - base)[900:1400]) > 3 * np.std(base[900:1400])


def test_an_uncertain_release_matters_most_at_low_drops() -> None:
    """A swinging tube and a seal that drags add metres, not shares."""
    for effect_id, values in (
        ("x_swinging_tube", {"speed_m_per_s": 0.02}),
        ("x_dragged_release", {"mean_loss_m": 5e-4}),
    ):
        rig = with_effect(effect_id, values)
        spread = []
        for height in (0.01, 0.05):
            shots = [Shot(n, "acetal", "pvc", height, np.random.default_rng(0)) for n in range(60)]
            speeds = [begin_flight(rig, s, 0.0, 0.0, (9, s.number)).speed_m_per_s for s in shots]
            spread.append(np.std(speeds) / math.sqrt(2 * 9.80665 * height))
        assert spread[0] > 1.5 * spread[1]


def test_a_wandering_clock_moves_the_flanks_and_not_the_charge() -> None:
    """Misfit where the signal is steep, none where it is flat, and the same area."""
    base, _ = drop(a_rig())
    values = {"amplitude_s": 2e-7, "frequency_hz": 5e3}
    volts, _ = drop(with_effect("x_clock_wander", values))
    steep = np.argmax(np.abs(np.gradient(base)))
    assert np.abs(volts - base)[steep] > 5 * np.abs(volts - base)[np.argmax(base)]
    assert np.sum(volts) == pytest.approx(np.sum(base), rel=5e-3)


def test_a_drooping_supply_loses_gain_as_the_charge_grows() -> None:
    """The rise is right, the ring is too small."""
    base, _ = drop(a_rig())
    volts, _ = drop(with_effect("x_supply_droop", {"loss_per_v_s": 200.0, "recovery_s": 5e-3}))
    gain = volts[base > 0.05 * np.max(base)] / base[base > 0.05 * np.max(base)]
    assert gain[0] > 0.999
    assert gain[-1] < 0.99


def test_sliding_ends_within_the_pulse() -> None:
    """The shear is felt early and not in the ring."""
    base, _ = drop(a_rig())
    values = {"cross_share": 0.05, "slides_until": 0.4}
    volts, touch = drop(with_effect("x_oblique_friction", values))
    early = BEFORE + round(0.25 * touch.contact_time_s * RATE_HZ)
    assert volts[early] == pytest.approx(1.05 * base[early], rel=5e-3)
    np.testing.assert_allclose(volts[400:], base[400:], atol=1e-9)


def test_a_hit_off_the_centre_only_loses() -> None:
    """Every shot's gain is its own, none above one."""
    base = np.max(drop(a_rig())[0])
    rig = with_effect("x_off_centre", {"mean_loss": 0.01})
    peaks = [np.max(drop(rig, number=n)[0]) / base for n in range(12)]
    assert max(peaks) <= 1.0 + 1e-6
    assert np.std(peaks) > 2e-3


def test_an_effect_acts_only_within_its_scope() -> None:
    """A coupon that is thin says nothing about another coupon."""
    rig = with_effect("finite_thickness", {"thickness_m": 2e-3}, Scope(surface="specimen"))
    same, _ = drop(rig, surface="polycarbonate")
    np.testing.assert_array_equal(same, drop(a_rig(), surface="polycarbonate")[0])
    other, _ = drop(rig, surface="specimen")
    assert np.max(np.abs(other - drop(a_rig(), surface="specimen")[0])) > 0.01


def test_several_effects_act_at_once() -> None:
    """Contact, sensor, electronics and release add up without getting into each other's way."""
    effects = (
        make_effect("viscoelastic_damping", {"relaxation_s": 1e-6}),
        make_effect("finite_thickness", {"thickness_m": 5e-3}),
        make_effect("sensor_nonlinearity", {"curvature_per_v": 0.01}),
        make_effect("coupler_highpass", {"time_constant_s": 0.01}),
        make_effect("release_speed_bias", {"height_offset_m": 5e-4}),
    )
    volts, touch = drop(a_rig(*effects))
    assert volts[2500] < 0.0
    assert touch.contact_time_s < drop(a_rig())[1].contact_time_s


def test_unknown_and_missing_parameters_are_refused() -> None:
    """No effect runs on numbers nobody gave."""
    with pytest.raises(ValueError, match="takes exactly"):
        make_effect("echo", {"delay_s": 1e-5})
    with pytest.raises(ValueError, match="No effect 'ecco'"):
        make_effect("ecco", {})


def test_random_draws_come_from_outside_the_library_one_time_in_four() -> None:
    """And every kind comes up."""
    rng = np.random.default_rng(0)
    drawn = [draw_effect(rng, ["acetal"], ["specimen"]) for _ in range(2000)]
    outside = [e for e in drawn if e.id.startswith("x_")]
    assert len(outside) / len(drawn) == pytest.approx(0.25, abs=0.03)
    assert {e.id for e in drawn} == set(EFFECTS) - {"crystal_dynamics"}
    assert any(e.scope.surface for e in drawn)
    assert any(e.scope.sphere for e in drawn)
