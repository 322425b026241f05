"""Whose an effect is: one material's, some materials' or all shots', found by ln Z."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.basis.proposals import proposals
from analysis.diagnosis.candidate import Refit, refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.grouping_search import (
    best_grouping,
    groupings_as_good,
    promises_other_grouping,
    seen_on,
    sizes_of,
)
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.multistart import starts
from analysis.diagnosis.named_model import definition_of, model_of
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.diagnosis.progress import BudgetSpentError
from analysis.diagnosis.selection import Selection, Step
from analysis.diagnosis.successive_halving import rivals_refitted
from analysis.effects.acts_on import ActsOn
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Scope
from impactd.bench.simulated_campaign import BASES
from impactd.storage.campaign_folder import read_campaign

VALUES = {
    "plate_radiation": {"impedance_n_s_per_m": 300.0},
    "viscoelastic_damping": {"relaxation_s": 1e-6},
    "hunt_crossley_damping": {"damping_s_per_m": 0.1},
}


def campaign(
    folder: Path, name: str, scope: Scope, heights: int = 2, form: str = "", **values: float
) -> Campaign:
    """Return two spheres on three surfaces with one effect, read back from a folder."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={n: usual.spheres[n] for n in ("acetal", "acetal_small")},
        drop_heights_m=(0.0115, 0.0465, 0.0255)[:heights],
        repeats=1,
        effects=(make_effect(name, values or VALUES[name], scope, form=form),),
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 11)))


def with_one_size(campaign: Campaign, name: str) -> tuple[JointProblem, joint.Fitted, Refit]:
    """Return the base fit of a campaign, and an effect fitted to all shots with one size."""
    usual = CampaignSettings()
    problem, nuisances = with_start(build(campaign, model_named(BASES[usual.rig])))
    base = joint.fit(problem, nuisances)
    tried = [p for p in proposals(problem)[0] if p.effect.id == name]
    found = starts(linearise(problem, base, tried), tried)[name]
    start = next(s for s in found if s.scope == "rig")
    return problem, base, start.fitted(problem, base)


def fitted(campaign: Campaign, name: str) -> tuple[Refit, Refit]:
    """Return an effect fitted to all shots with one size, and in the grouping found from there."""
    problem, base, whole = with_one_size(campaign, name)
    return whole, best_grouping(problem, base, whole)


@pytest.mark.parametrize("name", sorted(VALUES))
def test_an_effect_on_two_of_three_surfaces_is_told_as_theirs(tmp_path: Path, name: str) -> None:
    """From a fit that gave it to the whole rig: exactly these surfaces, with one size."""
    scope = Scope(surface=("polycarbonate", "specimen"))
    whole, found = fitted(campaign(tmp_path, name, scope), name)
    assert whole.effect.only is None
    assert found.effect.only == ActsOn("surface", ("polycarbonate", "specimen"))
    assert found.scope == "surface"


@pytest.mark.parametrize(
    ("scope", "only"),
    [
        (Scope(surface="specimen"), ActsOn("surface", ("specimen",))),
        (Scope(sphere="acetal"), ActsOn("sphere", ("acetal",))),
        (Scope(), None),
    ],
)
def test_an_effect_on_one_material_or_on_all_is_told_as_such(
    tmp_path: Path, scope: Scope, only: ActsOn | None
) -> None:
    """One of three surfaces, one of two spheres, everything."""
    name = "viscoelastic_damping"
    _, found = fitted(campaign(tmp_path, name, scope), name)
    assert found.effect.only == only
    assert found.scope == (only.kind if only else "rig")


def test_another_grouping_is_promised_only_where_one_is_due(tmp_path: Path) -> None:
    """To first order around the fit with one size; what the surfaces ask for says which."""
    name = "viscoelastic_damping"
    scope = Scope(surface=("polycarbonate", "specimen"))
    some, _ = fitted(campaign(tmp_path / "some", name, scope), name)
    assert promises_other_grouping(some)
    sizes = sizes_of(some, "surface")
    assert sizes is not None
    assert sizes.candidates()[0] == ActsOn("surface", ("polycarbonate", "specimen"))
    whole, _ = fitted(campaign(tmp_path / "all", name, Scope()), name)
    assert not promises_other_grouping(whole)


def test_a_name_is_held_against_others_on_the_same_materials(tmp_path: Path) -> None:
    """Another loss for the whole rig would be beaten by the grouping, not by the law."""
    name, other = "viscoelastic_damping", "hunt_crossley_damping"
    scope = Scope(surface=("polycarbonate", "specimen"))
    whole, found = fitted(campaign(tmp_path, name, scope), name)
    usual = CampaignSettings()
    problem, nuisances = with_start(build(whole.problem.campaign, model_named(BASES[usual.rig])))
    base = joint.fit(problem, nuisances)
    rivals = rivals_refitted(problem, base, found, {other})
    assert [r.effect_id for r in rivals] == [other]
    assert rivals[0].effect.only == found.effect.only
    assert 0.0 < rivals[0].gain < found.gain


