"""Numbers written down wrong and changes half-way: which is promised most, and what is said."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.campaign import Campaign, Quantity, Shot
from analysis.diagnosing import diagnose
from analysis.diagnosis import mistakes
from analysis.diagnosis.base_choice import fitted_base
from analysis.diagnosis.mistakes import Mistake, named_mistake
from analysis.diagnosis.procedure import _restated
from analysis.diagnosis.progress import MethodStep, TimeBudget, Watch
from analysis.diagnosis.search_on_part import no_effect_explains_part
from analysis.diagnosis.selection import Step
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.drops import draw_drops
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from drivers.simulated.mistakes import draw_mistake, make_mistake
from impactd.storage.campaign_folder import read_campaign

COUPON = "polycarbonate"


def campaign(folder: Path, *effects: Effect) -> Campaign:
    """Return three spheres on three surfaces from two heights, three times each."""
    settings = dataclasses.replace(
        CampaignSettings(), drop_heights_m=(0.0155, 0.0405), repeats=3, effects=effects
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 11)))


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Nothing acts, and all is written down as it was."""
    return campaign(tmp_path_factory.mktemp("clean"))


def base_of(whole: Campaign) -> Step:
    """Return the base model fitted to a campaign."""
    return fitted_base(whole, "kv2", Watch())[0].last


def with_mass(whole: Campaign, by: float) -> Campaign:
    """Return a campaign in which a sphere's mass is stated too large by a factor."""
    ball = whole.spheres["acetal"]
    assert ball.mass_kg is not None
    heavier = dataclasses.replace(ball, mass_kg=by * ball.mass_kg)
    return dataclasses.replace(whole, spheres={**whole.spheres, "acetal": heavier})


def with_height(whole: Campaign, by: float) -> Campaign:
    """Return a campaign in which the larger height is stated too large by a factor."""
    heights = [s.drop_height_m for s in whole.shots if s.drop_height_m is not None]
    shots = (
        dataclasses.replace(s, drop_height_m=by * max(heights))
        if s.drop_height_m == max(heights)
        else s
        for s in whole.shots
    )
    return dataclasses.replace(whole, shots=tuple(shots))


def with_level(whole: Campaign, added: Callable[[Shot], float]) -> Campaign:
    """Return a campaign in which something is added to each shot's height. [m]"""
    shots = (
        dataclasses.replace(s, drop_height_m=s.drop_height_m + added(s))
        for s in whole.shots
        if s.drop_height_m is not None
    )
    return dataclasses.replace(whole, shots=tuple(shots))


def radius_of(whole: Campaign, shot: Shot) -> float:
    """Return the radius of a shot's sphere. [m]"""
    assert shot.sphere is not None
    radius = whole.spheres[shot.sphere].radius_m
    assert radius is not None
    return radius


def with_modulus(whole: Campaign, by: float) -> Campaign:
    """Return a campaign in which a sphere's modulus is stated too large by a factor."""
    ball = whole.spheres["acetal"]
    known = ball.youngs_modulus_pa
    assert known is not None
    stated = Quantity(by * known.value, 5e-3 * known.value)
    stiffer = dataclasses.replace(ball, youngs_modulus_pa=stated)
    return dataclasses.replace(whole, spheres={**whole.spheres, "acetal": stiffer})


def amplified(whole: Campaign, factor: Callable[[int], float]) -> Campaign:
    """Return a campaign with each shot's record times a factor of its place."""
    shots = (
        dataclasses.replace(s, signal=s.code_zero + factor(i) * (s.signal - s.code_zero))
        for i, s in enumerate(whole.shots)
    )
    return dataclasses.replace(whole, shots=tuple(shots))


def likeliest(whole: Campaign) -> Mistake:
    """Return what promises most."""
    return mistakes._likeliest(base_of(whole))[0]


def test_a_wrong_mass_promises_most_and_its_value_is_right(clean: Campaign) -> None:
    """Within four of its own uncertainties."""
    found = likeliest(with_mass(clean, 1.04))
    assert (found.id, found.kind, found.name) == ("wrong_mass", "sphere", "acetal")
    value, u, unit = found.parameters["mass_kg"]
    true = clean.spheres["acetal"]
    assert unit == "kg"
    assert u is not None
    assert true.mass_kg is not None
    assert abs(value - true.mass_kg) < 4.0 * u
    assert found.sentence.startswith("the mass of acetal is written down wrong: stated ")
    assert found.restated.spheres["acetal"].mass_kg == value


