"""Names that are wrong in a whole group: which others come near, and that none does elsewhere."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.base_choice import fitted_base
from analysis.diagnosis.labels import _put_right, likely_labels
from analysis.diagnosis.mistakes import named_mistake
from analysis.diagnosis.procedure import _restated
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
        step = fitted_base(wrong, "kv2", Watch())[0].last
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


def test_names_exchanged_for_some_time_are_found_and_put_right(tmp_path: Path) -> None:
    """The shots before and after tell which names are meant."""
    settings = dataclasses.replace(
        CampaignSettings(), drop_heights_m=(0.0155, 0.0405), repeats=2, effects=()
    )
    whole = read_campaign(write_campaign_folder(tmp_path, simulate_campaign(settings, 11)))
    to = {"aluminium": "polycarbonate", "polycarbonate": "aluminium"}
    some = range(14, 22)
    shots = tuple(
        dataclasses.replace(shot, surface=to.get(str(shot.surface), shot.surface))
        if at in some
        else shot
        for at, shot in enumerate(whole.shots)
    )
    changed = [at for at in some if shots[at] != whole.shots[at]]
    found = likely_labels(build(dataclasses.replace(whole, shots=shots), model_named("kv2")))
    assert [shot.surface for shot in found[0].campaign.shots] == [s.surface for s in whole.shots]
    assert f"{len(changed)} of {len(shots)} shots, from shot {changed[0]} to" in found[0].sentence
    assert found[0].group == "aluminium and polycarbonate"


def test_wrong_names_and_wrong_rates_are_told_apart(clean: Campaign) -> None:
    """Each with its own shots; the places of shots in one go are not listed one by one."""
    right: dict[int, dict[str, str | float]] = {
        id(clean.shots[at]): {"sample_rate_hz": 5e5} for at in (7, 8, 9)
    }
    right |= {id(clean.shots[at]): {"sphere": "hdpe"} for at in (1, 4)}
    found = _put_right(clean, right)
    count = len(clean.shots)
    assert found.sentence == (
        f"2 of {count} shots, from shot 1 to shot 4 (shots 1, 4), have wrong names: they are of "
        f"hdpe; 3 of {count} shots, from shot 7 to shot 9, have a wrong sample rate: it was 500 kHz"
    )
    assert found.side == "sphere"
    assert [shot.sample_rate_hz for shot in found.campaign.shots[6:11]] == [1e6, *3 * [5e5], 1e6]


@pytest.mark.slow
def test_single_wrong_names_are_found_where_each_pair_was_dropped_in_one_go(
    tmp_path: Path,
) -> None:
    """No third of the time holds all pairs, but a third of each pair's shots does."""
    settings = dataclasses.replace(
        CampaignSettings(), drop_heights_m=(0.0155, 0.0405), repeats=3, effects=()
    )
    whole = read_campaign(write_campaign_folder(tmp_path, simulate_campaign(settings, 12)))
    shots = sorted(whole.shots, key=lambda shot: (str(shot.surface), str(shot.sphere)))
    one, other = sorted(whole.spheres)[:2]
    to = {one: other, other: one}
    of_either = [at for at, shot in enumerate(shots) if shot.sphere in to]
    wrong = [*of_either[4:6], *of_either[-2:]]
    for at in wrong:
        shots[at] = dataclasses.replace(shots[at], sphere=to[str(shots[at].sphere)])
    problem = build(dataclasses.replace(whole, shots=tuple(shots)), model_named("kv2"))
    (found,) = [r for r in likely_labels(problem) if f"{len(wrong)} of" in r.sentence]
    assert f"(shots {', '.join(map(str, wrong))})" in found.sentence


@pytest.mark.slow
def test_a_sample_rate_that_was_changed_is_found_and_put_right(tmp_path: Path) -> None:
    """From some shot on the records have half of the samples, and the rate says nothing of it."""
    settings = dataclasses.replace(
        CampaignSettings(), drop_heights_m=(0.0155, 0.0405), repeats=2, effects=()
    )
    whole = read_campaign(write_campaign_folder(tmp_path, simulate_campaign(settings, 13)))
    first, count = 26, len(whole.shots)

    def halved(shot: Shot) -> Shot:
        """Return every other sample of a shot."""
        return dataclasses.replace(
            shot, signal=shot.signal[::2], trigger_index=shot.trigger_index // 2
        )

    shots = (*whole.shots[:first], *map(halved, whole.shots[first:]))
    problem = build(dataclasses.replace(whole, shots=shots), model_named("kv2"))
    (found,) = likely_labels(problem)
    assert (found.side, found.group) == ("cell", "sample_rate_hz")
    assert found.sentence.startswith(f"{count - first} of {count} shots, from shot {first} to")
    assert "it was 500 kHz" in found.sentence
    rates = [shot.sample_rate_hz for shot in found.campaign.shots]
    assert rates == [1e6] * first + [5e5] * (count - first)
