"""What is drawn for a trial."""

from __future__ import annotations

import dataclasses
from collections import Counter

import pytest

from drivers.simulated.drops import draw_drops
from drivers.simulated.effects import INVENTED, LIBRARY
from drivers.simulated.label_spread import EXACT, TYPICAL
from drivers.simulated.mistakes import MISTAKES
from drivers.simulated.rig_model import LOSS, rig_model
from impactd.bench.blind.plan import KINDS, colour_of, draw_plan


def test_a_trial_is_drawn_from_its_kind_and_seed() -> None:
    """The same again for the same, other rigs for other kinds and seeds."""
    assert draw_plan("library", 5) == draw_plan("library", 5)
    seeds = {draw_plan(kind, seed).campaign_seed for kind in KINDS for seed in range(20)}
    assert len(seeds) == 20 * len(KINDS)
    with pytest.raises(ValueError, match="kind of trial is called 'dirty'"):
        draw_plan("dirty", 1)


def test_a_kind_says_what_acts() -> None:
    """Clean rigs, one of the library, one of none, two of different slots, a missing crystal."""
    for seed in range(40):
        drawn = {kind: draw_plan(kind, seed) for kind in KINDS}
        assert drawn["clean"].effects == drawn["hsd"].effects == ()
        assert [e.id in LIBRARY for e in drawn["library"].effects] == [True]
        assert [e.id in INVENTED for e in drawn["outside"].effects] == [True]
        first, second = drawn["pair"].effects
        assert first.slot != second.slot
        assert drawn["hsd"].base == "hsd"
        assert drawn["mistake"].effects == ()
        assert [k for k, plan in drawn.items() if plan.mistake is not None] == ["mistake"]
        (other,) = drawn["form"].effects
        assert other.form != other.form_on("closed")
        assert dataclasses.replace(drawn["pair"].settings).effects == drawn["pair"].effects


@pytest.mark.parametrize(
    ("kind", "effects", "noise_v", "sphere", "surface"),
    [
        ("clean", [], 0.00243722940550802, "acetal", "pvc"),
        ("library", ["release_speed_bias"], 0.0022807781577586215, "polypropylene", "pvc"),
        ("outside", ["x_stuck_bit"], 0.00102127819173296, "acetal", "polycarbonate"),
        ("pair", ["echo", "release_speed_bias"], 0.0029985771665460856, "hdpe", "polycarbonate"),
        ("hsd", [], 0.0016000671888057446, "hdpe", "polycarbonate"),
    ],
)
def test_a_kind_that_was_added_draws_nothing_else_for_the_others(
    kind: str, effects: list[str], noise_v: float, sphere: str, surface: str
) -> None:
    """Trial 7 of the first five kinds is what it was when there were five."""
    plan = draw_plan(kind, 7, "closed")
    assert plan.campaign_seed == 70 + KINDS.index(kind) < 75
    assert [e.id for e in plan.effects] == effects
    assert plan.settings.noise.rms_v == noise_v
    assert (list(plan.settings.spheres)[1], list(plan.settings.surfaces)[1]) == (sphere, surface)
    assert plan.mistake is None


def test_every_mistake_comes_up_among_the_drops_of_its_campaign() -> None:
    """Each of the eight, of materials and heights that the trial has."""
    plans = [draw_plan("mistake", seed) for seed in range(80)]
    assert {p.mistake.id for p in plans if p.mistake} == set(MISTAKES)
    for plan in plans:
        assert plan.mistake is not None
        scope = plan.mistake.scope
        assert scope.get("sphere", "acetal_small") in plan.settings.spheres
        drops = draw_drops(plan.settings, plan.campaign_seed).in_order
        assert 0 <= scope.get("shot", 0) < len(drops) == 54
        height = plan.mistake.numbers.get("drop_height_m", drops[0][2])
        assert height in {h for _, _, h in drops}


def _names(wanted: str | tuple[str, ...] | None) -> set[str]:
    return set() if wanted is None else {wanted} if isinstance(wanted, str) else set(wanted)


def test_an_effect_of_materials_acts_on_one_some_or_all_of_the_campaign() -> None:
    """Each of the three as often, on spheres or surfaces that fall or lie there."""
    plans = [draw_plan("library", seed, "drawn") for seed in range(200)]
    scopes = [(p, p.effects[0].scope) for p in plans]
    assert any(s.sphere for _, s in scopes)
    assert any(s.surface for _, s in scopes)
    for plan, scope in scopes:
        assert _names(scope.sphere) < set(plan.settings.spheres)
        assert _names(scope.surface) < set(plan.settings.surfaces)
    counts = Counter(
        len(_names(s.sphere) | _names(s.surface))
        for p, s in scopes
        if p.effects[0].per_material and p.effects[0].slot == "contact"
    )
    assert set(counts) == {0, 1, 2}
    assert max(counts.values()) < 2 * min(counts.values())


def test_old_seeds_have_the_papers_rig_and_labels_that_are_true() -> None:
    """And what is drawn for another rig leaves materials, noise and the kind of effect alone."""
    for seed in range(20):
        old, drawn = draw_plan("library", seed, "paper"), draw_plan("library", seed, "drawn")
        assert (old.settings.spread, old.settings.bits) == (EXACT, 16)
        assert (old.whole, drawn.whole) == ("kv", "kv2")
        assert drawn.settings.spread == TYPICAL
        assert old.settings.spheres == drawn.settings.spheres
        assert old.settings.surfaces == drawn.settings.surfaces
        assert draw_plan("clean", seed, "drawn").settings.noise == (
            draw_plan("clean", seed, "paper").settings.noise
        )


def test_drawn_rigs_bring_forms_and_converters_that_the_paper_has_not() -> None:
    """In kinds with an effect any of its forms, in every kind 8 and 12 bits."""
    for kind in KINDS:
        plans = [draw_plan(kind, seed, "drawn") for seed in range(60)]
        assert {p.settings.bits for p in plans} == {8, 12, 16}
        assert {rig_model("drawn", p.campaign_seed).loss for p in plans} == set(LOSS)
    effects = [e for seed in range(300) for e in draw_plan("library", seed, "drawn").effects]
    shaped = ("finite_thickness", "stress_relaxation", "amplifier_lowpass", "surface_roughness")
    for effect_id in shaped:
        found = {e.form for e in effects if e.id == effect_id}
        assert found == set(LIBRARY[effect_id].sound_forms or LIBRARY[effect_id].forms)


def test_a_rig_that_keeps_the_third_law_never_lacks_it() -> None:
    """Its reaction is no effect there."""
    for seed in range(200):
        assert all(e.id != "dashpot_reaction" for e in draw_plan("pair", seed, "closed").effects)


def test_every_noise_and_every_effect_comes_up() -> None:
    """White, two correlations, and now and then noise of the wrong sort."""
    noises = [draw_plan("clean", seed).settings.noise for seed in range(300)]
    assert {(colour_of(n), n.ar1) for n in noises} == {
        ("white", 0.0),
        ("ar1", 0.3),
        ("ar1", 0.6),
        ("pink", 0.0),
    }
    assert sum(colour_of(n) == "pink" for n in noises) < 60
    assert all(1e-3 <= n.rms_v <= 3e-3 for n in noises)
    drawn = {draw_plan("outside", seed).effects[0].id for seed in range(600)}
    assert drawn == set(INVENTED)
