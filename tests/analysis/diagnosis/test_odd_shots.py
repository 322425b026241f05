"""Shots that do not belong: found, set aside with what they are like, and no good one with them."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.diagnosing import diagnose
from analysis.diagnosis.base_choice import fitted_base
from analysis.diagnosis.odd_shots import Rest, without_odd_shots
from analysis.diagnosis.progress import Watch
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from impactd.storage.campaign_folder import read_campaign

AT = 7


def campaign(folder: Path, *, repeats: int = 3, **changed: Any) -> Campaign:
    """Return two spheres on three surfaces from two heights, read back from a folder."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        repeats=repeats,
        **{"drop_heights_m": (0.0155, 0.0405)} | changed,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 11)))


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Nothing acts, and every label is right."""
    return campaign(tmp_path_factory.mktemp("clean"))


def changed(whole: Campaign, at: int, **how: Any) -> Campaign:
    """Return a campaign with one shot stated or recorded otherwise."""
    shots = list(whole.shots)
    shots[at] = dataclasses.replace(shots[at], **how)
    return dataclasses.replace(whole, shots=tuple(shots))


def scaled(whole: Campaign, at: int, by: float) -> Campaign:
    """Return a campaign with one shot's record times a factor."""
    shot = whole.shots[at]
    return changed(whole, at, signal=shot.code_zero + by * (shot.signal - shot.code_zero))


def rest_of(whole: Campaign) -> Rest | None:
    """Return what is left of a campaign without its odd shots."""
    selection, usual = fitted_base(whole, "kv2", Watch())
    assert not selection.adequate
    return without_odd_shots(selection.last, usual, Watch())


def other(names: Any, own: str | None) -> str:
    """Return the first name that is another."""
    return next(name for name in sorted(names) if name != own)


def test_a_wrong_label_is_told_with_the_right_one(clean: Campaign) -> None:
    """Sphere and surface, each as it truly was."""
    shot = clean.shots[AT]
    for wrong in (
        {"sphere": other(clean.spheres, shot.sphere)},
        {"surface": other(clean.surfaces, shot.surface)},
    ):
        rest = rest_of(changed(clean, AT, **wrong))
        assert rest is not None
        (one,) = rest.set_aside
        assert one.shot == AT
        assert one.name == shot.name
        assert one.likely == {key: getattr(shot, key) for key in wrong}
        assert "look at the label" in one.because


def test_two_labels_that_were_swapped(clean: Campaign) -> None:
    """Both, and each is like the other."""
    one, two = (
        next(i for i, s in enumerate(clean.shots) if s.surface == name)
        for name in sorted(clean.surfaces)[:2]
    )
    swapped = changed(clean, one, surface=clean.shots[two].surface)
    swapped = changed(swapped, two, surface=clean.shots[one].surface)
    rest = rest_of(swapped)
    assert rest is not None
    assert [s.shot for s in rest.set_aside] == sorted((one, two))
    for s in rest.set_aside:
        assert s.likely == {"surface": clean.shots[s.shot].surface}


def test_another_gain_and_another_height_are_told_by_their_size(clean: Campaign) -> None:
    """Within a few of the uncertainties that one shot allows."""
    rest = rest_of(scaled(clean, AT, 0.9))
    assert rest is not None
    (one,) = rest.set_aside
    assert one.shot == AT
    assert one.likely["gain"] == pytest.approx(0.9, abs=0.02)
    height = clean.shots[AT].drop_height_m
    assert height is not None
    rest = rest_of(changed(clean, AT, drop_height_m=1.3 * height))
    assert rest is not None
    (one,) = rest.set_aside
    assert one.shot == AT
    assert one.likely["drop_height_m"] == pytest.approx(height, rel=0.03)


