"""Each effect of the simulator: nothing at its neutral value, its tell-tale at a usual one."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.simulated.draw import draw_effect, draw_scope
from drivers.simulated.effects import EFFECTS, INVENTED, LIBRARY, Scope, make_effect

if TYPE_CHECKING:
    from tests.drivers.simulated.conftest import Lab


@pytest.mark.parametrize("effect_id", sorted(EFFECTS))
def test_neutral_value_is_the_base_model(lab: Lab, effect_id: str) -> None:
    """At its neutral value an effect cannot be told from its absence."""
    cell = "hsd" if effect_id == "crystal_dynamics" else "kv"
    base, _ = lab.drop(lab.a_rig(cell=cell))
    same, _ = lab.drop(lab.with_effect(effect_id, EFFECTS[effect_id].neutral_values(), cell=cell))
    np.testing.assert_allclose(same, base, atol=2e-6 * np.max(base))
    conversion = make_effect(effect_id, EFFECTS[effect_id].neutral_values()).conversion()
    assert conversion is None


@pytest.mark.parametrize("effect_id", sorted(EFFECTS))
def test_a_drawn_effect_changes_the_record(lab: Lab, effect_id: str) -> None:
    """Whatever size is drawn, the effect does something and the record stays finite."""
    cell = "hsd" if effect_id == "crystal_dynamics" else "kv"
    effect = EFFECTS[effect_id](EFFECTS[effect_id].draw(np.random.default_rng(1)))
    volts, _ = lab.drop(lab.a_rig(effect, cell=cell), number=20)
    assert np.all(np.isfinite(volts))
    base, _ = lab.drop(lab.a_rig(cell=cell), number=20)
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


def test_viscoelastic_loss_falls_with_speed_as_the_fifth_root(lab: Lab) -> None:
    """Kuwabara-Kono: 1 - eps ~ v^(1/5), h^(1/10)."""
    rig = lab.a_rig(make_effect("viscoelastic_damping", {"relaxation_s": 1e-6}), restitution=1.0)
    bare = lab.a_rig(restitution=1.0)
    gained = [lab.loss(rig, h) - lab.loss(bare, h) for h in (0.01, 0.05)]
    assert gained[1] / gained[0] == pytest.approx(5.0**0.1, rel=0.02)


def test_hunt_crossley_loss_grows_with_speed(lab: Lab) -> None:
    """Hunt-Crossley: 1 - eps ~ v, h^(1/2)."""
    rig = lab.a_rig(
        make_effect("hunt_crossley_damping", {"damping_s_per_m": 0.05}), restitution=1.0
    )
    bare = lab.a_rig(restitution=1.0)
    gained = [lab.loss(rig, h) - lab.loss(bare, h) for h in (0.01, 0.05)]
    assert gained[1] / gained[0] == pytest.approx(5.0**0.5, rel=0.03)


def test_stress_relaxation_goes_from_relaxed_to_glassy(lab: Lab) -> None:
    """A fast solid stays relaxed, a slow one is 1 + g times as stiff."""
    base = lab.drop(lab.a_rig())[1].contact_time_s
    fast = lab.with_effect("stress_relaxation", {"strength": 0.2, "relaxation_time_s": 1e-9})
    slow = lab.with_effect("stress_relaxation", {"strength": 0.2, "relaxation_time_s": 1.0})
    assert lab.drop(fast)[1].contact_time_s == pytest.approx(base, rel=1e-3)
    assert lab.drop(slow)[1].contact_time_s == pytest.approx(base * 1.2**-0.4, rel=5e-3)


def test_yield_has_a_threshold_in_speed_and_cuts_the_peak(lab: Lab) -> None:
    """Below the threshold nothing, above it a lower peak and a lower rebound."""
    rig = lab.with_effect("plastic_yield", {"yield_pressure_pa": 5e7})
    low, low_base = lab.drop(rig, 0.002)[1], lab.drop(lab.a_rig(), 0.002)[1]
    high, high_base = lab.drop(rig, 0.05)[1], lab.drop(lab.a_rig(), 0.05)[1]
    assert low.peak_force_n == pytest.approx(low_base.peak_force_n, rel=1e-6)
    assert high.peak_force_n < 0.97 * high_base.peak_force_n
    assert high.rebound_speed_m_per_s < 0.97 * high_base.rebound_speed_m_per_s


def test_yield_conserves_nothing_it_should_not(lab: Lab) -> None:
    """Of a lossless sphere, a yielding contact keeps energy, and rebounds slower than it came."""
    rig = lab.a_rig(make_effect("plastic_yield", {"yield_pressure_pa": 6e7}), restitution=1.0)
    assert 0.5 < 1.0 - lab.loss(rig, 0.05) < 0.99


def test_adhesion_pulls_at_the_end_and_is_invisible_unless_tacky(lab: Lab) -> None:
    """A tacky contact lasts longer; one of 1 mJ/m2 shows less than the noise."""
    base, touch = lab.drop(lab.a_rig())
    weak, _ = lab.drop(lab.with_effect("adhesion", {"surface_energy_j_per_m2": 1e-3}))
    tacky, longer = lab.drop(lab.with_effect("adhesion", {"surface_energy_j_per_m2": 2.0}))
    assert np.max(np.abs(weak - base)) < 5e-4
    assert longer.contact_time_s > touch.contact_time_s
    assert longer.rebound_speed_m_per_s < touch.rebound_speed_m_per_s
    assert np.min(tacky) < np.min(base)


def test_a_thin_coupon_hardens_with_amplitude(lab: Lab) -> None:
    """Contact shortens, and more so from higher up."""
    rig = lab.with_effect("finite_thickness", {"thickness_m": 3e-3})
    low, high = (
        lab.drop(rig, h)[1].contact_time_s / lab.drop(lab.a_rig(), h)[1].contact_time_s
        for h in (0.005, 0.05)
    )
    assert high < low < 1.0


def test_a_radiating_plate_takes_energy_without_ringing(lab: Lab) -> None:
    """The rebound drops; the ring after the pulse does not grow."""
    base, touch = lab.drop(lab.a_rig())
    volts, slower = lab.drop(lab.with_effect("plate_radiation", {"impedance_n_s_per_m": 300.0}))
    assert slower.rebound_speed_m_per_s < 0.97 * touch.rebound_speed_m_per_s
    assert np.max(volts) < np.max(base)


@pytest.mark.parametrize("form", ["toe", "series"])
def test_roughness_softens_low_drops_most(lab: Lab, form: str) -> None:
    """The soft toe lengthens contact, worse at low speed."""
    rig = lab.with_form("surface_roughness", {"roughness_m": 3e-6}, form)
    low, high = (
        lab.drop(rig, h)[1].contact_time_s / lab.drop(lab.a_rig(), h)[1].contact_time_s
        for h in (0.002, 0.05)
    )
    assert low > high > 1.0


def test_the_dashpots_reaction_brings_the_peak_forward(lab: Lab) -> None:
    """The dissipative force is largest while loading."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("dashpot_reaction", {"share": 1.0}))
    assert np.argmax(volts) < np.argmax(base)


