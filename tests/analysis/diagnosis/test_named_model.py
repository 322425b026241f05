"""An accepted model fits later shots with the numbers that were found for it."""

from __future__ import annotations

import dataclasses
import json

import pytest

from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.named_model import definition_of, fit_named, model_of
from analysis.errors import UnknownModelError


@pytest.fixture(scope="session")
def definition(leaky):
    """The model of the leaky campaign, as it comes back from a file."""
    found = diagnosis_json(leaky, software="impactd test")["accepted_model"]
    return json.loads(json.dumps(found, allow_nan=False))


def test_a_definition_makes_the_same_model_again(leaky, definition):
    """Name and groups survive JSON."""
    assert definition["name"] == "kv2+coupler_highpass"
    made = model_of(definition)
    last = leaky.steps[-1].problem.model
    assert made.name == last.name
    assert made.shared == last.shared


def test_a_single_shot_is_fitted_with_the_found_numbers(leaky, definition):
    """One shot cannot tell a coupler from a slow sphere; with the numbers known it does."""
    campaign = leaky.steps[-1].problem.campaign
    one = dataclasses.replace(campaign, shots=campaign.shots[:1])
    found = fit_named(one, definition, by_pair=True, heldout=False, priors=True)
    assert found.model == "kv2+coupler_highpass"
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    constant = found.parameters()["coupler_highpass.time_constant_s"]
    assert constant["value"] == pytest.approx(5e-3, rel=0.05)


def test_a_campaign_fits_the_numbers_anew(leaky, definition):
    """Without priors the same campaign ends where the diagnosis did."""
    found = fit_named(leaky.steps[-1].problem.campaign, definition)
    last = leaky.steps[-1]
    j = found.problem.index("coupler_highpass.time_constant_s")
    k = last.problem.index("coupler_highpass.time_constant_s")
    u = last.fitted.covariance[k, k] ** 0.5
    assert abs(found.fitted.theta[j] - last.fitted.theta[k]) < 2 * u


def test_a_base_model_has_no_definition(clean):
    """Nothing was added, nothing is named."""
    assert definition_of(clean.steps[0].problem, clean.steps[0].fitted) is None


def test_an_effect_that_changed_since_is_refused(definition):
    """Numbers that this version does not know are no reason to guess."""
    entry = {**definition["effects"][0], "owners": {"time_constant_ms": "rig"}}
    with pytest.raises(UnknownModelError, match="diagnose again"):
        model_of({**definition, "effects": [entry]})
