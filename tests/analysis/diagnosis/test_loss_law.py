"""On a rig whose contact obeys another law of loss this is named, and what acts beside it too."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.procedure import diagnose_campaign
from drivers.simulated.effects import make_effect
from drivers.simulated.rig_model import CLOSED, rig_model

from .conftest import campaign_with

FORMS = {"hunt_crossley": "loss_law", "kuwabara_kono": "loss_law:kuwabara_kono"}


def _seed_of(loss: str) -> int:
    """Return the first seed that draws a closed rig of this law."""
    closed = dataclasses.replace(CLOSED, loss=loss)
    return next(seed for seed in range(10_000) if rig_model("drawn", seed) == closed)


@pytest.mark.slow
@pytest.mark.parametrize("loss", FORMS)
def test_another_law_of_loss_is_named_with_what_acts_beside_it(tmp_path: Path, loss: str) -> None:
    """A leaky coupler is as large as the difference of the laws."""
    leaky = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    campaign = campaign_with(tmp_path, (leaky,), "drawn", _seed_of(loss))
    found = diagnose_campaign(campaign)
    assert found.verdict in ("identified", "family")
    assert {c.effect.id for c in found.chosen} == {FORMS[loss], "coupler_highpass"}
    effects = diagnosis_json(found, software="impactd test")["effects"]
    (law,) = (e for e in effects if e["id"] == "loss_law")
    assert law["parameters"] == {"share": {"value": pytest.approx(1.0), "u": None, "unit": "1"}}