def test_a_wrong_height_of_a_series_is_told_from_one_mass(clean: Campaign) -> None:
    """It moves the speed of every shot from there, and of no other."""
    wrong = with_height(clean, 1.2)
    found = likeliest(wrong)
    stated = max(s.drop_height_m for s in wrong.shots if s.drop_height_m is not None)
    assert (found.id, found.name) == ("wrong_height", stated)
    value, _, _ = found.parameters["drop_height_m"]
    assert value == pytest.approx(stated / 1.2, rel=0.02)
    restated = {s.drop_height_m for s in found.restated.shots}
    assert stated not in restated


def test_heights_from_the_centre_of_the_spheres_are_told(clean: Campaign) -> None:
    """All are too large by one radius of their sphere; those from the coupon are right again."""
    wrong = with_level(clean, lambda s: radius_of(clean, s))
    found = likeliest(wrong)
    assert (found.id, found.kind, found.name) == ("wrong_height", "rig", "all")
    value, u, unit = found.parameters["height_offset_radii"]
    assert unit == "1"
    assert u is not None
    assert abs(value + 1.0) < 4.0 * u
    assert found.sentence.startswith("all heights are stated too large by ")
    for again, right in zip(found.restated.shots, clean.shots, strict=True):
        assert again.drop_height_m is not None
        assert right.drop_height_m is not None
        assert abs(again.drop_height_m - right.drop_height_m) < 4.0 * u * radius_of(clean, right)


def test_half_a_radius_is_no_level_that_heights_are_measured_from(clean: Campaign) -> None:
    """Nobody reads a height there: what looks like it has another cause, and is not named so."""
    wrong = with_level(clean, lambda s: 0.5 * radius_of(clean, s))
    told = mistakes._likeliest(base_of(wrong))
    assert not any("height_offset_radii" in one.parameters for one in told)


def test_heights_above_one_coupon_from_another_level_are_told(clean: Campaign) -> None:
    """It is thicker than the others, say."""
    found = likeliest(with_level(clean, lambda s: 2e-3 if s.surface == COUPON else 0.0))
    assert (found.id, found.kind, found.name) == ("wrong_height", "surface", COUPON)
    value, u, _ = found.parameters["height_offset_m"]
    assert u is not None
    assert abs(value + 2e-3) < 4.0 * u


def test_a_wrong_mass_of_a_coupon_is_told(clean: Campaign) -> None:
    """It rides on the crystal."""
    coupon = clean.surfaces[COUPON]
    assert coupon.coupon_mass_kg is not None
    heavier = dataclasses.replace(coupon, coupon_mass_kg=1.4 * coupon.coupon_mass_kg)
    wrong = dataclasses.replace(clean, surfaces={**clean.surfaces, COUPON: heavier})
    found = likeliest(wrong)
    assert (found.id, found.kind, found.name) == ("wrong_mass", "surface", COUPON)
    value, u, _ = found.parameters["coupon_mass_kg"]
    assert u is not None
    assert abs(value - coupon.coupon_mass_kg) < 4.0 * u


def test_a_gain_that_is_switched_is_found_at_its_shot(clean: Campaign) -> None:
    """And by how much; all records are then as with the first gain."""
    at = len(clean.shots) // 2
    found = likeliest(amplified(clean, lambda i: 0.95 if i >= at else 1.0))
    assert (found.id, found.kind, found.name) == ("change_point", "cell", "gain")
    assert abs(found.parameters["first_shot"][0] - at) <= 1
    factor, u, _ = found.parameters["factor"]
    assert u is not None
    assert abs(factor - 0.95) < 4.0 * u + 1e-3
    again, first = found.restated.shots[-1], clean.shots[-1]
    assert max(abs(again.signal - first.signal)) < 0.01 * max(abs(first.signal))
    assert again.quantum == pytest.approx(first.quantum / 0.95, rel=0.01)  # and with it the range


def test_a_slow_drift_is_no_switch(clean: Campaign) -> None:
    """Its share is that from the first shot to the last."""
    last = len(clean.shots) - 1
    found = likeliest(amplified(clean, lambda i: 1.0 + 0.04 * i / last))
    assert found.id == "drift_in_time"
    assert found.parameters["share"][0] == pytest.approx(0.04, rel=0.1)
    assert found.sentence.endswith("from the first shot to the last")


