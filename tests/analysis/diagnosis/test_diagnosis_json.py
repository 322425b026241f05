"""The JSON of a diagnosis: complete, finite, and true to the fits behind it."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import statistics

import pytest

from analysis.campaign import Uncertainty
from analysis.diagnosis.document.diagnosis_json import _provisos, diagnosis_json
from analysis.diagnosis.document.wording import heldout_sentences, verdict_sentence
from analysis.diagnosis.held_out import as_fit_result
from analysis.diagnosis.localisation import locate
from analysis.diagnosis.procedure import _judge, diagnose_campaign
from analysis.diagnosis.progress import Watch
from analysis.diagnosis.selection import Selection
from analysis.effects.library import library
from analysis.fit.result import FitResult, outcome_of
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign

KEYS = {
    "format", "verdict", "p_value", "noise_rms_V", "effects", "slot", "before", "after",
    "remaining", "candidates", "next_drop", "rejected", "software",
}  # fmt: skip
VERDICTS = "adequate", "identified", "family", "partial", "unknown", "not_identifiable"
BLOCK = {"model", "rms_V", "nrmse", "r2", "chi2_per_dof", "heldout_rms_V", "moduli"}


@pytest.fixture(scope="session")
def leaky_json(leaky):
    """The leaky campaign's diagnosis as JSON."""
    return diagnosis_json(leaky, software="impactd test")


def test_a_clean_campaign_is_adequate_before_and_after(clean):
    """Nothing hidden, nothing claimed: both blocks are the base model's."""
    found = diagnosis_json(clean, software="impactd test")
    assert set(found) >= KEYS
    assert found["verdict"] == "adequate"
    assert found["effects"] == []
    assert found["before"] == found["after"]
    assert found["before"]["chi2_per_dof"] == pytest.approx(1.0, abs=0.1)
    assert "moduli" in found["before"]
    assert "held-out" not in found["sentence"]
    json.dumps(found, allow_nan=False)


def test_an_identified_effect_comes_with_numbers_and_both_blocks(leaky_json):
    """The effect has its parameter with uncertainty and unit; after the repair noise is left."""
    assert set(leaky_json) >= KEYS
    assert leaky_json["verdict"] == "identified"
    (effect,) = leaky_json["effects"]
    assert (effect["id"], effect["slot"]) == ("coupler_highpass", "electronics")
    constant = effect["parameters"]["time_constant_s"]
    assert constant["unit"] == "s"
    assert abs(constant["value"] - 5e-3) < 5 * constant["u"]
    before, after = leaky_json["before"], leaky_json["after"]
    assert set(before) >= BLOCK
    assert set(after) >= BLOCK
    assert after["model"] == "kv2+coupler_highpass"
    assert after["heldout_rms_V"] < before["heldout_rms_V"]
    assert after["heldout_rms_V"] == pytest.approx(leaky_json["noise_rms_V"], rel=0.1)
    assert leaky_json["remaining"]["structured"] is False
    json.dumps(leaky_json, allow_nan=False)


def test_an_effect_is_as_uncertain_as_the_numbers_that_were_stated(leaky):
    """A clock good to one per cent leaves a time constant one per cent open, wherever it stands."""
    slow = Uncertainty(0.01)
    steps = [
        dataclasses.replace(
            step,
            problem=dataclasses.replace(
                step.problem,
                campaign=dataclasses.replace(step.problem.campaign, u_sample_rate_relative=slow),
            ),
        )
        for step in leaky.steps
    ]
    found = diagnosis_json(dataclasses.replace(leaky, steps=steps), software="impactd test")
    (effect,) = found["effects"]
    constant = effect["parameters"]["time_constant_s"]
    assert constant == found["after"]["parameters"]["coupler_highpass.time_constant_s"]
    # the shots themselves tell the clock to 0.5 %, so that its one per cent is not the whole of it
    assert constant["u"] == pytest.approx(0.01 * constant["value"], rel=0.1)
    (known,) = found["accepted_model"]["effects"][0]["numbers"].values()
    relative = constant["u"] / constant["value"]
    assert known["u"] / known["coordinate"] == pytest.approx(relative)


def test_the_verdict_says_what_the_effect_moves(leaky_json):
    """The modulus in per cent and in uncertainties, and the log-likelihood, before the residual."""
    before, after = (
        leaky_json[block]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
        for block in ("before", "after")
    )
    share = after["value"] / before["value"] - 1.0
    sentence = leaky_json["sentence"]
    assert f"E/(1-nu^2) of specimen moves by {100 * share:+.2g} % (" in sentence
    places = [sentence.index(one) for one in ("moves by", "log-likelihood rises", "residual falls")]
    assert places == sorted(places)
    whys = [line["why_not"] or "" for line in leaky_json["candidates"]]
    assert any("below that of coupler_highpass" in why for why in whys)
    assert not any("leaves 1" in why for why in whys)


