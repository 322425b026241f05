"""The mean of other hits predicts a hit as well as what hits have in common allows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.campaign import Campaign, Shot, Sphere
from analysis.diagnosis.discrepancy.choice import better
from analysis.diagnosis.discrepancy.mean_waveform import (
    IN_PLACE,
    ON_TOP,
    mean_waveform,
    waveform_discrepancy,
)
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.document.wording import FAMILIES, beside_mean_waveform
from analysis.diagnosis.localisation import Located, locate
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.diagnosis.selection import Step
from analysis.effects.effect import SLOTS
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_rms
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

Array = NDArray[np.float64]

RATE_HZ = 50e3
NOISE = 1.0
"""Standard deviation. [m/s^2]"""
SIZE = 1000.0
"""Of a typical pulse. [m/s^2]"""


def bell(t_s: Array, centre_s: float, width_s: float) -> Array:
    """Return a bell of height one."""
    return np.exp(-(((t_s - centre_s) / width_s) ** 2))


def hit(
    rng: np.random.Generator, name: str, wobble: float, second: float, sphere: str | None
) -> Shot:
    """Return humps and dips of its own size, time, length and offset, in noise."""
    size, longer = SIZE * rng.uniform(0.8, 1.2), rng.uniform(0.95, 1.05)
    t = (np.arange(400) / RATE_HZ - 2e-3 - rng.uniform(-20e-6, 20e-6)) / longer
    wave = bell(t, 0.0, 0.2e-3) + second * bell(t, 0.45e-3, 0.15e-3)
    wave -= 0.3 * bell(t, 2e-3, 0.3e-3) + 0.04 * bell(t, -0.9e-3, 0.2e-3)
    wave += wobble * rng.normal() * bell(t, 3e-3, 0.2e-3)
    signal = size * wave + rng.uniform(-20.0, 20.0) + NOISE * rng.normal(size=t.size)
    return Shot(name, signal, RATE_HZ, 95, quantity="acceleration_m_per_s2", sphere=sphere)


def campaign(
    shots: int, wobble: float = 0.0, second: float = 0.6, sphere: str | None = None
) -> Campaign:
    """Return hits of one kind that no model makes."""
    rng = np.random.default_rng(7)
    return Campaign(tuple(hit(rng, f"hit {i}", wobble, second, sphere) for i in range(shots)))


def problem_of(made: Campaign):
    """Return the joint problem of a campaign."""
    return build(made, model_named("kv2"))


@pytest.fixture(scope="module")
def step() -> Step:
    """Return the base model's turn on hits that no model makes."""
    problem, nuisances = with_start(problem_of(campaign(9)))
    return Step(problem, joint.fit(problem, nuisances))


@pytest.fixture(scope="module")
def strange(step: Step) -> Diagnosis:
    """Return the same as an unknown whose only discrepancy is a waveform."""
    mean = mean_waveform(step.problem, 2)
    slots = dict.fromkeys(SLOTS, 1.0)
    located = Located(
        "sensor",
        slots,
        slots,
        step.score_test.strongest,
        better(None, waveform_discrepancy(step, mean), None),
        step.linearised.chi2,
        mean=mean,
    )
    return Diagnosis("unknown", [step], [], slot="sensor", located=located)


def test_a_waveform_that_hits_share_is_predicted_down_to_the_noise():
    """Size, time, length and offset are each hit's own; what is left is noise, and the mean's."""
    found = mean_waveform(problem_of(campaign(12)))
    assert found.shots == 12
    assert found.reason is None
    assert found.heldout_rms == pytest.approx(NOISE, rel=0.12)


def test_a_mode_of_variation_is_learned_from_the_other_hits():
    """What differs from hit to hit in size alone takes one number of each."""
    found = mean_waveform(problem_of(campaign(12, wobble=0.1)), 2)
    plain, one, two = (prediction.heldout_rms for prediction in found.predictions)
    assert plain > 10 * NOISE
    assert one < 2 * NOISE
    assert two < 2 * NOISE


def test_hits_of_two_kinds_have_a_mean_each():
    """Where a pair has hits enough, those of another pair have no say."""
    one, other = campaign(6, sphere="one"), campaign(6, second=-0.5, sphere="other")
    spheres = {name: Sphere(name) for name in ("one", "other")}
    found = mean_waveform(problem_of(Campaign((*one.shots, *other.shots), spheres)))
    assert found.heldout_rms == pytest.approx(NOISE, rel=0.2)


def test_of_two_hits_there_is_no_mean_and_the_reason_is_said():
    """One is held out, and one is no mean."""
    found = mean_waveform(problem_of(campaign(2))).to_json()
    assert found["heldout_rms_V"] is None
    assert found["shots"] == 0
    assert "2 shots leave no mean" in found["reason"]


