"""A search on a part of the shots: its names stand on all of them, beside what only all show."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.diagnosis import search_on_part
from analysis.diagnosis.base_choice import fitted_base
from analysis.diagnosis.forward_selection import searched
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.diagnosis.progress import Watch
from analysis.diagnosis.search_on_part import searched_on_part
from analysis.diagnosis.successive_halving import MORE
from drivers.simulated.effects import make_effect
from tests.analysis.diagnosis.test_mistakes import campaign

BASE = {"frequency_hz": 4e3, "damping_ratio": 0.05, "base_mass_kg": 3.0}


@pytest.fixture(scope="module")
def leaky(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """54 shots through a coupler that forgets within 5 ms."""
    effect = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    return diagnose_campaign(campaign(tmp_path_factory.mktemp("leaky"), effect))


def test_names_are_searched_for_on_a_part_and_stand_on_all_shots(leaky: Diagnosis) -> None:
    """The models of the verdict are of all shots; the candidates that lost, of the part."""
    assert (leaky.verdict, leaky.effect_ids) == ("identified", ["coupler_highpass"])
    assert [len(step.problem.shots) for step in leaky.steps] == [54, 54]
    others = [r for r in leaky.steps[0].refits if r.effect_id != "coupler_highpass"]
    assert others
    assert max(len(r.problem.shots) for r in others) <= MORE
    assert not any(r.on_all_shots for r in others)


def test_what_is_close_on_the_part_is_compared_on_all_shots(tmp_path: Path) -> None:
    """A base that gives and a mode of the coupon are one motion where the base is stiff."""
    effect = make_effect("base_compliance", BASE)
    found = diagnose_campaign(campaign(tmp_path, effect))
    near = [r for r in found.steps[0].refits if r.on_all_shots]
    assert found.verdict in ("identified", "family")
    assert set(found.confusable) <= {r.effect_id for r in near}


@pytest.mark.slow
@pytest.mark.parametrize("curvature_per_v", [3e-5, 5e-5])
def test_what_only_all_shots_show_is_added_there(curvature_per_v: float, tmp_path: Path) -> None:
    """A strong effect is named on the part; a weak one is noise there, or too little for a name."""
    strong = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    weak = make_effect("sensor_nonlinearity", {"curvature_per_v": curvature_per_v})
    selection, usual = fitted_base(campaign(tmp_path, strong, weak), "kv2", Watch())
    found = searched_on_part(selection, usual, Watch())
    assert found.adequate
    assert [taken.effect_id for taken in found.chosen] == ["coupler_highpass", weak.id]
    assert all(len(step.problem.shots) == 54 for step in found.steps)


@pytest.mark.slow
def test_where_a_part_shows_too_little_all_shots_are_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is small in nine shots is searched for on all of them."""
    weak = make_effect("coupler_highpass", {"time_constant_s": 0.3})
    selection, usual = fitted_base(campaign(tmp_path, weak), "kv2", Watch())
    asked: list[int] = []

    def noted(start, *rest):
        """Note how many shots are searched."""
        asked.append(len(start.last.problem.shots))
        return searched(start, *rest)

    monkeypatch.setattr(search_on_part, "searched", noted)
    searched_on_part(selection, usual, Watch())
    assert asked == [54]
