"""The next drop: what it promises, a simulated rig then shows."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.next_drop import NextDrop, propose
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from impactd.storage.campaign_folder import read_campaign

TRUE, RIVAL = "hunt_crossley_damping", "viscoelastic_damping"
SEEDS = (11, 12, 13, 14)


class Story(NamedTuple):
    """Rivals after one height, the drop proposed, and by how much it then moved their costs."""

    rivals: list[Refit]
    proposed: NextDrop
    moved: float


def three_heights(folder: Path, seed: int) -> Campaign:
    """Return drops of one sphere on two surfaces from three heights, with a lossy contact."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={"acetal": usual.spheres["acetal"]},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "polycarbonate")},
        drop_heights_m=(0.0115, 0.025, 0.0465),
        repeats=3,
        effects=(make_effect(TRUE, {"damping_s_per_m": 0.25}),),
    )
    campaign = read_campaign(write_campaign_folder(folder, simulate_campaign(settings, seed)))
    shots = tuple(dataclasses.replace(s, restitution=None) for s in campaign.shots)
    return dataclasses.replace(campaign, shots=shots)


def fitted(campaign: Campaign, name: str) -> Refit:
    """Return the campaign's fit with one effect, as a diagnosis holds it."""
    effect = effect_named(name)
    problem, nuisances = with_start(build(campaign, model_named("kv2").with_effect(effect)))
    found = joint.fit(problem, nuisances)
    assert found.blocks
    return Refit(effect, name, "rig", problem, found, 0.0, 1, False, 0.0)


def ahead(rivals: list[Refit]) -> float:
    """Return how much better the first explains its shots."""
    return rivals[1].fitted.cost - rivals[0].fitted.cost


@pytest.fixture(scope="module")
def stories(tmp_path_factory) -> list[Story]:
    """Each rig drops from its middle height, asks, and makes one drop that was proposed."""
    found = []
    for seed in SEEDS:
        whole = three_heights(tmp_path_factory.mktemp("lossy"), seed)
        heights = sorted({s.drop_height_m for s in whole.shots})
        first = [s for s in whole.shots if s.drop_height_m == heights[1]]
        rivals = [
            fitted(dataclasses.replace(whole, shots=tuple(first)), name) for name in (TRUE, RIVAL)
        ]
        proposed = propose(rivals, heights_m=heights)
        assert proposed is not None
        extra = next(
            s
            for s in whole.shots
            if (s.surface, s.drop_height_m) == (proposed.surface, proposed.drop_height_m)
        )
        more = dataclasses.replace(whole, shots=(*first, extra))
        after = [fitted(more, name) for name in (TRUE, RIVAL)]
        found.append(Story(rivals, proposed, ahead(after) - ahead(rivals)))
    return found


def test_a_pair_that_one_height_confuses_gets_a_drop_from_another(stories):
    """Two kinds of loss look alike from one height; the drop proposed is from another one."""
    rivals, proposed, _ = stories[0]
    tried = {s.shot.drop_height_m for s in rivals[0].problem.shots}
    assert proposed.drop_height_m not in tried
    told = json.loads(json.dumps(proposed.to_json(), allow_nan=False))
    assert told["separates"] == [TRUE, RIVAL]
    assert set(told) == {f.name for f in dataclasses.fields(NextDrop)}
    enough = proposed.repeats * proposed.expected_distance**2 >= CRITERIA.deviations**2
    assert enough or proposed.repeats > 1  # repeats also sharpen the globals: less than in step


def test_a_drop_separates_them_as_far_as_it_promised(stories):
    """The costs move by the distance squared or more: it is stated for the worse of two truths."""
    expected = np.array([s.proposed.expected_distance for s in stories])
    moved = float(np.mean([s.moved for s in stories]))
    promised = float(np.mean(expected**2))
    noise = 2.0 * float(np.sqrt(np.mean(expected**2) / len(stories)))
    assert promised - 3.0 * noise < moved < 2.0 * promised + 3.0 * noise


def test_heights_a_little_beyond_those_tried_are_searched(stories):
    """Without a list of heights the drop is at least as good as at the rig's own stops."""
    rivals, at_stops, _ = stories[0]
    free = propose(rivals)
    tried = [s.shot.drop_height_m for s in rivals[0].problem.shots]
    assert min(tried) / 1.51 <= free.drop_height_m <= max(tried) * 2.01
    assert free.expected_distance >= 0.9 * at_stops.expected_distance


def test_no_drop_is_proposed_whose_record_would_clip(stories):
    """Where the smallest record already sat on a limit, nothing higher is proposed."""
    rivals, _, _ = stories[0]
    problem = dataclasses.replace(rivals[0].problem)
    problem.shots = [
        dataclasses.replace(s, shot=dataclasses.replace(s.shot, clipped=True))
        for s in problem.shots
    ]
    tight = propose([dataclasses.replace(rivals[0], problem=problem), rivals[1]])
    assert tight is None or tight.drop_height_m < min(s.shot.drop_height_m for s in problem.shots)


def test_nothing_is_proposed_where_nothing_would_help(stories):
    """A model has no rival in itself, a lone one has none, and without heights nobody can say."""
    (one, other), _, _ = stories[0]
    assert propose([one]) is None
    assert propose([one, one]) is None
    problem = dataclasses.replace(one.problem)
    problem.shots = [
        dataclasses.replace(s, shot=dataclasses.replace(s.shot, drop_height_m=None))
        for s in problem.shots
    ]
    assert propose([dataclasses.replace(one, problem=problem), other]) is None