def test_a_tape_moves_the_ring_with_the_coupon(lab: Lab) -> None:
    """The heavier coupon rings slower on the same tape."""
    rig = lab.with_effect("adhesive_layer", {"stiffness_n_per_m": 3e9, "damping_n_s_per_m": 400.0})
    assert lab.ring_frequency(rig, "aluminium") < lab.ring_frequency(rig, "polycarbonate")
    assert lab.ring_frequency(lab.a_rig(), "aluminium") == pytest.approx(
        lab.ring_frequency(lab.a_rig(), "polycarbonate"), rel=0.01
    )


def test_a_coupon_mode_varies_from_shot_to_shot(lab: Lab) -> None:
    """Repeated drops give different amplitudes of the mode."""
    values = {
        "frequency_hz": 3e4,
        "damping_ratio": 0.01,
        "mass_ratio": 0.05,
        "hit_scatter": 0.3,
    }
    rig = lab.with_effect("coupon_mode", values)
    base, _ = lab.drop(lab.a_rig())
    sizes = [np.std(lab.drop(rig, number=n)[0] - base) for n in range(8)]
    assert np.std(sizes) > 0.05 * np.mean(sizes)


def test_crystal_dynamics_turns_a_rigid_cell_into_one_that_rings(lab: Lab) -> None:
    """The pulse comes later and rings after it."""
    rigid, touch = lab.drop(lab.a_rig(cell="hsd"))
    values = {"natural_frequency_hz": 17.3e3, "damping_ratio": 0.073}
    rings, _ = lab.drop(lab.with_effect("crystal_dynamics", values, cell="hsd"))
    after = lab.BEFORE + round(touch.contact_time_s * lab.RATE_HZ) + 5
    assert np.all(rigid[after:] == 0.0)
    assert np.ptp(rings[after:]) > 0.02 * np.max(rings)
    assert np.argmax(rings) > np.argmax(rigid)


def test_crystal_dynamics_on_a_cell_that_moves_is_refused(lab: Lab) -> None:
    """The step from HSD to KV can be taken once."""
    values = {"natural_frequency_hz": 17.3e3, "damping_ratio": 0.073}
    with pytest.raises(ValueError, match="moves already"):
        lab.drop(lab.with_effect("crystal_dynamics", values))