def test_a_record_that_is_a_copy_of_another_is_told(clean: Campaign) -> None:
    """Whatever its own drop was like, it is not in the record."""
    other = next(
        at for at, shot in enumerate(clean.shots) if shot.sphere != clean.shots[AT].sphere
    )
    rest = rest_of(changed(clean, AT, signal=clean.shots[other].signal))
    assert rest is not None
    (one,) = rest.set_aside
    assert one.shot == AT
    assert f"Its record is a copy of that of shot {other} " in one.because


def test_a_label_that_draws_the_whole_fit_off(clean: Campaign) -> None:
    """Where every shot is far from the model that all of them share."""
    odd = changed(clean, AT, signal=40.0 * clean.shots[AT].signal)
    selection, usual = fitted_base(odd, "kv2", Watch())
    rest = without_odd_shots(selection.last, usual, Watch())
    assert rest is not None
    assert [one.shot for one in rest.set_aside] == [AT]


def test_what_acts_on_every_shot_sets_none_aside(tmp_path: Path) -> None:
    """An effect is no reason to leave shots out."""
    echo = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    assert rest_of(campaign(tmp_path, effects=(echo,))) is None


def test_lower_and_higher_drops_of_the_pair_stand_for_a_repetition(tmp_path: Path) -> None:
    """An effect that grows with the speed does not spare both; beyond the highest it may act."""
    once = campaign(tmp_path, repeats=1, drop_heights_m=(0.0155, 0.0285, 0.0405))
    heights = sorted({shot.drop_height_m for shot in once.shots if shot.drop_height_m})
    for height, alone in zip(heights, (False, True, False), strict=True):
        at = next(i for i, shot in enumerate(once.shots) if shot.drop_height_m == height)
        rest = rest_of(scaled(once, at, 0.8))
        assert (rest is not None) == alone
        if rest is not None:
            assert rest.set_aside[0].likely["gain"] == pytest.approx(0.8, rel=0.02)


def test_without_a_repetition_an_effect_may_be_the_reason(tmp_path: Path) -> None:
    """A shot of its own condition stays, unless a height or a label of its own explains it."""
    once = campaign(tmp_path, repeats=1)
    assert rest_of(scaled(once, AT, 0.6)) is None
    height = once.shots[AT].drop_height_m
    assert height is not None
    rest = rest_of(changed(once, AT, drop_height_m=1.4 * height))
    assert rest is not None
    assert [one.shot for one in rest.set_aside] == [AT]
    right = once.shots[AT].sphere
    rest = rest_of(changed(once, AT, sphere=other(once.spheres, right)))
    assert rest is not None
    assert rest.set_aside[0].likely["sphere"] == right


@pytest.mark.parametrize("count", [1, 2])
def test_of_two_shots_none_is_the_odd_one(clean: Campaign, count: int) -> None:
    """Whatever is wrong with them: a short campaign is judged as it is."""
    at = [AT, next(i for i, s in enumerate(clean.shots) if i != AT)][:count]
    few = dataclasses.replace(clean, shots=tuple(clean.shots[i] for i in at))
    assert rest_of(changed(few, 0, signal=np.abs(few.shots[0].signal))) is None


def test_the_document_tells_what_was_set_aside_and_judges_the_rest(clean: Campaign) -> None:
    """One bad shot costs no modulus."""
    shot = clean.shots[AT]
    wrong = changed(clean, AT, surface=other(clean.surfaces, shot.surface))
    document = diagnose(wrong)
    assert document["verdict"] == "adequate"
    (one,) = document["set_aside"]
    assert one["shot"] == AT
    assert document["sentence"].startswith(f"Shot {AT} ({shot.name}) does not belong. It leaves")
    assert document["campaign"]["shots"] == len(clean.shots) - 1
    right = diagnose(clean)["after"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    found = document["after"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    assert abs(found["value"] - right["value"]) < 2.0 * math.hypot(found["u"], right["u"])
    curves = one["curves"]
    assert len({len(values) for values in curves.values()}) == 1
    assert np.ptp(curves["signal"]) > 0.0
