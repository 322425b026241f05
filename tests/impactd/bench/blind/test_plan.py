"""What is drawn for a trial."""

from __future__ import annotations

import dataclasses

import pytest

from drivers.simulated.effects import INVENTED, LIBRARY
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
        assert dataclasses.replace(drawn["pair"].settings).effects == drawn["pair"].effects


def test_some_effects_act_on_one_material_of_the_campaign() -> None:
    """A sphere's or a surface's, and one that falls or lies there."""
    plans = [draw_plan("library", seed) for seed in range(200)]
    scopes = [(p, p.effects[0].scope) for p in plans]
    assert any(s.sphere for _, s in scopes)
    assert any(s.surface for _, s in scopes)
    for plan, scope in scopes:
        assert scope.sphere in {None, *plan.settings.spheres}
        assert scope.surface in {None, *plan.settings.surfaces}


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
