"""Mistakes of people in simulated campaigns."""

from __future__ import annotations

import copy
import functools
import json
import math
from typing import Any

import numpy as np
import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from drivers.simulated.drops import Drops, draw_drops
from drivers.simulated.label_spread import TYPICAL
from drivers.simulated.mistakes import (
    COUPON_CHANGE,
    DRIFT,
    GAIN_CHANGE,
    HEIGHT_ERROR,
    LABEL_ERROR,
    MISTAKES,
    SINGLE_SHOT,
    Mistake,
    draw_mistake,
    make_mistake,
)

SETTINGS = CampaignSettings(spread=TYPICAL)
SEED = 4
Json = dict[str, Any]


@functools.cache
def _bare() -> Json:
    return simulate_campaign(SETTINGS, SEED)


def _drawn(mistake_id: str, seed: int = 1) -> Mistake:
    rng = np.random.default_rng(seed)
    return draw_mistake(rng, draw_drops(SETTINGS, SEED), [mistake_id])


def _changed(made: Json) -> list[int]:
    """Return the places of records that are not as without the mistake."""
    pairs = zip(made["codes"], _bare()["codes"], strict=True)
    return [i for i, (one, other) in enumerate(pairs) if not np.array_equal(one, other)]


def test_all_eight_are_drawn_with_sizes_within_their_limits() -> None:
    """Each as often, of either sign, at every place of the middle or of the whole."""
    drops = draw_drops(SETTINGS, SEED)
    rng = np.random.default_rng(1)
    drawn = [draw_mistake(rng, drops) for _ in range(1600)]
    limits = {
        "wrong_mass": LABEL_ERROR,
        "wrong_radius": LABEL_ERROR,
        "wrong_height": HEIGHT_ERROR,
        "coupon_exchanged": COUPON_CHANGE,
        "gain_switched": GAIN_CHANGE,
    }
    for mistake_id in MISTAKES:
        own = [m for m in drawn if m.id == mistake_id]
        assert 140 <= len(own) <= 260
        if mistake_id in limits:
            sizes = [math.log(m.numbers["factor"]) for m in own]
        elif mistake_id == "drift_in_time":
            sizes, limits[mistake_id] = [m.numbers["relative_change"] for m in own], DRIFT
        else:
            assert len({m.scope["shot"] for m in own}) > 45
            continue
        low, high = limits[mistake_id]
        assert low <= min(map(abs, sizes)) < 1.2 * low
        assert high / 1.2 < max(map(abs, sizes)) <= high
        assert 0.35 < np.mean(np.sign(sizes) > 0) < 0.65
    odd = [m.numbers["factor"] for m in drawn if m.id == "odd_shot"]
    assert 0.8 <= min(odd) < max(odd) <= 0.97
    begun = [m.numbers["first_shot"] for m in drawn if m.id == "gain_switched"]
    assert (min(begun), max(begun)) == (11, 43)


def test_the_same_chance_draws_the_same_mistake() -> None:
    """And it is ready for JSON."""
    for mistake_id in MISTAKES:
        mistake = _drawn(mistake_id)
        assert mistake == _drawn(mistake_id)
        assert mistake != _drawn(mistake_id, 2)
        assert json.loads(json.dumps(mistake.to_json())) == mistake.to_json()


@pytest.mark.parametrize(
    ("mistake_id", "key"), [("wrong_mass", "mass_kg"), ("wrong_radius", "radius_m")]
)
def test_a_wrong_number_of_a_sphere_changes_that_number_alone(mistake_id: str, key: str) -> None:
    """Its uncertainty is stated as before, and no record knows of it."""
    mistake = _drawn(mistake_id)
    made = make_mistake(SETTINGS, SEED, mistake)
    sphere = made["campaign"]["spheres"][mistake.scope["sphere"]]
    right = _bare()["campaign"]["spheres"][mistake.scope["sphere"]]
    assert sphere[key]["value"] == mistake.numbers["factor"] * right[key]["value"]
    assert sphere[key]["u"] == right[key]["u"]
    undone = copy.deepcopy(made["campaign"])
    undone["spheres"][mistake.scope["sphere"]][key]["value"] = right[key]["value"]
    assert undone == _bare()["campaign"]
    assert _changed(made) == []
    assert made["truth"] == _bare()["truth"] | {"mistake": mistake.to_json()}


def test_a_wrong_height_is_stated_in_all_shots_of_that_height() -> None:
    """A third of them, as surely as before; the others keep theirs."""
    mistake = _drawn("wrong_height")
    made = make_mistake(SETTINGS, SEED, mistake)
    wrong = 0
    for shot, right in zip(made["campaign"]["shots"], _bare()["campaign"]["shots"], strict=True):
        assert shot["drop_height_m"]["u"] == right["drop_height_m"]["u"]
        if right["drop_height_m"]["value"] == mistake.numbers["drop_height_m"]:
            assert shot["drop_height_m"]["value"] == mistake.scope["drop_height_m"]
            wrong += 1
        else:
            assert shot == right
    assert wrong == 18
    assert _changed(made) == []


