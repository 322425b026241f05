"""Names that are wrong in a whole group: which others come near, and that none does elsewhere."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.labels import likely_labels
from analysis.diagnosis.mistakes import named_mistake
from analysis.diagnosis.procedure import _base, _restated
from analysis.diagnosis.progress import Watch
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from impactd.storage.campaign_folder import read_campaign


def campaign(folder: Path, *effects: Effect) -> Campaign:
    """Return three spheres on three surfaces from two heights."""
    settings = dataclasses.replace(
        CampaignSettings(), drop_heights_m=(0.0155, 0.0405), repeats=1, effects=effects
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 11)))


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Nothing acts, and all is written down as it was."""
    return campaign(tmp_path_factory.mktemp("clean"))


def relabelled(whole: Campaign, change: Callable[[Shot], Shot]) -> Campaign:
    """Return a campaign with other names in it."""
    return dataclasses.replace(whole, shots=tuple(map(change, whole.shots)))


def near(whole: Campaign) -> list[str]:
    """Return in words which labels come near noise."""
    problem = build(whole, model_named("kv2"))
    return [one.sentence for one in likely_labels(problem)]


@pytest.mark.parametrize("side", ["sphere", "surface"])
def test_names_exchanged_are_found_and_put_right(clean: Campaign, side: str) -> None:
    """Of all pairs of names the one that was exchanged, and the campaign as it was before."""
    known = clean.spheres if side == "sphere" else clean.surfaces
    stated = [name for name, one in known.items() if one.youngs_modulus_pa is not None]
    one, other = sorted(stated)[:2]
    to = {one: other, other: one}

    def exchanged(shot: Shot) -> Shot:
        """Return a shot under the other name."""
        name = getattr(shot, side)
        changed = {"sphere": shot.sphere, "surface": shot.surface, side: to.get(name, name)}
        return dataclasses.replace(shot, sphere=changed["sphere"], surface=changed["surface"])

    wrong = relabelled(clean, exchanged)
    assert near(wrong)[0] == f"the names {one} and {other} are exchanged in all shots"
    if side == "sphere":
        step = _base(wrong, "kv2", Watch())[0].last
        found = named_mistake(step, lambda whole: _restated(whole, "kv2", Watch()), Watch())
        assert found is not None
        assert (found.best.id, found.best.kind) == ("wrong_label", "sphere")
        right = [(shot.sphere, shot.surface) for shot in clean.shots]
        assert [(shot.sphere, shot.surface) for shot in found.best.restated.shots] == right


def test_a_pair_under_a_name_that_was_never_dropped_is_found(clean: Campaign) -> None:
    """All of its shots belong to another surface."""
    sphere, wrong, right = sorted(clean.spheres)[0], *sorted(clean.surfaces)[:2]
    left = [s for s in clean.shots if (s.sphere, s.surface) != (sphere, wrong)]
    whole = dataclasses.replace(clean, shots=tuple(left))

    def renamed(shot: Shot) -> Shot:
        """Return a shot under the other name."""
        pair = (shot.sphere, shot.surface)
        return dataclasses.replace(shot, surface=wrong) if pair == (sphere, right) else shot

    said = f"all shots labelled {sphere} on {wrong} are of {right}, not {wrong}"
    assert near(relabelled(whole, renamed))[0] == said


def test_a_loud_effect_is_no_wrong_name(tmp_path: Path) -> None:
    """No other label comes near noise where the amplifier clips."""
    clipped = campaign(tmp_path, make_effect("clipping", {"limit_v": 2.0, "softness": 0.1}))
    assert not near(clipped)
