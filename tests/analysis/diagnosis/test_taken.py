"""What the selection put in another's place has its line among the candidates, too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from analysis.diagnosis.document.diagnosis_json import _with_the_taken
from analysis.diagnosis.document.wording import taken_in


def refit(form: str) -> Any:
    """Return a refitted candidate."""
    return SimpleNamespace(effect=SimpleNamespace(id=form), scope="rig")


def turn(*refits: Any) -> Any:
    """Return a turn of the selection that tried these."""
    return SimpleNamespace(refits=list(refits))


def test_a_turn_took_the_candidate_that_was_chosen():
    """Nothing is added where the chosen one was among those tried."""
    echo, filtered = refit("echo"), refit("amplifier_lowpass")
    first, last = turn(echo, filtered), turn()
    diagnosis: Any = SimpleNamespace(chosen=[filtered], steps=[first, last])
    assert taken_in(diagnosis, first) is filtered
    assert taken_in(diagnosis, last) is None
    assert _with_the_taken(first, filtered) == [echo, filtered]


def test_what_took_another_s_place_leads_the_turn_that_it_extends():
    """A named effect is never called "not tried"; its own earlier fit gives way to it."""
    echo, early, late = refit("echo"), refit("coupler_highpass"), refit("coupler_highpass")
    first, last = turn(echo, early), turn()
    diagnosis: Any = SimpleNamespace(chosen=[late], steps=[first, last])
    assert taken_in(diagnosis, first) is late
    assert taken_in(diagnosis, last) is None
    assert _with_the_taken(first, late) == [late, echo]