def test_a_thin_coupon_promises_something_to_first_order(tmp_path: Path) -> None:
    """Its column knows the coupon's share in the compliance, without which it would be zero."""
    thin = campaign(tmp_path, "finite_thickness", Scope(surface="specimen"), thickness_m=2e-3)
    problem, nuisances = with_start(build(thin, model_named(BASES[CampaignSettings().rig])))
    base = joint.fit(problem, nuisances)
    tried = [p for p in proposals(problem)[0] if p.effect.id == "finite_thickness"]
    found = starts(linearise(problem, base, tried), tried)["finite_thickness"]
    assert found[0].promised > CRITERIA.least_lead


def test_groupings_that_some_shots_do_not_tell_apart_are_fitted_to_all(tmp_path: Path) -> None:
    """A hard coupon feels little of how thin it is: with it or without it is nearly the same."""
    both = ("aluminium", "specimen")
    scope = Scope(surface=both)
    shots = campaign(tmp_path, "finite_thickness", scope, 3, thickness_m=2.4e-3)
    problem, nuisances = with_start(build(shots, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    tried = {p.effect.id: p for p in proposals(problem)[0]}
    alone = refit(
        problem,
        base,
        tried["finite_thickness:dimitriadis"],
        scope="surface",
        coefficients={},
        linear_gain=0.0,
        only=ActsOn("surface", ("specimen",)),
    )
    found = groupings_as_good(problem, base, alone)
    assert ActsOn("surface", both) in [one.effect.only for one in found]
    assert all(one.on_all_shots and one.effect_id == "finite_thickness" for one in found)
    noise = Selection([Step(problem, base)], []).longer_by(alone)
    assert not noise.leaves_next_to_nothing
    # with a residual that is not noise it depends on what the effect has taken up
    linearised, asked = noise.last.test()
    structured = dataclasses.replace(asked, p_value=0.0, surplus=100.0)
    noise.last.tested = (linearised, structured)
    for gain, next_to_nothing in ((200.0 / CRITERIA.nothing, True), (100.0, False)):
        noise.chosen[-1] = dataclasses.replace(alone, gain=gain)
        assert noise.leaves_next_to_nothing is next_to_nothing


@pytest.mark.slow
def test_a_plate_under_two_of_three_surfaces_is_named(tmp_path: Path) -> None:
    """One sphere shows nearly all of it, and its shots alone would lead to another name."""
    scope = Scope(surface=("aluminium", "specimen"))
    found = diagnose_campaign(campaign(tmp_path, "plate_radiation", scope, heights=3))
    assert found.verdict == "identified"
    assert [r.effect_id for r in found.chosen] == ["plate_radiation"]
    only = ActsOn("surface", ("aluminium", "specimen"))
    assert found.chosen[0].effect.only == only
    told = diagnosis_json(found, software="impactd test")
    assert told["effects"][0]["acts_on"] == {
        "kind": "surface",
        "names": ["aluminium", "specimen"],
        "words": "on the surfaces aluminium and specimen",
    }
    assert "on the surfaces aluminium and specimen" in told["sentence"]
    last = found.steps[-1]
    definition = definition_of(last.problem, last.fitted)
    assert definition is not None
    assert model_of(definition).effects[0].only == only


def test_materials_on_which_nothing_yields_show_no_yield(tmp_path: Path) -> None:
    """One yield pressure that only aluminium's contact reaches: the records are the same."""
    reached = {"yield_pressure_pa": 1.1e8}
    on_all = campaign(tmp_path / "all", "plastic_yield", Scope(), **reached)
    on_one = campaign(tmp_path / "one", "plastic_yield", Scope(surface="aluminium"), **reached)
    for one, other in zip(on_all.shots, on_one.shots, strict=True):
        assert np.array_equal(one.signal, other.signal)
    _, found = fitted(on_all, "plastic_yield")
    assert found.effect.only is None
    shown = ActsOn("surface", ("aluminium",))
    assert shown in seen_on(found.effect, found.problem, found.fitted)


def spent() -> None:
    """End a fit, as where the time is over."""
    raise BudgetSpentError


@pytest.mark.parametrize("name", sorted(VALUES))
def test_materials_that_feel_an_effect_show_it(tmp_path: Path, name: str) -> None:
    """On two of three surfaces: both of them show it."""
    scope = Scope(surface=("polycarbonate", "specimen"))
    _, found = fitted(campaign(tmp_path, name, scope), name)
    over = dataclasses.replace(found.problem, checkpoint=spent)
    assert seen_on(found.effect, over, found.fitted) == []  # whatever the time
