"""A diagnosis is as its schema says."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema_rs


def test_a_diagnosis_is_as_its_schema_says(document):
    """The schema takes what the loop writes and knows the verdicts there are."""
    text = resources.files("impactd.schemas").joinpath("diagnosis.json").read_text("utf-8")
    validator = jsonschema_rs.validator_for(json.loads(text))
    validator.validate(document)
    assert not validator.is_valid({**document, "verdict": "certain"})
    assert not validator.is_valid({**document, "mean_waveform": {"heldout_rms_V": "none"}})