def test_an_error_on_held_out_shots_above_the_noise_is_explained(tmp_path):
    """Two shots leave noise, and neither can be predicted from the other; eight can."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={"specimen": usual.surfaces["specimen"]},
        drop_heights_m=(0.0465,),
        repeats=1,
    )
    campaign = read_campaign(write_campaign_folder(tmp_path, simulate_campaign(settings, 4)))
    found = diagnosis_json(diagnose_campaign(campaign), software="impactd test")
    assert found["verdict"] == "adequate"
    held, rms = (1e3 * found["after"][key] for key in ("heldout_rms_V", "rms_V"))
    assert held > 2 * rms
    assert (
        f"On held-out shots its error is {held:.2f} mV rather than {rms:.2f} mV"
        in (found["sentence"])
    )


@pytest.mark.parametrize("verdict", VERDICTS)
@pytest.mark.parametrize("times", [1.06, 1.6, 2.4])
def test_every_verdict_explains_an_error_on_held_out_shots_above_the_noise(leaky, verdict, times):
    """What leaves noise says why it predicts worse; every other verdict is about what remains."""
    step = leaky.steps[-1]
    judged = dataclasses.replace(leaky, verdict=verdict)
    noise = math.sqrt(statistics.fmean(item.noise.rms**2 for item in step.problem.shots))
    said = heldout_sentences(judged, {"rms_V": noise, "heldout_rms_V": times * noise}, step.problem)
    if verdict in ("partial", "unknown"):
        before, after = (as_fit_result(one.problem, one.fitted) for one in (leaky.steps[0], step))
        assert said == []
        assert re.search(", but |misses something", verdict_sentence(judged, before, after, []))
    else:
        (sentence,) = said
        assert f"error is {1e3 * times * noise:.2f} mV rather than {1e3 * noise:.2f} mV" in sentence
        assert "more drop heights and repetitions" in sentence


def test_every_library_effect_has_a_line_and_only_the_taken_one_no_reason(leaky_json):
    """What was not named says why in words; the one that was says nothing."""
    lines = {line["id"]: line for line in leaky_json["candidates"]}
    assert set(lines) == set(library())
    assert [name for name, line in lines.items() if line["why_not"] is None] == ["coupler_highpass"]
    best = lines["coupler_highpass"]
    assert best["delta_log_likelihood"] > 0
    assert best["heldout_rms_V"] == pytest.approx(leaky_json["after"]["heldout_rms_V"], rel=0.05)


def test_an_unknown_keeps_its_closure_and_withholds_what_it_cannot_know(leaky):
    """Without a name, `after` is the repair by the discrepancy, and each slot has a probability."""
    first = leaky.steps[0]
    located = locate(first, lambda stage, share: None)
    nameless = dataclasses.replace(
        leaky, verdict="unknown", steps=[first], chosen=[], slot=located.slot, located=located
    )
    found = diagnosis_json(nameless, software="impactd test")
    assert sum(slot["probability"] for slot in found["slots"].values()) == pytest.approx(1.0)
    assert found["after"]["heldout_rms_V"] < found["before"]["heldout_rms_V"] / 2
    assert found["after"]["heldout_rms_V"] >= 0.99 * found["noise_rms_V"]
    assert found["after"]["moduli"]["specimen"]["status"] == "withheld"
    assert found["closure"]["coefficients"]
    (curve,) = found["closure"]["curves"]["shots"][:1]
    assert {len(curve[key]) for key in ("pulse", "residual", "added", "left")} == {
        len(curve["time_us"])
    }
    assert all(line["why_not"] for line in found["candidates"])
    json.dumps(found, allow_nan=False)


def test_a_model_with_an_impossible_number_is_not_named(leaky):
    """A repair that leaves noise by a ring beyond the samples is neither adequate nor accepted."""
    last = leaky.steps[-1]
    theta = last.fitted.theta.copy()
    theta[last.problem.names.index("sensor.ln_w")] = math.log(2 * math.pi * 667e3)
    moved = dataclasses.replace(last, fitted=dataclasses.replace(last.fitted, theta=theta))
    selection = Selection([*leaky.steps[:-1], moved], leaky.chosen)
    assert Selection(leaky.steps, leaky.chosen).adequate
    assert not selection.adequate
    start = Selection(leaky.steps[:1], [])
    found = _judge(selection, start, leaky.steps[0].fitted, Watch())
    assert found.verdict == "unknown"
    assert found.chosen == []


def test_a_verdict_on_impossible_numbers_names_them_and_withholds_the_moduli(clean):
    """The sentence says which number and its range; no model is handed on, no modulus stated."""
    first = clean.steps[0]
    theta = first.fitted.theta.copy()
    theta[first.problem.names.index("sensor.ln_w")] = math.log(2 * math.pi * 667e3)
    moved = dataclasses.replace(first.fitted, theta=theta)
    outcome = outcome_of(first.problem, moved)
    found = FitResult("kv", outcome, first.problem, moved, (), 1.0, None)
    assert found.outcome.status == "out_of_range"
    (said, *_) = _provisos(found, blames=False)
    assert "sensor.natural_frequency_Hz" in said
    assert "not accepted" in said
    assert found.moduli()["specimen"]["status"] == "withheld"
