"""A budget ends a search in order: the best so far, never sharper than what was compared."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import pytest

from analysis.campaign import Campaign
from analysis.diagnosing import diagnose
from analysis.diagnosis.backward_elimination import not_held_against
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.forward_selection import best_reached
from analysis.diagnosis.procedure import Diagnosis, _judge, _standing
from analysis.diagnosis.progress import BudgetSpentError, MethodStep, TimeBudget, Watch, each_step
from analysis.diagnosis.selection import Selection
from analysis.errors import ParameterOutOfRangeError

from .conftest import small_campaign

METHOD = Path(__file__).parents[3] / "analysis" / "diagnosis" / "METHOD.md"
BUDGET_S = 10.0


class Clock:
    """A clock that stands still until it is set."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        """Return the time. [s]"""
        return self.now_s


@pytest.fixture(scope="module")
def leaking(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Eight shots through a coupler that forgets within 5 ms."""
    folder = tmp_path_factory.mktemp("leaking")
    return small_campaign(folder, "coupler_highpass", time_constant_s=5e-3)


def diagnosed_until(campaign: Campaign, words: str, times: int = 1) -> dict[str, Any]:
    """Return a diagnosis whose time is over when it says some words for the n-th time."""
    clock = Clock()
    heard = 0

    def progress(text: str, share: float) -> None:
        nonlocal heard
        del share
        heard += words in text
        if heard == times:
            clock.now_s = 100.0 + BUDGET_S + 2.5

    return diagnose(campaign, progress=progress, budget=TimeBudget(BUDGET_S, clock))


@pytest.mark.parametrize("seconds", [0.0, -3.0, math.nan, math.inf])
def test_a_budget_is_a_positive_number_of_seconds(seconds: float) -> None:
    """Anything else is refused with its value."""
    with pytest.raises(ParameterOutOfRangeError, match=re.escape(repr(seconds))):
        TimeBudget(seconds, Clock())


def test_a_watch_ends_a_search_once_its_time_is_over_and_says_at_what() -> None:
    """Until then nothing happens; from then on every fit ends, and the first moment is kept."""
    clock, told = Clock(), []
    watch = Watch(lambda text, share: told.append((text, share)), TimeBudget(BUDGET_S, clock))
    watch("Candidates (4 of 9): trying echo", 0.5)
    clock.now_s += BUDGET_S - 1e-6
    watch.check()
    assert watch.ended is None
    clock.now_s += 1.0
    for _ in range(2):
        with pytest.raises(BudgetSpentError):
            watch.check()
        clock.now_s += 1.0
        watch("Verdict (7 of 9): where does it live?", 0.0)
    assert watch.ended is not None
    assert watch.ended.to_json() == {
        "budget_s": BUDGET_S,
        "after_s": pytest.approx(BUDGET_S + 1.0),
        "doing": "Candidates (4 of 9): trying echo",
        "verdict_stands": False,
    }
    assert "after 11 s of search, which had not ended: it was at" in watch.ended.sentence
    assert len(told) == 3


def test_without_a_budget_nothing_is_ended() -> None:
    """A watch alone only passes on."""
    watch = Watch()
    watch("anything", 0.0)
    watch.check()
    assert watch.ended is None


def test_the_steps_are_those_of_the_method() -> None:
    """Whoever reads a step's name finds it, and its place, in METHOD.md."""
    titles = re.findall(r"^\*\*(\d)\. (.+?)\*\*", METHOD.read_text(encoding="utf-8"), re.M)
    assert [name.rstrip(".") for _, name in titles] == [step.value for step in MethodStep]
    assert MethodStep.CANDIDATES.told("trying echo") == "Candidates (4 of 9): trying echo"


def test_a_step_is_told_once_for_all_that_it_does() -> None:
    """Only the first words of each step are passed on."""
    told: list[str] = []
    progress = each_step(told.append)
    for step, what in (
        (MethodStep.BASE_FIT, "kv2"),
        (MethodStep.CANDIDATES, "trying echo"),
        (MethodStep.CANDIDATES, "trying mains_hum"),
        (MethodStep.VERDICT, "where?"),
    ):
        progress(step.told(what), 0.1)
    assert told == ["Base fit (2 of 9): kv2", "Candidates (4 of 9): trying echo",
                    "Verdict (7 of 9): where?"]  # fmt: skip


def test_a_step_is_never_told_after_a_later_one() -> None:
    """A search returns to earlier questions: they belong to the step that it has come to."""
    told: list[str] = []
    watch = Watch(lambda text, share: told.append(text))
    for step in (MethodStep.CANDIDATES, MethodStep.ON_TOP, MethodStep.COMPARE, MethodStep.VERDICT):
        watch(step.told("trying echo"), 0.5)
    assert [text.partition(": ")[0] for text in told] == [
        "Candidates (4 of 9)", "Another effect on top? (6 of 9)",
        "Another effect on top? (6 of 9)", "Verdict (7 of 9)",
    ]  # fmt: skip