def test_numbers_without_an_uncertainty_stay_plain() -> None:
    """A campaign that keeps quiet about its uncertainties does so about a wrong number, too."""
    settings = CampaignSettings(repeats=1)
    for mistake_id in ("wrong_mass", "wrong_height"):
        mistake = draw_mistake(np.random.default_rng(1), draw_drops(settings, 1), [mistake_id])
        made = make_mistake(settings, 1, mistake)["campaign"]
        stated = [s["mass_kg"] for s in made["spheres"].values()]
        assert all(isinstance(s, float) for s in stated)
        assert all(isinstance(s["drop_height_m"], float) for s in made["shots"])


def test_a_wrong_label_is_the_name_of_another_material_in_one_shot() -> None:
    """Of a sphere or of a surface that the campaign has."""
    sides = set()
    for seed in range(8):
        mistake = _drawn("wrong_label", seed)
        ((side, name),) = mistake.label.items()
        sides.add(side)
        made = make_mistake(SETTINGS, SEED, mistake)
        place = mistake.scope["shot"]
        right = _bare()["campaign"]["shots"][place]
        assert name != right[side]
        assert name in made["campaign"]["spheres" if side == "sphere" else "surfaces"]
        assert made["campaign"]["shots"][place] == right | {side: name}
        assert _changed(made) == []
    assert sides == {"sphere", "surface"}


def test_an_odd_shot_is_smaller_about_the_converters_zero() -> None:
    """The others are as they were."""
    mistake = _drawn("odd_shot")
    made = make_mistake(SETTINGS, SEED, mistake)
    place, factor = mistake.scope["shot"], mistake.numbers["factor"]
    assert _changed(made) == [place]
    off = made["codes"][place] - factor * _bare()["codes"][place].astype(float)
    assert np.max(np.abs(off)) <= 0.5 + 1e-9
    assert made["codes"][place].dtype == np.int16


def test_a_switched_gain_and_a_drift_act_from_their_shot_on() -> None:
    """A step from one shot to the next, a straight line from the first shot to the last."""
    switched, drift = _drawn("gain_switched"), _drawn("drift_in_time")
    begins = switched.numbers["first_shot"]
    made = make_mistake(SETTINGS, SEED, switched)
    assert _changed(made) == list(range(int(begins), 54))
    assert switched.numbers["last_before"] == begins - 1
    made = make_mistake(SETTINGS, SEED, drift)
    for place in (0, 27, 53):
        factor = 1.0 + drift.numbers["relative_change"] * place / 53
        off = made["codes"][place] - factor * _bare()["codes"][place].astype(float)
        assert np.max(np.abs(off)) <= 0.5 + 1e-9
    assert _changed(made)[0] == 1


def test_a_larger_gain_stops_at_the_converters_range() -> None:
    """Codes of a coarse converter stay its own."""
    settings = CampaignSettings(bits=8, repeats=1, fill=0.99)
    mistake = Mistake("gain_switched", {"cell": "gain"}, {"factor": 1.5, "first_shot": 0})
    made = make_mistake(settings, 1, mistake)
    assert max(int(np.max(codes)) for codes in made["codes"]) == 127


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_exchanged_coupon_changes_later_shots_on_the_specimen_alone(seed: int) -> None:
    """To the last code: cell, noise, speeds and all that is stated are those of one campaign."""
    mistake = _drawn("coupon_exchanged", seed)
    made = make_mistake(SETTINGS, SEED, mistake)
    begins, before = mistake.numbers["first_shot"], mistake.numbers["last_before"]
    shots = _bare()["campaign"]["shots"]
    own = [i for i, s in enumerate(shots) if s["surface"] == "specimen"]
    assert _changed(made) == [i for i in own if i >= begins]
    assert own[own.index(int(begins)) - 1] == before
    stated = dict(made["campaign"]) | {"shots": shots}
    assert stated == _bare()["campaign"]
    for i, (shot, right) in enumerate(zip(made["campaign"]["shots"], shots, strict=True)):
        assert shot.keys() == right.keys()
        kept = ("trigger_index", "restitution") if i in own and i >= begins else ()
        assert {k: v for k, v in shot.items() if k not in kept} == {
            k: v for k, v in right.items() if k not in kept
        }
    truth = dict(made["truth"])
    assert truth.pop("mistake") == mistake.to_json()
    after, first = (
        t["shots"][int(begins)]["reduced_modulus_Pa"] for t in (truth, _bare()["truth"])
    )
    assert (after > first) == (mistake.numbers["factor"] > 1.0)
    assert truth | {"shots": None} == _bare()["truth"] | {"shots": None}


def test_a_campaign_without_a_place_for_a_mistake_says_so() -> None:
    """One pair has no other name, and no specimen no other piece."""
    lonely = Drops({}, (("steel", "aluminium", 0.03),) * 4)
    for mistake_id, said in (("wrong_label", "no other name"), ("coupon_exchanged", "specimen")):
        with pytest.raises(ValueError, match=said):
            draw_mistake(np.random.default_rng(1), lonely, [mistake_id])
    with pytest.raises(ValueError, match="No mistake is called 'typo'"):
        make_mistake(SETTINGS, SEED, Mistake("typo", {}, {}))
    assert set(SINGLE_SHOT) < set(MISTAKES)
