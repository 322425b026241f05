"""What is counted over many trials."""

from __future__ import annotations

from collections.abc import Callable

from impactd.aliases import Json
from impactd.bench.blind.outcome import shown_rightly
from impactd.bench.blind.questions import answers
from impactd.bench.blind.trial import Trial


def test_coverage_is_asked_of_every_verdict_that_states_a_modulus(
    a_trial: Callable[..., Trial],
) -> None:
    """One that holds and one that does not count a half; one that is withheld does not count."""
    stated = {"value": 1.0e9, "u": 1e7, "interval95": [0.98e9, 1.02e9]}
    trials = [
        a_trial("echo", plane={"after": stated}, plane_true=1.01e9),
        a_trial("echo", verdict="partial", plane={"after": stated}, plane_true=1.2e9),
        a_trial("echo", verdict="unknown", plane={"after": None}, plane_true=1.2e9),
    ]
    asked = {a.question: a for a in answers(trials)}
    whole = asked["95 % interval of E/(1-nu^2) covers, whatever the verdict"]
    assert (whole.count, whole.value, whole.goal) == (2, 0.5, ">= 0.92")
    assert asked["- identified"].value == 1.0
    assert asked["- partial"].value == 0.0
    assert "- unknown" not in asked


def test_a_grouping_is_right_where_the_very_materials_are_named(
    a_trial: Callable[..., Trial],
) -> None:
    """All, one and some count by themselves; a name that nobody gave counts for no grouping."""

    def trial(scope: Json, said: Json, named: str = "plate_radiation") -> Trial:
        """Return a trial in which a plate radiates somewhere, and a name was given somewhere."""
        effect = {"id": "plate_radiation", "slot": "contact", "scope": scope}
        return a_trial(effects=[effect], named=[named], acts_on=[said], visible_each=[1e4])

    both = {"surface": ["aluminium", "specimen"]}
    trials = [
        trial({}, {}),
        trial({"surface": "specimen"}, {"surface": "specimen"}),
        trial(both, both),
        trial(both, {}),
        trial(both, both, named="echo"),
    ]
    asked = {a.question: a for a in answers(trials)}
    right = asked["- named: with the right materials"]
    assert (right.count, right.value) == (4, 0.75)
    assert asked["- some, named: with the right materials"].value == 0.5
    assert asked["groupings drawn at random: right name or family"].value == 0.8


def test_what_is_said_of_materials_is_true_where_all_that_show_it_have_it(
    a_trial: Callable[..., Trial],
) -> None:
    """On all, shown by one of its own: true. Shown by another, or given to too few: not."""
    effect = {"id": "plate_radiation", "slot": "contact", "scope": {"surface": ["a", "b"]}}

    def trial(said: Json, seen: Json) -> Trial:
        """Return a trial in which a plate radiates on two surfaces."""
        own = {"effects": [effect], "named": ["plate_radiation"], "visible_each": [1e4]}
        return a_trial(**own, acts_on=[said], seen_on=[seen])

    one = {"surface": "a"}
    assert shown_rightly(trial({}, one))
    assert shown_rightly(trial({"surface": ["a", "b"]}, {}))
    assert shown_rightly(trial({"surface": ["a", "b"]}, one))
    assert not shown_rightly(trial({}, {}))
    assert not shown_rightly(trial({}, {"surface": "c"}))
    assert not shown_rightly(trial(one, {}))


def test_forms_left_out_are_asked_one_by_one(a_trial: Callable[..., Trial]) -> None:
    """Each form of each effect counts by itself, and none among the library's first forms."""

    def trial(effect_id: str, form: str, named: str) -> Trial:
        """Return a trial in which a form of an effect acts, and a name was given."""
        effect = {"id": effect_id, "slot": "contact", "form": form}
        return a_trial(kind="form", effects=[effect], named=[named], visible_each=[1e4])

    trials = [
        trial("adhesion", "dmt", "adhesion"),
        trial("clipping", "tanh", "clipping"),
        trial("clipping", "tanh", "echo"),
    ]
    asked = {a.question: a for a in answers(trials)}
    assert asked["forms left out: right name or family"].value == 2 / 3
    assert asked["- clipping, tanh"].value == 0.5
    assert asked["- adhesion, dmt"].value == 1.0
    assert "library: right name or family" not in asked