def test_a_waveform_closure_reaches_the_noise_on_hits_that_no_model_makes(step, strange):
    """On held-out shots, and never worse than the plain mean."""
    located = strange.located
    assert heldout_rms(step.problem, step.fitted) > 10 * NOISE
    assert located.learned.heldout_rms <= located.mean.heldout_rms
    assert located.learned.heldout_rms == pytest.approx(NOISE, rel=0.2)


def test_the_closure_that_repairs_held_out_shots_better_is_taken(strange):
    """A waveform where it does, the other where it does as well, none where none repairs."""
    waveform = strange.located.learned
    worse, same = (
        dataclasses.replace(waveform, heldout_rms=share * waveform.heldout_rms)
        for share in (1.01, 1.0)
    )
    assert better(worse, waveform, None) is waveform
    assert better(same, waveform, None) is same
    assert better(None, waveform, 0.9 * waveform.heldout_rms) is None


@pytest.mark.slow
def test_no_closure_loses_to_the_mean_waveform(step):
    """All discrepancies tried, the waveform is taken, and says nothing of the slot."""
    located = locate(step, lambda stage, share: None)
    assert located.learned.heldout_rms <= located.mean.heldout_rms
    assert located.learned.parts[0][0] in (ON_TOP, IN_PLACE)
    assert located.by_columns.heldout_rms > located.learned.heldout_rms
    assert sum(located.probabilities.values()) == pytest.approx(1.0)


def test_the_document_states_the_waveform_and_what_a_plain_mean_leaves(strange):
    """Figures, curves and words are those of the discrepancy; the baseline stands beside them."""
    found = diagnosis_json(strange, software="impactd test")
    after, discrepancy = found["after"], found["closure"]
    assert after["model"] == f"kv2+closure({discrepancy['family']} by pair)"
    assert after["heldout_rms_V"] == discrepancy["heldout_rms_V"]
    assert after["heldout_rms_V"] <= found["mean_waveform"]["heldout_rms_V"]
    assert found["mean_waveform"]["shots"] == 9
    assert discrepancy["by_shot"]["size"]["value"] == pytest.approx(1.0, abs=0.2)
    assert discrepancy["by_shot"]["stretch"]["value"] == pytest.approx(1.0, abs=0.05)
    (curve,) = discrepancy["curves"]["shots"]
    left, residual = (np.nanstd([v or np.nan for v in curve[key]]) for key in ("left", "residual"))
    assert left < residual / 10
    assert FAMILIES[discrepancy["family"]] in found["sentence"]


def test_a_model_that_a_mean_beats_is_told_so(strange):
    """With both figures, in the unit of the signals; a model that predicts better is not."""
    problem, mean = strange.steps[0].problem, strange.located.mean
    (said,) = beside_mean_waveform(mean, 4 * mean.heldout_rms, problem)
    assert "without any model, does better" in said
    assert said.endswith(f"against {4 * mean.heldout_rms:.3g} m/s^2.")
    (said,) = beside_mean_waveform(mean, mean.heldout_rms, problem)
    assert "does as well" in said
    assert beside_mean_waveform(mean, 0.5 * mean.heldout_rms, problem) == []
    assert beside_mean_waveform(mean, None, problem) == []


@pytest.mark.parametrize(
    ("name", "plain", "with_modes"),
    [
        ("repeated-shock", 29.0, 17.0),
        ("drop-tower", 2650.0, 2300.0),
        ("board-impacts", 980.0, 740.0),
        ("hammer", 0.28, 0.24),
    ],
)
def test_recordings_of_others_are_predicted_as_a_plain_mean_can(
    shared_campaign, name, plain, with_modes
):
    """Held out, in their own units: without and with modes of variation."""
    made, _ = shared_campaign(f"data/{name}")
    found = mean_waveform(problem_of(made), 2)
    assert found.heldout_rms <= plain
    assert min(one.heldout_rms for one in found.predictions) <= with_modes


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("name", "most"), [("repeated-shock", 29.0), ("drop-tower", 2650.0), ("board-impacts", 980.0)]
)
def test_a_diagnosis_of_others_recordings_is_as_good_as_a_plain_mean(shared_campaign, name, most):
    """After the diagnosis the error on held-out shots is the mean waveform's at most."""
    made, _ = shared_campaign(f"data/{name}")
    found = diagnosis_json(diagnose_campaign(made), software="impactd test")
    assert found["after"]["heldout_rms_V"] <= min(most, found["mean_waveform"]["heldout_rms_V"])


def test_an_ordinary_campaign_has_the_baseline_and_nothing_else_of_it(leaky, clean):
    """Where a model explains the drops, a mean of others at other heights is far worse."""
    for diagnosis in (leaky, clean):
        found = diagnosis_json(diagnosis, software="impactd test")
        assert found["mean_waveform"]["heldout_rms_V"] > 2 * found["after"]["heldout_rms_V"]
        assert "mean of the other hits" not in found["sentence"]
