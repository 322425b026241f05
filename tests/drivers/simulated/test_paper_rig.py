"""The paper's rig stays what it was, to the last bit."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from drivers.simulated.rig_model import CLOSED, PAPER, RIGS, rig_model
from drivers.simulated.specimens import SPHERES, SURFACES

SMALL: dict[str, Any] = {
    "spheres": {"acetal": SPHERES["acetal"]},
    "surfaces": {name: SURFACES[name] for name in ("specimen", "aluminium")},
    "repeats": 1,
    "rig": "paper",
}
BARE = {
    1: "efecf7781f8a45cf",
    2: "b27d17c3b8428704",
    3: "3673af4ee4f54ce0",
    4: "0f0d21ecbc3f53b1",
    5: "03feb0fc70c34607",
}
"""Digests of records and campaign by seed, made before there was another rig than the paper's."""
WITH_AN_EFFECT = {
    1: "b06605b0848447a3",
    2: "bf634265a7fb7b99",
    3: "a52f850bd73d57df",
    4: "030dc62525a9e31d",
    5: "2d6a50254c78ca77",
    6: "594f4ed2c66fb51e",
}
RIGID = "f0409d597cafb654"


def digest(made: dict[str, Any]) -> str:
    """Return a digest of every code and of everything that is stated."""
    found = hashlib.sha256()
    for codes in made["codes"]:
        found.update(codes.tobytes())
    found.update(json.dumps(made["campaign"], sort_keys=True).encode())
    return found.hexdigest()[:16]


@pytest.mark.parametrize("seed", BARE)
def test_records_of_the_papers_rig_repeat_to_the_last_code(seed: int) -> None:
    """Bare rigs of old seeds."""
    assert digest(simulate_campaign(CampaignSettings(**SMALL), seed)) == BARE[seed]


@pytest.mark.parametrize("seed", WITH_AN_EFFECT)
def test_records_with_an_effect_repeat_too(seed: int) -> None:
    """Rigs of old seeds that hide an effect."""
    settings = CampaignSettings(effects="random", **SMALL)
    assert digest(simulate_campaign(settings, seed)) == WITH_AN_EFFECT[seed]


def test_a_rigid_cell_repeats_too() -> None:
    """One of the paper's HSD."""
    assert digest(simulate_campaign(CampaignSettings(cell_model="hsd", **SMALL), 3)) == RIGID


def test_a_rig_is_one_of_three_and_a_drawn_one_belongs_to_its_seed() -> None:
    """Every choice comes up; most drawn rigs keep each law of mechanics."""
    assert rig_model("paper", 1) == PAPER
    assert rig_model("closed", 1) == CLOSED
    assert rig_model("drawn", 7) == rig_model("drawn", 7)
    drawn = [rig_model("drawn", seed) for seed in range(200)]
    for field, kinds in (
        ("third_law", 2), ("coupon_rides", 2), ("lift_off", 2), ("loss", 3), ("drag", 2),
        ("added_mass", 2),
    ):  # fmt: skip
        assert len({getattr(model, field) for model in drawn}) == kinds
    assert 0.65 < sum(m.third_law for m in drawn) / 200 < 0.85
    with pytest.raises(ValueError, match="A rig is paper, closed, drawn"):
        rig_model("ideal", 1)


@pytest.mark.parametrize("name", RIGS)
def test_the_truth_says_which_physics_a_rig_obeys(name: str) -> None:
    """All choices, ready for JSON."""
    made = simulate_campaign(CampaignSettings(**SMALL | {"rig": name}), 3)
    assert made["truth"]["rig"] == rig_model(name, 3).to_json()
    assert json.loads(json.dumps(made["truth"], allow_nan=False)) == made["truth"]
