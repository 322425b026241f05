"""How answers to mistakes of people are judged and counted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from drivers.simulated.mistakes import MISTAKES
from impactd.bench.blind.outcome import RECORD, groups_right, is_detectable, names_all, outcome
from impactd.bench.blind.questions import answers
from impactd.bench.blind.trial import Trial, where

ATrial = Callable[..., Trial]
Json = dict[str, Any]


def _record(mistake_id: str, scope: Json, **parameters: float) -> Json:
    """Return an entry of a diagnosis' effects as it is in the document."""
    return {
        "id": mistake_id,
        "slot": "record",
        "scope": scope,
        "parameters": {name: {"value": value} for name, value in parameters.items()},
    }


def _said(*effects: Json, **more: Any) -> Json:
    """Return what a trial takes over from these entries."""
    return {"named": [e["id"] for e in effects], "acts_on": [where(e) for e in effects]} | more


ADHESION = {"id": "adhesion", "slot": "contact", "scope": "rig", "acts_on": None}
OF_ACETAL = {"sphere": "acetal"}
GAIN = {"cell": "gain"}


def test_a_diagnosis_has_a_word_for_every_mistake_but_one_bad_shot() -> None:
    """Two kinds of change are one to it."""
    assert set(RECORD) == {
        "wrong_mass",
        "wrong_radius",
        "wrong_height",
        "change_point",
        "drift_in_time",
    }


@pytest.mark.parametrize(
    ("made", "said", "judged", "placed"),
    [
        ("wrong_mass", _said(_record("wrong_mass", OF_ACETAL)), "right", True),
        ("wrong_mass", _said(_record("wrong_mass", {"sphere": "hdpe"})), "right", False),
        ("wrong_mass", _said(_record("wrong_radius", OF_ACETAL)), "wrong", False),
        ("wrong_mass", _said(ADHESION), "wrong", False),
        ("wrong_mass", _said(_record("wrong_mass", OF_ACETAL), ADHESION), "wrong", True),
        ("wrong_mass", _said(_record("wrong_mass", OF_ACETAL), set_aside=[3]), "half", True),
        ("wrong_mass", _said(set_aside=[3]), "wrong", False),
        ("wrong_mass", _said(), "missed", False),
        ("wrong_mass", _said(verdict="unknown"), "unknown", False),
        ("wrong_mass", _said(verdict="partial"), "unknown", False),
        ("wrong_mass", _said(verdict="failed"), "failed", False),
        (
            "wrong_mass",
            _said(_record("wrong_radius", OF_ACETAL), confusable=[["wrong_mass"]]),
            "family",
            False,
        ),
        ("wrong_mass", _said(ADHESION, confusable=[["wrong_mass"]]), "wrong", False),
        (
            "wrong_radius",
            _said(_record("wrong_radius", OF_ACETAL), verdict="unknown"),
            "right",
            True,
        ),
        ("wrong_height", _said(_record("wrong_height", {"drop_height_m": 0.0272})), "right", True),
        ("wrong_height", _said(_record("wrong_height", {"drop_height_m": 0.0225})), "right", False),
        ("odd_shot", _said(set_aside=[5]), "right", True),
        ("odd_shot", _said(set_aside=[5], verdict="unknown"), "right", True),
        ("odd_shot", _said(set_aside=[5, 6]), "half", False),
        ("odd_shot", _said(set_aside=[6]), "wrong", False),
        ("odd_shot", _said(ADHESION, set_aside=[5]), "wrong", True),
        ("odd_shot", _said(), "missed", False),
        ("wrong_label", _said(set_aside=[17]), "right", True),
        ("wrong_label", _said(_record("wrong_mass", OF_ACETAL)), "wrong", False),
        ("drift_in_time", _said(_record("drift_in_time", GAIN)), "right", True),
        ("drift_in_time", _said(_record("change_point", GAIN, first_shot=27)), "wrong", False),
        ("gain_switched", _said(_record("change_point", GAIN, first_shot=30)), "right", True),
        ("gain_switched", _said(_record("change_point", GAIN, first_shot=31)), "right", True),
        ("gain_switched", _said(_record("change_point", GAIN, first_shot=29)), "right", True),
        ("gain_switched", _said(_record("change_point", GAIN, first_shot=32)), "right", False),
        ("gain_switched", _said(_record("change_point", GAIN)), "right", False),
        (
            "gain_switched",
            _said(_record("change_point", {"surface": "specimen"}, first_shot=30)),
            "right",
            False,
        ),
    ],
)
def test_an_answer_to_a_mistake_is_judged_by_kind_and_by_place(
    a_mistake: ATrial, made: str, said: Json, judged: str, placed: bool
) -> None:
    """A name that is false, or good shots set aside, spoil it; where it acts is asked apart."""
    trial = a_mistake(made, **said)
    assert (outcome(trial), groups_right(trial)) == (judged, placed)
    assert is_detectable(trial)


