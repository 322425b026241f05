"""An effect of one material: found on its shots alone, felt by them alone, told as theirs."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from analysis.campaign import Campaign, Uncertainty
from analysis.diagnosis.candidate import is_there_before
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.grouping_search import sizes_of
from analysis.diagnosis.multistart import usual_place
from analysis.diagnosis.named_model import definition_of, model_of
from analysis.diagnosis.one_material import (
    apart_from,
    can_be_one_materials,
    far_begin,
    single_materials,
    tried_alone,
    without_each_material,
)
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.diagnosis.successive_halving import PresentModel
from analysis.effects.acts_on import ActsOn
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.fit_shot import FitShot
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect, Scope
from impactd.storage.campaign_folder import read_campaign

MODE = {"frequency_hz": 18e3, "damping_ratio": 0.02, "mass_ratio": 0.05, "hit_scatter": 0.0}


def campaign(folder: Path, *effects: Effect) -> Campaign:
    """Return two spheres on three surfaces from three heights, read back from a folder."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        drop_heights_m=(0.0115, 0.0255, 0.0465),
        repeats=1,
        effects=effects,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 11)))


@pytest.fixture(scope="module")
def swinging(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """A large mode of the specimen, and of nothing else."""
    mode = make_effect("coupon_mode", MODE, Scope(surface="specimen"))
    return diagnose_campaign(campaign(tmp_path_factory.mktemp("swinging"), mode))


def test_a_large_mode_of_one_coupon_is_found_on_its_shots(swinging: Diagnosis) -> None:
    """The name, its group and its frequency, although no fit of all shots comes near."""
    assert swinging.verdict == "identified"
    taken = swinging.chosen[0]
    assert taken.effect_id == "coupon_mode"
    assert taken.effect.only == ActsOn("surface", ("specimen",))
    numbers = dict(zip(taken.problem.names, taken.fitted.theta, strict=True))
    found_hz = math.exp(numbers["coupon_mode.frequency_hz[specimen]"])
    assert found_hz == pytest.approx(MODE["frequency_hz"], rel=2e-3)


def test_one_material_makes_the_difference_where_heights_are_off_their_labels(
    tmp_path: Path,
) -> None:
    """What the stated heights allow is no structure of the other shots."""
    softer = make_effect("plastic_yield", {"yield_pressure_pa": 4e7}, Scope(sphere="acetal_small"))
    made = campaign(tmp_path, softer)
    shots = tuple(
        dataclasses.replace(s, drop_height_m=(s.drop_height_m or 0.0) + 2e-3) for s in made.shots
    )
    stated = dataclasses.replace(made, shots=shots, u_height_offset_m=Uncertainty(4e-3))
    problem, nuisances = with_start(build(stated, model_named("kv2")))
    present = PresentModel(problem, joint.fit(problem, nuisances), usual_place(problem, nuisances))
    found = list(single_materials(present, without_each_material(present)))
    assert [one.rest.only for one in found] == [ActsOn("sphere", ("acetal_small",))]


def test_the_other_shots_do_not_feel_it(swinging: Diagnosis) -> None:
    """Their trace has no derivative by its numbers, and is the base model's."""
    last = swinging.steps[-1]
    model, base = last.problem.model, swinging.steps[0].problem.model
    other = next(s for s in last.problem.shots if s.shot.surface != "specimen")
    row = last.problem.shots.index(other)
    shared, _ = last.problem.shared_local(other, last.fitted.theta)
    local = np.concatenate([shared, last.fitted.nuisances[row]])
    seen, jacobian, _ = model.linearise(local, other.frame)
    own = list(model.places["coupon_mode"])
    assert not jacobian[:, own].any()
    assert np.array_equal(seen.signal, base.predict(np.delete(local, own), other.frame).signal)


def test_it_is_told_and_kept_as_that_materials(swinging: Diagnosis) -> None:
    """JSON names the group; the named model acts on the same shots when it is built again."""
    told = diagnosis_json(swinging, software="impactd test")["effects"][0]
    assert told["scope"] == "surface"
    assert "mass_share[specimen]" in told["parameters"]
    last = swinging.steps[-1]
    definition = definition_of(last.problem, last.fitted)
    assert definition is not None
    assert model_of(definition).effects[0].only == ActsOn("surface", ("specimen",))


@pytest.mark.slow
def test_of_two_effects_the_other_is_found_without_the_material(tmp_path: Path) -> None:
    """A leaking coupler everywhere and a sphere that yields: each is found where it is alone."""
    both = campaign(
        tmp_path,
        make_effect("coupler_highpass", {"time_constant_s": 0.02}),
        make_effect("plastic_yield", {"yield_pressure_pa": 4e7}, Scope(sphere="acetal_small")),
    )
    found = diagnose_campaign(both)
    assert found.verdict in ("identified", "partial")
    assert {c.effect_id for c in found.chosen} == {"coupler_highpass", "plastic_yield"}


@pytest.mark.parametrize(
    ("name", "done"),
    [("coupon_mode", True), ("plastic_yield", True), ("adhesive_layer", False), ("echo", False)],
)
def test_what_all_coupons_have_is_asked_of_all_shots(name: str, done: bool) -> None:
    """A tape under every coupon is not looked for under one alone."""
    assert can_be_one_materials(effect_named(name)) is done


@pytest.mark.slow
def test_a_stiff_tape_is_found_although_it_shows_under_one_coupon(tmp_path: Path) -> None:
    """Under the light coupons it is a heavier crystal; the heavy one alone is beyond the noise."""
    tape = make_effect("adhesive_layer", {"stiffness_n_per_m": 3.6e9, "damping_n_s_per_m": 170.0})
    found = diagnose_campaign(campaign(tmp_path, tape))
    assert [c.effect_id for c in found.chosen] == ["adhesive_layer"]
    assert found.chosen[0].scope == "rig"


def test_hum_is_believed_only_where_it_is_there_before(swinging: Diagnosis) -> None:
    """Sizes that hum would have in a window promise as much before the trigger."""
    shots: list[FitShot] = swinging.steps[0].problem.shots
    hum = effect_named("mains_hum")
    loud = np.full((len(shots), hum.basis_size), 0.05)
    assert not is_there_before(shots, hum, loud)
    assert is_there_before(shots, hum, np.zeros_like(loud))


@pytest.mark.slow
def test_a_yield_of_one_sphere_that_shows_on_one_coupon_is_found(tmp_path: Path) -> None:
    """Its size is that sphere's alone, or next to nothing on the other."""
    soft = make_effect("plastic_yield", {"yield_pressure_pa": 8e7}, Scope(sphere="acetal_small"))
    found = diagnose_campaign(campaign(tmp_path, soft))
    assert [r.effect_id for r in found.chosen] == ["plastic_yield"]
    sizes = sizes_of(found.chosen[0], "sphere")
    assert sizes is not None
    assert np.flatnonzero(sizes.values).tolist() == [sizes.names.index("acetal_small")]
    assert found.verdict in ("identified", "family")


@pytest.mark.slow
def test_what_needs_every_coupons_mass_is_not_tried_where_one_is_unknown(tmp_path: Path) -> None:
    """On the shots of one material, all known, it could be; then it goes to all shots."""
    effect = make_effect("coupon_mode", MODE, scope=Scope(surface="specimen"))
    known = campaign(tmp_path, effect)
    at = next(i for i, shot in enumerate(known.shots) if shot.surface == "aluminium")
    bare = dataclasses.replace(known.shots[at], sphere=None, surface=None)
    shots = (*known.shots[:at], bare, *known.shots[at + 1 :])
    problem, nuisances = with_start(
        build(dataclasses.replace(known, shots=shots), model_named("kv2"))
    )
    present = PresentModel(problem, joint.fit(problem, nuisances), usual_place(problem, nuisances))
    of_specimen = ActsOn("surface", ("specimen",))
    rest = next(one for one in without_each_material(present) if one.only == of_specimen)
    apart = apart_from(present, rest, far_begin(present))
    found = tried_alone(apart, present, lambda *_: None, first=True)
    assert found
    assert not any("coupon_mass_kg" in one.effect.needs for one in found)