def test_a_second_mode_appears_at_its_own_frequency(lab: Lab) -> None:
    """The added signal has its line where it was put."""
    values = {"frequency_hz": 5e4, "damping_ratio": 0.01, "share": 0.2}
    extra = lab.drop(lab.with_effect("second_mode", values))[0] - lab.drop(lab.a_rig())[0]
    line = np.abs(np.fft.rfft(extra[900:2900]))  # the crystal's own ring has died by then
    assert np.argmax(line) * lab.RATE_HZ / 2000 == pytest.approx(5e4, rel=0.02)


@pytest.mark.parametrize("sphere", ["acetal", "acetal_small"])
def test_a_soft_stand_rings_slowly_under_every_sphere(lab: Lab, sphere: str) -> None:
    """Long after the crystal is silent, the base still swings at its own frequency."""
    values = {"frequency_hz": 2e3, "damping_ratio": 0.02, "base_mass_kg": 1.0}
    volts, _ = lab.drop(lab.with_effect("base_compliance", values), sphere=sphere, samples=6000)
    late = volts[2500:]
    line = np.abs(np.fft.rfft(late - late.mean(), 20_000))
    assert np.argmax(line) * lab.RATE_HZ / 20_000 == pytest.approx(2e3, rel=0.05)


def test_nonlinearity_shows_at_the_peak(lab: Lab) -> None:
    """The misfit is b V^2."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("sensor_nonlinearity", {"curvature_per_v": 0.01}))
    np.testing.assert_allclose(volts - base, 0.01 * base**2, atol=1e-9)


def test_a_highpass_undershoots_by_impulse_over_time_constant(lab: Lab) -> None:
    """After the ring the signal lies at -impulse/tau."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("coupler_highpass", {"time_constant_s": 0.05}))
    assert volts[2000] == pytest.approx(-base.sum() / lab.RATE_HZ / 0.05, rel=0.04)


@pytest.mark.parametrize("filter_order", [1.0, 2.0])
def test_a_lowpass_delays_and_smooths(lab: Lab, filter_order: float) -> None:
    """The peak comes later and lower."""
    base, _ = lab.drop(lab.a_rig())
    values = {"cutoff_hz": 2.5e4, "filter_order": filter_order}
    volts, _ = lab.drop(lab.with_effect("amplifier_lowpass", values))
    assert np.argmax(volts) > np.argmax(base)
    assert np.max(volts) < np.max(base)


@pytest.mark.parametrize("softness", [0.0, 0.1])
def test_clipping_flattens_the_top(lab: Lab, softness: float) -> None:
    """Nothing passes the limit, and a hard one is met by many samples."""
    volts, _ = lab.drop(lab.with_effect("clipping", {"limit_v": 1.5, "softness": softness}))
    assert np.max(volts) <= 1.5
    if softness == 0.0:
        assert np.count_nonzero(volts == 1.5) > 10


def test_an_echo_is_a_delayed_copy(lab: Lab) -> None:
    """What is added is the signal itself, later and smaller."""
    base, _ = lab.drop(lab.a_rig())
    volts, _ = lab.drop(lab.with_effect("echo", {"delay_s": 2e-5, "ratio": 0.1}))
    np.testing.assert_allclose((volts - base)[20:], 0.1 * base[:-20], atol=2e-4 * np.max(base))


def test_hum_is_there_before_the_trigger(lab: Lab) -> None:
    """A sine of the amplitude asked for runs through the whole record."""
    values = {"amplitude_v": 0.05, "frequency_hz": 50.0, "harmonics": 1.0}
    rig = lab.with_effect("mains_hum", values)
    hum = rig.effects[0].ambient(np.arange(20_000) / lab.RATE_HZ)
    assert hum is not None
    assert np.max(hum) == pytest.approx(0.05, rel=1e-3)
    volts, _ = lab.drop(rig)
    assert np.any(volts[: lab.BEFORE - 5] != 0.0)


def test_a_wrong_height_matters_most_at_low_drops(lab: Lab) -> None:
    """Impact speed is that of the true height."""
    rig = lab.with_effect("release_speed_bias", {"height_offset_m": 1e-3})
    speeds = [lab.drop(rig, h)[1].speed_m_per_s for h in (0.01, 0.05)]
    ratios = [s / math.sqrt(2 * 9.80665 * h) for s, h in zip(speeds, (0.01, 0.05), strict=True)]
    assert ratios == pytest.approx([math.sqrt(1.1), math.sqrt(1.02)])


def test_a_recontact_is_a_second_pulse(lab: Lab) -> None:
    """It comes when it was told to, smaller."""
    volts, _ = lab.drop(lab.with_effect("recontact", {"delay_s": 1e-3, "speed_ratio": 0.3}))
    second = volts[lab.BEFORE + 990 :]
    assert 0.1 * np.max(volts) < np.max(second) < 0.5 * np.max(volts)