@pytest.mark.parametrize(
    ("first", "placed"),
    [(19, False), (20, True), (22, True), (24, True), (25, True), (26, False)],
)
def test_an_exchange_begins_anywhere_behind_the_last_drop_on_the_old_piece(
    a_mistake: ATrial, first: int, placed: bool
) -> None:
    """Shots 21 to 23 fell on other surfaces: no one can tell; one shot off is let pass."""
    said = _said(_record("change_point", {"surface": "specimen"}, first_shot=first))
    assert groups_right(a_mistake("coupon_exchanged", **said)) == placed


def test_good_shots_set_aside_spoil_any_verdict(a_trial: ATrial) -> None:
    """On a clean campaign they are a false alarm, beside a right name half of it."""
    assert outcome(a_trial(verdict="adequate", set_aside=[3])) == "wrong"
    assert outcome(a_trial(verdict="adequate", named=["drift_in_time"])) == "wrong"
    assert outcome(a_trial("echo", named=["echo"], set_aside=[3])) == "half"
    assert outcome(a_trial("echo", verdict="unknown", set_aside=[3])) == "wrong"
    assert outcome(a_trial("echo", named=["wrong_mass"])) == "wrong"


def test_the_kind_of_one_bad_shot_is_that_there_is_one(a_mistake: ATrial) -> None:
    """Which one is asked of these."""
    assert names_all(a_mistake("odd_shot", set_aside=[6]))
    assert not names_all(a_mistake("odd_shot"))
    assert names_all(a_mistake("gain_switched", named=["change_point"], acts_on=[{}]))


def test_mistakes_are_counted_by_kind_place_false_name_and_modulus(
    a_mistake: ATrial, a_trial: ATrial
) -> None:
    """Each in its own row; of an exchanged specimen either piece's modulus will do."""
    stated = {"value": 1.1e9, "u": 1e7, "interval95": [1.08e9, 1.12e9]}
    modulus = {"plane": {"after": stated}, "plane_true": 1.0e9, "seconds": 6.0}
    change = _said(_record("change_point", {"surface": "specimen"}, first_shot=24))
    trials = [
        a_mistake("coupon_exchanged", **change, **modulus),
        a_mistake("wrong_mass", **_said(_record("wrong_mass", {"sphere": "hdpe"})), **modulus),
        a_mistake("wrong_radius", **_said(ADHESION)),
        a_mistake("odd_shot", set_aside=[5], seconds=6.0),
        a_mistake("odd_shot", visible=9.0, visible_each=[9.0]),
        a_trial(kind="clean", verdict="adequate", seconds=4.0),
        a_trial(kind="clean", verdict="adequate", set_aside=[1], seconds=4.0),
        a_trial("echo", named=["drift_in_time"], acts_on=[GAIN]),
    ]
    asked = {a.question: a for a in answers(trials)}

    def share(question: str) -> tuple[int, float]:
        """Return how many were asked, and which share of them."""
        return asked[question].count, asked[question].value

    assert share("mistakes: the right kind named") == (4, 0.75)
    assert share("- wrong_radius") == (1, 0.0)
    assert share("- odd_shot") == (1, 1.0)
    assert share("- of the right kind: the right shot or group") == (3, 2 / 3)
    assert share("mistakes: an effect of the library named") == (5, 0.2)
    assert share("- of detectable ones") == (4, 0.25)
    question = "mistakes of the right kind: 95 % interval of E/(1-nu^2) covers, after"
    assert share(question) == (2, 0.5)
    assert share("effects taken for a mistake of people") == (1, 1.0)
    assert share("clean called discrepant, white and AR(1)") == (2, 0.5)
    assert share("clean, any noise: a mistake of people claimed") == (2, 0.5)
    assert share("one bad shot: time to the verdict over a clean one's") == (1, 1.5)


def test_every_mistake_of_the_simulator_can_be_judged(a_mistake: ATrial) -> None:
    """None is forgotten here."""
    assert {outcome(a_mistake(mistake_id)) for mistake_id in MISTAKES} == {"missed"}


def test_old_lines_have_no_mistake(a_trial: ATrial) -> None:
    """And nothing was set aside in them."""
    old = a_trial("echo")
    assert (old.mistake, old.set_aside, old.truth) == (None, [], ["echo"])
