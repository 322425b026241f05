"""What to do with a shot, and why, in words."""

from __future__ import annotations

import inspect
import re
from types import SimpleNamespace

from analysis.fit.result import FitResult
from analysis.fit.shot_fit import ShotFit
from impactd.advice import SENTENCES, advice, in_words
from impactd.console.fits import report
from impactd.console.shots import advice_words
from impactd.jobs import rebound


def _shot(*, clipped: bool = False):
    return SimpleNamespace(clipped=clipped)


def _fit(*flags: str, model: str = "kv", status: str = "converged"):
    return SimpleNamespace(model=model, result={"flags": flags, "outcome": {"status": status}})


def test_every_flag_that_a_fit_can_raise_has_a_sentence():
    """No short code reaches the person at the rig."""
    sources = [inspect.getsource(one) for one in (FitResult.flags, ShotFit.flags)]
    raised = set(re.findall(r'append\("(\w+)"\)', "".join(sources)))
    raised |= set(re.findall(r'"flags": \["(\w+)"\]', inspect.getsource(rebound)))
    assert len(raised) > 8
    assert raised <= set(SENTENCES)
    assert all(text.endswith(".") and "_" not in text for text in SENTENCES.values())


def test_a_word_that_nobody_knows_is_shown_as_it_is():
    """A newer worker's flag is not hidden."""
    assert in_words("something_new") == "something new."


def test_a_shot_without_a_fit_gets_no_advice_unless_it_is_clipped():
    """Nobody has looked at it yet; a clipped record needs no look."""
    assert advice(_shot(), []) == (None, [])
    assert advice(_shot(clipped=True), []) == ("repeat", ["clipped"])


def test_the_fit_with_a_cell_that_moves_speaks_for_the_shot():
    """HSD's own warning is no reason against a shot that KV fits."""
    both = [_fit("rigid_cell_model", model="hsd"), _fit()]
    assert advice(_shot(), both) == ("use", [])
    assert advice(_shot(), both[:1]) == ("check", ["rigid_cell_model"])


def test_an_ending_is_told_once():
    """Where the flags already say that the fit did not settle."""
    fit = _fit("not_converged", status="not_converged")
    assert advice(_shot(), [fit]) == ("check", ["not_converged"])


def test_the_command_line_says_the_reasons_on_lines_of_their_own():
    """The daemon's sentences follow the word; `use` stands alone."""
    because = [in_words("clipped")]
    assert advice_words({"advice": "repeat", "because": because}).splitlines() == [
        "Advice: repeat, because",
        f"  - {because[0]}",
    ]
    assert advice_words({"advice": "use", "because": []}) == "Advice: use"


def test_a_fit_offline_warns_in_the_same_words():
    """What the JSON flags, the table says; what the message said is not said again."""
    outcome = {"status": "not_converged", "message": "It went astray."}
    flags = ["not_converged", "references_contradicted"]
    told = report({"model": "kv", "outcome": outcome, "flags": flags})
    assert SENTENCES["references_contradicted"] in told
    assert SENTENCES["not_converged"] not in told


def test_a_fit_of_several_hits_says_which_of_them_warn():
    """First of all, with their number and the first names; what all of it says is not repeated."""
    outcome = {"status": "converged", "message": "The fit converged."}
    wrong = {"flags": ["residual_above_noise", "restitution_disagrees"]}
    shots = [{"name": f"drop-{number}", **wrong, "pair": "a/b"} for number in range(5)]
    shots.append({"name": "drop-5", "flags": [], "pair": "a/b"})
    document = {"model": "kv", "outcome": outcome, "flags": ["residual_above_noise"]}
    told = " ".join(report({**document, "shots": shots}).split())
    assert told.startswith("Model kv: The fit converged. Mind that")
    which = "5 of 6 hits (drop-0, drop-1, drop-2, drop-3, ...)"
    assert f"{which}: {SENTENCES['restitution_disagrees']}" in told
    assert told.count(SENTENCES["residual_above_noise"]) == 1
    alone = report({**document, "shots": shots[:1]})
    assert "drop-0: the bounce" in alone
