"""Decisions against limits: the numbers of JCGM 106, draws, and what cannot be decided."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.conformity import RULES, Limits, judge, probability_between
from analysis.errors import AnalysisError
from analysis.written_numbers import K_95


def test_probabilities_are_those_of_jcgm_106() -> None:
    """Its Zener diode conforms with 0.92, its motor oil with 0.66, its Table 1 holds."""
    assert probability_between(-5.47, 0.05, -math.inf, -5.40) == pytest.approx(0.92, abs=5e-3)
    assert probability_between(13.6, 1.8, 12.5, 16.3) == pytest.approx(0.66, abs=5e-3)
    for z, p in ((0.84, 0.80), (1.28, 0.90), (1.64, 0.95), (2.33, 0.99), (3.09, 0.999)):
        assert probability_between(0.0, 1.0, -math.inf, z) == pytest.approx(p, abs=2e-3)
        assert probability_between(0.0, 1.0, -z, math.inf) == pytest.approx(p, abs=2e-3)
    # far outside, where a difference of two ones would be nothing
    assert probability_between(0.0, 1.0, 9.0, 10.0) == pytest.approx(1.13e-19, rel=0.01)
    assert probability_between(2.0, 0.0, 1.0, 2.0) == 1.0


def test_probability_is_the_share_of_draws() -> None:
    """Of 10^6 draws of a modulus as many conform as the probability says."""
    drawn = 2.3e9 * np.exp(0.03 * np.random.default_rng(0).standard_normal(1_000_000))
    found = judge("E", 2.3e9, 0.03, Limits(2.2e9, 2.35e9))
    share = float(np.mean((drawn >= 2.2e9) & (drawn <= 2.35e9)))
    assert found["probability"] == pytest.approx(share, abs=4 * 0.5e-3)
    assert found["decision"] == "undecided"


@pytest.mark.parametrize("truth", [0.98, 1.0, 1.02])
def test_the_guard_band_keeps_wrong_passes_below_its_risk(truth: float) -> None:
    """Of repeated measurements at or beyond the limit at most 2.5 % pass with r = 1."""
    rng, u, limit = np.random.default_rng(1), 0.02, 2.0e9
    seen = truth * limit * np.exp(u * rng.standard_normal(4000))
    decisions = [judge("E", float(y), u, Limits(upper_pa=limit))["decision"] for y in seen]
    passes = decisions.count("pass") / len(decisions)
    # four standard deviations of a share of 0.025 in 4000
    if truth >= 1.0:
        assert passes <= 0.025 + 4 * math.sqrt(0.025 * 0.975 / 4000)
    else:
        assert passes > 0.1


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (2.30e9, ("pass", "pass", "pass", "pass")),
        (2.22e9, ("undecided", "fail", "pass", "pass")),
        (2.18e9, ("undecided", "fail", "pass", "fail")),
        (2.10e9, ("fail", "fail", "fail", "fail")),
    ],
)
def test_each_rule_decides_as_it_says(value: float, expected: tuple[str, ...]) -> None:
    """At least 2.2 GPa was asked, U is 2 %: the rules differ only within the guard band."""
    found = [judge("E", value, 0.02 / K_95, Limits(2.2e9, rule=rule))["decision"] for rule in RULES]
    assert tuple(found) == expected


def test_with_r_of_one_a_pass_is_an_interval_within_the_limits() -> None:
    """The 95 % interval's end at the limit is where a pass begins, and its risk is 2.5 %."""
    u = 0.01
    edge = 2.2e9 * math.exp(K_95 * u)
    inside = judge("E", edge * (1 + 1e-9), u, Limits(2.2e9))
    assert inside["decision"] == "pass"
    assert inside["risk_of_wrong_decision"] == pytest.approx(0.025, rel=1e-3)
    assert judge("E", edge * (1 - 1e-9), u, Limits(2.2e9))["decision"] == "undecided"


def test_sentences_say_what_was_asked_and_what_it_takes() -> None:
    """Limits, guard band and probability stand in one sentence; certainty is never claimed."""
    said = judge("E of pvc", 2.4e9, 0.01, Limits(2.2e9))["sentence"]
    assert said == (
        "E of pvc passes: at least 2.2 GPa was asked, which with a guard band of 1.96 % takes a "
        "value of at least 2.2435 GPa. It conforms with a probability of more than 99.99 %."
    )
    tight = judge("E of pvc", 2.2e9, 0.05, Limits(2.19e9, 2.21e9))["sentence"]
    assert "nothing can pass" in tight
    plain = judge("E of pvc", 2.4e6, 0.01, Limits(upper_pa=2.5e6, rule="simple"))["sentence"]
    assert plain.startswith("E of pvc passes: at most 2.5 MPa was asked. It")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "nothing to decide"),
        ({"lower_pa": 2.2}, "2.2 GPa is 2.2e9"),
        ({"lower_pa": 3e9, "upper_pa": 2e9}, "not below"),
        ({"upper_pa": 2e9, "rule": "kind"}, "both, acceptance, rejection, simple"),
        ({"upper_pa": 2e9, "guard_factor": -1.0}, "0 .. 10"),
        ({"upper_pa": math.nan}, "no modulus"),
    ],
)
def test_limits_that_mean_nothing_are_refused(given: dict, words: str) -> None:
    """A limit in the wrong unit, none at all, or an unknown rule is an error with its remedy."""
    with pytest.raises(AnalysisError, match=words):
        Limits(**given)