def test_a_slow_recontact_hops_on_for_the_rest_of_the_record(lab: Lab) -> None:
    """In free flight for two rebound speeds over g, however quiet the cell is by then."""
    volts, _ = lab.drop(lab.with_effect("recontact", {"delay_s": 5e-4, "speed_ratio": 0.02}))
    second = lab.BEFORE + 500
    smooth = np.convolve(volts, np.ones(20) / 20.0, "same")
    quiet = 1e-3 * np.max(volts[second:])
    ended = second + int(np.argmax(np.abs(smooth[second + 400 :]) < quiet)) + 400
    assert np.max(smooth[ended + 100 :]) > 20.0 * quiet


def test_an_effect_acts_only_within_its_scope(lab: Lab) -> None:
    """A coupon that is thin says nothing about another coupon."""
    rig = lab.with_effect("finite_thickness", {"thickness_m": 2e-3}, Scope(surface="specimen"))
    same, _ = lab.drop(rig, surface="polycarbonate")
    np.testing.assert_array_equal(same, lab.drop(lab.a_rig(), surface="polycarbonate")[0])
    other, _ = lab.drop(rig, surface="specimen")
    assert np.max(np.abs(other - lab.drop(lab.a_rig(), surface="specimen")[0])) > 0.01


def test_a_scope_may_name_several_materials(lab: Lab) -> None:
    """It acts on each of them and on no other; the truth lists them in order."""
    scope = Scope(surface=("specimen", "aluminium"))
    rig = lab.with_effect("plate_radiation", {"impedance_n_s_per_m": 300.0}, scope)
    for surface, felt in (("specimen", True), ("aluminium", True), ("polycarbonate", False)):
        seen, _ = lab.drop(rig, surface=surface)
        assert np.array_equal(seen, lab.drop(lab.a_rig(), surface=surface)[0]) is not felt
    assert scope.to_json() == {"surface": ["aluminium", "specimen"]}
    assert Scope(surface=("specimen",)) == Scope(surface="specimen")
    with pytest.raises(ValueError, match="acts nowhere"):
        Scope(sphere=())


def test_one_some_or_all_materials_are_drawn() -> None:
    """Of four surfaces and no sphere: one, two or three, or all, each of the three as often."""
    rng = np.random.default_rng(0)
    names = ["a", "b", "c", "d"]
    drawn = [draw_scope(rng, [], names).to_json().get("surface", "") for _ in range(3000)]
    counts = Counter("all" if not d else "one" if isinstance(d, str) else "some" for d in drawn)
    for how_many in ("one", "some", "all"):
        assert counts[how_many] / len(drawn) == pytest.approx(1 / 3, abs=0.04)
    assert {len(d) for d in drawn if isinstance(d, list)} == {2, 3}
    few = {str(draw_scope(rng, ["a", "b"], []).to_json()) for _ in range(100)}
    assert few == {"{}", "{'sphere': 'a'}", "{'sphere': 'b'}"}


def test_several_effects_act_at_once(lab: Lab) -> None:
    """Contact, sensor, electronics and release add up without getting into each other's way."""
    effects = (
        make_effect("viscoelastic_damping", {"relaxation_s": 1e-6}),
        make_effect("finite_thickness", {"thickness_m": 5e-3}),
        make_effect("sensor_nonlinearity", {"curvature_per_v": 0.01}),
        make_effect("coupler_highpass", {"time_constant_s": 0.01}),
        make_effect("release_speed_bias", {"height_offset_m": 5e-4}),
    )
    volts, touch = lab.drop(lab.a_rig(*effects))
    assert volts[2500] < 0.0
    assert touch.contact_time_s < lab.drop(lab.a_rig())[1].contact_time_s


def test_unknown_and_missing_parameters_are_refused() -> None:
    """No effect runs on numbers nobody gave."""
    with pytest.raises(ValueError, match="takes exactly"):
        make_effect("echo", {"delay_s": 1e-5})
    with pytest.raises(ValueError, match="No effect 'ecco'"):
        make_effect("ecco", {})


def test_random_draws_come_from_outside_the_library_one_time_in_four() -> None:
    """And every kind comes up."""
    rng = np.random.default_rng(0)
    drawn = [draw_effect(rng, ["acetal"], ["specimen"]) for _ in range(4000)]
    outside = [e for e in drawn if e.id.startswith("x_")]
    assert len(outside) / len(drawn) == pytest.approx(0.25, abs=0.03)
    assert {e.id for e in drawn} == set(EFFECTS) - {"crystal_dynamics"}
    assert any(e.scope.surface for e in drawn)
    assert any(e.scope.sphere for e in drawn)