@pytest.mark.parametrize(("rate", "when"), [(4.0, "early"), (-4.0, "late")])
def test_a_drift_that_settles_is_one_too(clean: Campaign, rate: float, when: str) -> None:
    """An amplifier warms up; a battery fails at the end."""
    last = len(clean.shots) - 1
    found = likeliest(
        amplified(clean, lambda i: 1.0 + 0.04 * math.expm1(-rate * i / last) / math.expm1(-rate))
    )
    assert found.id == "drift_in_time"
    assert found.parameters["share"][0] == pytest.approx(0.04, rel=0.1)
    assert found.sentence.endswith(f"most of it {when}")


def test_a_coupon_that_is_exchanged_is_two_coupons(tmp_path: Path) -> None:
    """From its own shot on, each with a modulus."""
    settings = dataclasses.replace(CampaignSettings(), drop_heights_m=(0.0155, 0.0405))
    drawn = draw_mistake(
        np.random.default_rng(3), draw_drops(settings, 11), among=("coupon_exchanged",)
    )
    made = make_mistake(settings, 11, drawn)
    first = int(drawn.numbers["first_shot"])
    whole = read_campaign(write_campaign_folder(tmp_path, made))
    found = likeliest(whole)
    assert (found.id, found.kind, found.name) == ("change_point", "surface", "specimen")
    assert abs(found.parameters["first_shot"][0] - first) <= 3
    assert len(found.restated.surfaces) == len(whole.surfaces) + 1


def test_a_stated_modulus_that_is_wrong_is_told_with_what_fits(clean: Campaign) -> None:
    """It is to be found then; of two that contradict each other either may be the wrong one."""
    known = mistakes._likeliest(base_of(with_modulus(clean, 1.4)))
    assert known[0].id == "wrong_modulus"
    found = next(
        m for m in known if (m.id, m.kind, m.name) == ("wrong_modulus", "sphere", "acetal")
    )
    assert found.restated.spheres["acetal"].youngs_modulus_pa is None
    true = clean.spheres["acetal"].youngs_modulus_pa
    assert true is not None
    value, u, _ = found.parameters["youngs_modulus_Pa"]
    assert u is not None
    assert abs(value - true.value) < 3.0 * math.hypot(u, true.u)


def test_a_statement_promises_what_leaving_it_out_brings() -> None:
    """As the minima of the squares with the statement and without it have it."""
    rng = np.random.default_rng(5)
    size, at, prior, away = 6, 2, 40.0, 0.3
    slopes = rng.normal(size=(30, size))
    matrix, vector = slopes.T @ slopes + np.eye(size), rng.normal(size=size)
    stated_matrix, stated_vector = matrix.copy(), vector.copy()
    stated_matrix[at, at] += prior
    stated_vector[at] -= prior * away
    known = mistakes._Known(None, None, (), (), stated_matrix, stated_vector, [])  # type: ignore[arg-type]
    said = known.fall_without_statement(
        at, matrix[at, at], vector[at], prior=prior, away=away, but=at
    )
    without = vector @ np.linalg.solve(matrix, vector)
    with_it = stated_vector @ np.linalg.solve(stated_matrix, stated_vector) - prior * away**2
    assert said == pytest.approx(without - with_it)


@pytest.mark.slow
def test_a_mistake_found_when_the_time_is_over_is_kept(clean: Campaign) -> None:
    """It leaves noise; what it was not compared with leaves the verdict a family."""
    clock = iter([0.0])
    over = False

    def now() -> float:
        return next(clock, 1e9 if over else 0.0)

    def progress(text: str, share: float) -> None:
        nonlocal over
        del share
        over = over or text.startswith(MethodStep.CANDIDATES.told(""))

    found = diagnose(with_mass(clean, 1.04), progress=progress, budget=TimeBudget(60.0, now))
    assert found["verdict"] == "family"
    assert [one["id"] for one in found["effects"]] == ["wrong_mass"]
    assert "The time was over before it was compared with every effect." in found["sentence"]


