"""The line beside the opened seal: right, or how it was not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from impactd.demo.judgement import judge, truth_line

Make = Callable[..., dict[str, Any]]
THICK, ECHO, ALIEN = "finite_thickness", "echo", "x_sphere_spin"


def hidden(*names: str, slot: str = "contact") -> list[dict[str, Any]]:
    """Return effects as the simulated rig seals them."""
    return [{"id": n, "slot": slot, "parameters": {"size_m": 2.0}, "scope": {}} for n in names]


@pytest.mark.parametrize(
    ("verdict", "named", "acting", "word"),
    [
        ("adequate", (), (), "RIGHT"),
        ("adequate", (), (THICK,), "NOT FOUND"),
        ("identified", (THICK,), (), "WRONG"),
        ("unknown", (), (), "WRONG"),
        ("identified", (THICK,), (THICK,), "RIGHT"),
        ("partial", (THICK,), (THICK,), "PARTLY RIGHT"),
        ("identified", (ECHO,), (THICK,), "WRONG"),
        ("identified", (ECHO,), (ALIEN,), "WRONG"),
        ("identified", (THICK,), (THICK, ECHO), "PARTLY RIGHT"),
        ("identified", (THICK, ECHO), (THICK,), "PARTLY RIGHT"),
        ("identified", (THICK, ECHO), (ECHO, THICK), "RIGHT"),
        ("unknown", (), (ALIEN,), "RIGHT"),
        ("unknown", (), (THICK,), "NOT FOUND"),
        ("partial", (ECHO,), (ALIEN,), "PARTLY RIGHT"),
        ("partial", (ECHO,), (THICK,), "WRONG"),
        ("not_identifiable", (), (THICK,), "NOT FOUND"),
    ],
)
def test_a_verdict_is_judged_by_what_acted(
    diagnosis_of: Make, verdict: str, named: tuple[str, ...], acting: tuple[str, ...], word: str
) -> None:
    """A false name is wrong, a right abstention is right, a missed effect is said to be missed."""
    judgement = judge(diagnosis_of(verdict, named), hidden(*acting))
    assert judgement.word == word
    for name in (*named, *acting):
        assert (
            name in judgement.sentence or verdict in ("unknown", "not_identifiable") or not acting
        )


def test_a_family_is_right_when_the_truth_is_in_it(diagnosis_of: Make) -> None:
    """What the drops could not tell apart counts as found, whoever was put first."""
    found = diagnosis_of("family", (ECHO,))
    found["effects"][0]["confusable_with"] = [THICK]
    assert judge(found, hidden(THICK)).word == "RIGHT"
    assert judge(found, hidden("clipping")).word == "WRONG"


def test_an_unknown_in_the_wrong_slot_is_not_praised(diagnosis_of: Make) -> None:
    """The right answer "unknown" with a wrong place is right in part only."""
    judgement = judge(diagnosis_of("unknown", slot="sensor"), hidden(ALIEN))
    assert judgement.word == "PARTLY RIGHT"
    assert "sensor" in judgement.sentence
    assert "contact" in judgement.sentence


def test_the_truth_is_told_with_its_numbers_and_where_it_acts() -> None:
    """Id, slot, numbers, materials, and whether the library has it at all."""
    (effect,) = hidden(ALIEN)
    line = truth_line({**effect, "scope": {"surface": "specimen"}})
    for said in (ALIEN, "contact", "size_m = 2", "specimen only", "library does not have it"):
        assert said in line
    several = truth_line({**effect, "scope": {"surface": ["aluminium", "specimen"]}})
    assert "acts on aluminium and specimen only" in several
