"""On a rig whose contact obeys another law of loss this is named, and what acts beside it too."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.diagnosis.procedure import diagnose_campaign
from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from drivers.simulated.effects import make_effect
from drivers.simulated.rig_model import CLOSED, rig_model
from impactd.bench.simulated_campaign import through_a_folder

FORMS = {"hunt_crossley": "loss_law", "kuwabara_kono": "loss_law:kuwabara_kono"}


def _seed_of(loss: str) -> int:
    """Return the first seed that draws a closed rig of this law."""
    closed = dataclasses.replace(CLOSED, loss=loss)
    return next(seed for seed in range(10_000) if rig_model("drawn", seed) == closed)


@pytest.mark.parametrize("loss", FORMS)
def test_another_law_of_loss_is_named_with_what_acts_beside_it(loss: str) -> None:
    """A leaky coupler is as large as the difference of the laws."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        effects=(make_effect("coupler_highpass", {"time_constant_s": 5e-3}),),
        rig="drawn",
    )
    campaign = through_a_folder(simulate_campaign(settings, _seed_of(loss)))
    found = diagnose_campaign(campaign)
    assert found.verdict in ("identified", "family")
    assert {c.effect.id for c in found.chosen} == {FORMS[loss], "coupler_highpass"}