@pytest.mark.parametrize(
    ("switched", "asked"), [(True, 0), pytest.param(False, 1, marks=pytest.mark.slow)]
)
def test_names_are_asked_only_where_they_can_make_the_difference(
    switched: bool, asked: int, clean: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shots of one condition have the same names before and after a switch."""
    at = len(clean.shots) // 2
    wrong = (
        amplified(clean, lambda i: 0.8 if i >= at else 1.0) if switched else with_mass(clean, 1.2)
    )
    names: list[None] = []
    monkeypatch.setattr(mistakes, "likely_labels", lambda _: names.append(None) or [])
    found = named_mistake(
        base_of(wrong), lambda restated: _restated(restated, "kv2", Watch()), lambda *_: None
    )
    assert found is not None
    assert found.best.id == ("change_point" if switched else "wrong_mass")
    assert len(names) == asked


@pytest.mark.slow
def test_effects_are_compared_on_a_part_of_the_shots(clean: Campaign) -> None:
    """What the best of them leaves there, it leaves of all; what each explains is filled in."""
    selection, usual = fitted_base(with_mass(clean, 1.1), "kv2", Watch())
    assert no_effect_explains_part(selection, usual, Watch())
    assert selection.last.compared
    assert selection.last.refits
    assert not any(r.on_all_shots for r in selection.last.refits)


@pytest.mark.parametrize(
    "effect",
    [
        make_effect("echo", {"delay_s": 2e-5, "ratio": 0.1}),
        make_effect("release_speed_bias", {"height_offset_m": -3.6e-4}),
    ],
    ids=["leaves noise of a part", "leads on all shots only"],
)
def test_an_effect_that_may_explain_all_is_fitted_to_all_shots(
    effect: Effect, tmp_path: Path
) -> None:
    """A part decides only against what leads there and leaves structure."""
    selection, usual = fitted_base(campaign(tmp_path, effect), "kv2", Watch())
    assert not no_effect_explains_part(selection, usual, Watch())
    assert not selection.last.compared


def test_an_effect_is_no_mistake(tmp_path: Path) -> None:
    """Nothing that is written down takes up what a coupler does."""
    step = base_of(campaign(tmp_path, make_effect("coupler_highpass", {"time_constant_s": 5e-3})))
    assert step.score_test.structured
    assert named_mistake(step, lambda whole: _restated(whole, "kv2", Watch()), Watch()) is None


@pytest.mark.slow
def test_the_document_names_the_mistake_and_states_the_modulus(clean: Campaign) -> None:
    """Identified in the slot of what is written down, nothing applied to what was stated."""
    wrong = with_mass(clean, 1.04)
    document = diagnose(wrong)
    (effect,) = document["effects"]
    assert document["verdict"] == "identified"
    assert (effect["id"], effect["slot"]) == ("wrong_mass", "record")
    assert effect["scope"] == {"sphere": "acetal"}
    assert document["slot"] == "record"
    assert "the recordings say" in document["sentence"]
    right = diagnose(clean)["after"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    found = document["after"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    assert abs(found["value"] - right["value"]) < 2.0 * math.hypot(found["u"], right["u"])


@pytest.mark.parametrize(
    ("value", "unit", "u", "said"),
    [
        (6.1284e-4, "kg", 4.6e-7, "0.61284 +- 0.00046 g"),
        (0.0493958, "m", None, "49.396 mm"),
        (70e9, "Pa", 1.2e9, "70.0 +- 1.2 GPa"),
        (1.105, "%", 0.028, "1.105 +- 0.028 %"),
        (0.9, "", 0.0, "0.9"),
    ],
)
def test_figures_have_two_digits_of_their_uncertainty(
    value: float, unit: str, u: float | None, said: str
) -> None:
    """In a unit that a person would use."""
    assert mistakes._figure(value, unit, u) == said


@pytest.mark.slow
def test_an_effect_and_a_mistake_are_named_together(tmp_path: Path) -> None:
    """A coupler that forgets, and a gain that is switched half-way."""
    effect = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    whole = campaign(tmp_path, effect)
    at = len(whole.shots) // 2
    found = diagnose(amplified(whole, lambda i: 0.95 if i >= at else 1.0))
    assert found["verdict"] == "identified"
    assert [one["id"] for one in found["effects"]] == ["coupler_highpass", "change_point"]
    coupler, change = (one["parameters"] for one in found["effects"])
    low, high = coupler["time_constant_s"]["interval95"]
    assert low < 5e-3 < high
    assert change["first_shot"]["value"] == at
    assert found["sentence"].startswith("Found: ")