def test_less_time_than_the_base_fit_takes_still_gives_a_document(leaking: Campaign) -> None:
    """The base fit is made, and where its residual lives; nothing is named, no modulus stated."""
    found = diagnosed_until(leaking, MethodStep.NOISE.heading)
    assert found["verdict"] == "unknown"
    assert found["effects"] == []
    assert "electronics" in {found["slot"], *found["also_possible_slots"]}
    assert found["ended_early"]["after_s"] == pytest.approx(BUDGET_S + 2.5)
    assert "best verdict after 12.5 s of search, which had not ended" in found["sentence"]
    assert found["before"]["chi2_per_dof"] > 2
    assert found["after"]["moduli"]["specimen"]["status"] == "withheld"
    assert found["before"]["heldout_rms_V"] is None
    whys = {line["why_not"] for line in found["candidates"]}
    assert "not tried before the time was over" in whys


def test_a_clean_campaign_needs_no_search_to_be_adequate(tmp_path: Path) -> None:
    """Only the errors on held-out shots are missing, and the document says that and no more."""
    found = diagnosed_until(small_campaign(tmp_path), MethodStep.NOISE.heading)
    assert found["verdict"] == "adequate"
    assert found["ended_early"]["verdict_stands"] is True
    assert "the verdict stands" in found["sentence"]


def test_a_name_that_was_not_held_against_others_is_one_of_a_family(leaky: Diagnosis) -> None:
    """Noise is left, but nobody compared: whoever could do the same stands beside it."""
    first = dataclasses.replace(leaky.steps[0], refits=leaky.steps[0].refits[:1], unfinished=True)
    watch = Watch(budget=TimeBudget(BUDGET_S, iter(range(0, 1000, 100)).__next__))
    with pytest.raises(BudgetSpentError):
        watch.check()
    selection = Selection([first, *leaky.steps[1:]], leaky.chosen)
    found = _judge(selection, Selection([first], []), first.fitted, watch)
    assert found.verdict == "family"
    assert "amplifier_lowpass" in found.confusable_with("coupler_highpass")
    told = diagnosis_json(dataclasses.replace(found, watch=watch), software="impactd test")
    assert "coupler_highpass was not compared with" in told["sentence"]
    assert told["effects"][0]["confusable_with"] == found.confusable_with("coupler_highpass")
    assert told["after"]["moduli"]["specimen"]["status"] == "withheld"


def test_a_whole_search_leaves_no_name_uncompared(leaky: Diagnosis) -> None:
    """What was compared and fell short is not listed again."""
    assert not_held_against(Selection(leaky.steps, leaky.chosen)) == {}


def test_what_was_fitted_to_all_shots_is_not_lost(leaky: Diagnosis) -> None:
    """The best refit of an unfinished comparison carries the selection on."""
    start = Selection(leaky.steps[:1], [])
    reached = best_reached(start, [])
    assert [taken.effect_id for taken in reached.chosen] == ["coupler_highpass"]
    assert reached.adequate


def test_a_finished_trail_stands_before_a_refit_that_explains_half(leaky: Diagnosis) -> None:
    """A refit counts with the gain it has on these shots."""
    whole = Selection(leaky.steps, leaky.chosen)
    half = dataclasses.replace(leaky.chosen[0], gain=leaky.chosen[0].gain / 2.0)
    start = Selection([dataclasses.replace(leaky.steps[0], refits=[half])], [])
    assert best_reached(start, [whole]) is whole


def test_nothing_is_far_ahead_of_names_that_were_not_tried(leaky: Diagnosis) -> None:
    """A name beside which structure remains needs a whole comparison to be found in part."""
    assert _standing(leaky.steps, leaky.chosen) == 1
    first = dataclasses.replace(leaky.steps[0], unfinished=True)
    assert _standing([first, *leaky.steps[1:]], leaky.chosen) == 0


@pytest.mark.parametrize(
    ("words", "times"),
    [
        ("one material make the difference", 1),
        ("trying", 3),
        ("on all shots", 1),
        pytest.param("forms and groupings", 1, marks=pytest.mark.slow),
        pytest.param("holding every name", 1, marks=pytest.mark.slow),
    ],
)
def test_wherever_it_ends_it_says_no_more_than_it_compared(
    leaking: Campaign, words: str, times: int
) -> None:
    """Early there is no name; later one with all that it was not held against; one alone last."""
    found = diagnosed_until(leaking, words, times)
    ended = found["ended_early"]
    assert ended is not None
    named = [effect["id"] for effect in found["effects"]]
    if found["verdict"] == "identified":
        assert named == ["coupler_highpass"]
        assert not ended["doing"].startswith(MethodStep.CANDIDATES.heading)
    elif found["verdict"] == "family":
        assert named == ["coupler_highpass"]
        assert found["effects"][0]["confusable_with"]
        assert found["remaining"]["structured"] is False
    else:
        assert (found["verdict"], named) == ("unknown", [])
        assert found["after"]["moduli"]["specimen"]["status"] == "withheld"


def test_a_budget_that_suffices_changes_nothing(leaking: Campaign, leaky: Diagnosis) -> None:
    """The same verdict and numbers as without one, and nothing was ended."""
    found = diagnosed_until(leaking, "never said")
    assert found["ended_early"] is None
    assert found["verdict"] == leaky.verdict == "identified"
    without = diagnosis_json(leaky, software="analysis")
    assert found["effects"] == without["effects"]
    assert without["ended_early"] is None
