"""On which materials an effect acts: few sets are asked, and the choice among them is paid for."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from analysis.diagnosis.basis.groupings import Sizes, groups, price_of_choice
from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.acts_on import ActsOn

NAMES = ("a", "b", "c", "d", "e", "f")


def sizes(values: np.ndarray, information: np.ndarray) -> Sizes:
    """Return sizes on the surfaces a, b, c, ..."""
    return Sizes("surface", NAMES[: len(values)], values, information)


def all_sets(count: int) -> list[ActsOn]:
    """Return every choice of some of so many materials."""
    names = NAMES[:count]
    return [ActsOn("surface", s) for k in range(1, count) for s in combinations(names, k)]


@pytest.mark.parametrize("acting", [("b",), ("a", "d"), ("a", "c", "d", "f"), tuple("bcdef")])
def test_the_materials_that_feel_it_come_first(acting: tuple[str, ...]) -> None:
    """One size on some materials and none on the others, seen through noise and few shots."""
    rng = np.random.default_rng(4)
    known = np.diag(rng.uniform(50.0, 5000.0, len(NAMES)))
    values = np.array([float(n in acting) for n in NAMES]) + rng.standard_normal(
        len(NAMES)
    ) / np.sqrt(np.diag(known))
    found = sizes(values, known).candidates()
    assert found[0] == ActsOn("surface", acting)
    assert len(found) <= 2 * (len(NAMES) - 1)


def test_each_of_some_has_a_size_of_its_own() -> None:
    """Two materials of unlike size, and one whose small size is not worth a number."""
    known = np.diag([900.0, 400.0, 100.0, 100.0])
    found, worth = sizes(np.array([1.0, 2.0, 0.2, 0.0]), known).needing_own_size(12.0)
    assert found == ActsOn("surface", ("a", "b"))
    assert worth == pytest.approx(900.0 + 1600.0 - 2 * 12.0 - price_of_choice(2, 4))
    every, worth = sizes(np.array([1.0, 2.0, 1.0]), known[:3, :3]).needing_own_size(12.0)
    assert every is None
    assert worth == pytest.approx(900.0 + 1600.0 + 100.0 - 3 * 12.0)


def test_no_set_beyond_the_candidates_explains_more() -> None:
    """Where materials inform independently, the best of all sets of a number is a candidate."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        some = sizes(rng.standard_normal(6), np.diag(rng.uniform(0.1, 10.0, 6)))
        sets = [*all_sets(6), ActsOn("surface", NAMES)]
        best = max(sets, key=lambda only: some.common(only.names)[1])
        assert best.names == NAMES or best in some.candidates()


def test_a_set_and_its_complement_are_both_asked() -> None:
    """What acts on all but one is a candidate like what acts on that one."""
    found = sizes(np.array([1.0, -1.0, 0.9]), np.eye(3)).candidates()
    assert {ActsOn("surface", ("b",)), ActsOn("surface", ("a", "c"))} <= set(found)
    above = sizes(np.array([1.0, -1.0, 0.9]), np.eye(3)).candidates(either_sign=False)
    assert ActsOn("surface", ("b",)) not in above


def test_what_the_data_leave_open_asks_for_nothing() -> None:
    """A material without information gets no size, and no infinite one."""
    some = Sizes.from_score(
        "sphere", ("a", "b"), np.array([2.0, 0.0]), np.array([[4.0, 0.0], [0.0, 0.0]])
    )
    assert some.values == pytest.approx([0.5, 0.0])
    assert some.common(("b",)) == (0.0, 0.0)


def test_a_choice_costs_what_it_could_have_been() -> None:
    """The priors of all sets of some materials add up to that of the rig's one grouping."""
    for present in range(2, 7):
        total = sum(
            math.exp(-0.5 * price_of_choice(len(only.names), present)) for only in all_sets(present)
        )
        assert total == pytest.approx(1.0)
    assert price_of_choice(3, 3) == 0.0


def test_noise_prefers_no_set() -> None:
    """An effect on all materials is hardly ever taken for one on some, however faint it is."""
    rng = np.random.default_rng(6)
    for size in (0.0, 3.0, 10.0):
        taken = 0
        for _ in range(2000):
            known = np.diag(rng.uniform(0.5, 2.0, 4))
            values = size + rng.standard_normal(4) / np.sqrt(np.diag(known))
            some = sizes(values, known)
            lead = some.promise(some.candidates()[0]) - some.common(some.names)[1]
            taken += lead > CRITERIA.least_lead
        assert taken / 2000 < 1e-3


def test_words_say_the_shorter_of_a_set_and_its_complement() -> None:
    """Several by name, nearly all by what is left out."""
    present = ("a", "b", "c", "d")
    assert ActsOn("surface", ("b",)).words(present) == "on the surface b"
    assert ActsOn("sphere", ("c", "a")).words(present) == "on the spheres a and c"
    assert ActsOn("surface", ("a", "b", "d")).words(present) == "on all surfaces but c"
    said = ActsOn("surface", ("b", "a"))
    assert ActsOn.from_json(said.to_json()) == said
    with pytest.raises(ValueError, match="acts on surfaces or spheres"):
        ActsOn("pair", ("a",))


def test_groups_with_a_speed_have_a_second_coefficient_that_sums_to_little(clean):
    """It stands for the change with the logarithm of the speed, from the usual one on."""
    problem = clean.steps[0].problem
    found = groups(problem, "pair speed")
    assert {len(own) for own in found} == {2}
    for own, item in zip(found, problem.shots, strict=True):
        assert own[0] == (item.pair, 1.0)
        assert abs(own[1][1]) < 1.0


def test_a_drift_has_a_trend_from_minus_one_to_one(clean):
    """Whatever the number of shots."""
    found = groups(clean.steps[0].problem, "drift")
    assert dict(found[0])["trend"] == -1.0
    assert dict(found[-1])["trend"] == 1.0
