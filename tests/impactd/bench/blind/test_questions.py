"""What is counted over many trials."""

from __future__ import annotations

from collections.abc import Callable

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
