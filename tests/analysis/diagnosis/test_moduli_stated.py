"""Which moduli a diagnosis states: those of a model that leaves noise, whoever is its true name.

Where shots contradict a statement, it says who it is, and which moduli are stated all the same.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.document.diagnosis_json import _block, _provisos, diagnosis_json
from analysis.diagnosis.document.moduli_stated import (
    family_members,
    is_noise_without_statements,
    widen_over_family,
    withhold_sought,
)
from analysis.diagnosis.held_out import as_fit_result
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.diagnosis.progress import TimeBudget, Watch
from analysis.diagnosis.selection import Step
from analysis.fit.freed_inputs import inputs_freed
from analysis.fit.result import FitResult

from .conftest import small_campaign

PLANE = "plane_strain_modulus_Pa"


def _second(leaky: Diagnosis) -> Refit:
    """Return the best fit to the leaky campaign by another effect than the coupler's."""
    return next(r for r in leaky.steps[0].refits if r.usable and r.effect_id != "coupler_highpass")


@pytest.fixture(scope="module")
def half(leaky: Diagnosis) -> Diagnosis:
    """A diagnosis that stops at an effect which leaves structure."""
    first, second = leaky.steps[0], _second(leaky)
    step = Step(second.problem, second.fitted)
    assert step.score_test.structured
    return Diagnosis("partial", [first, step], [second], slot=second.effect.slot)


def test_a_model_that_leaves_structure_states_no_modulus_that_was_sought(half: Diagnosis) -> None:
    """Before and after, with pairs, budget and parameters; references stand as stated."""
    found = diagnosis_json(half, software="impactd test")
    for block in (found["before"], found["after"]):
        specimen = block["moduli"]["specimen"]
        assert specimen["status"] == "withheld"
        assert specimen[PLANE] is specimen["youngs_modulus_Pa"] is None
        assert block["budget"] is None
        assert "surface.specimen" not in block["parameters"]
        assert all("reduced_modulus_Pa" not in pair for pair in block["pairs"].values())
        stated = half.steps[0].problem.campaign.spheres["acetal"].youngs_modulus_pa
        assert stated is not None
        acetal = block["moduli"]["acetal"]
        assert acetal["status"] == "reference"
        assert acetal["youngs_modulus_Pa"]["value"] == stated.value
    assert found["accepted_model"] is None
    assert "The modulus of specimen is withheld" in found["sentence"]
    assert found["after"]["parameters"]  # the cell's and the effect's own
    (effect,) = found["effects"]
    for name, number in effect["parameters"].items():
        assert number == found["after"]["parameters"][f"{effect['id']}.{name}"]
        assert number["value"] is not None
        assert number["u"] is None


def test_a_model_that_leaves_noise_states_its_modulus(leaky: Diagnosis) -> None:
    """An identified effect's model is handed on, with modulus and budget."""
    found = diagnosis_json(leaky, software="impactd test")
    assert found["after"]["moduli"]["specimen"]["status"] == "fitted"
    assert found["accepted_model"] is not None


def test_a_disturbed_line_withholds_moduli_too(tmp_path: Path) -> None:
    """Spikes that no impact causes reach into the windows, and nobody knows what they move."""
    campaign = small_campaign(tmp_path, "x_glitches", amplitude_v=0.1, rate_hz=2000.0)
    found = diagnosis_json(diagnose_campaign(campaign), software="impactd test")
    assert found["verdict"] == "unknown"
    assert found["closure"] is None
    for block in (found["before"], found["after"]):
        assert block["moduli"]["specimen"]["status"] == "withheld"


@pytest.fixture(scope="module")
def family(leaky: Diagnosis) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The block of a family, and what each of its members says by itself."""
    second = _second(leaky)
    taken = leaky.chosen[0]
    near = dataclasses.replace(leaky, verdict="family", rivals={taken.effect_id: [second]})
    last = leaky.steps[-1]
    after = inputs_freed(as_fit_result(last.problem, last.fitted, heldout=False))
    both = family_members(near, after)
    # as if both left alike, which no two effects of a test of seconds do
    alike = [dataclasses.replace(one, squares=0.0) for one in both]
    block = _block(after)
    widen_over_family(block, alike)
    return block, [one.result.moduli() for one in both]


def test_a_familys_interval_holds_whichever_name_is_true(
    family: tuple[dict[str, Any], list[dict[str, Any]]],
) -> None:
    """It reaches to the ends of every member's own, for moduli and pairs alike."""
    block, own = family
    for name, entry in block["moduli"].items():
        low, high = entry[PLANE]["interval95"]
        for one in own:
            least, most = one[name][PLANE]["interval95"]
            assert low <= least * (1 + 1e-9)
            assert high >= most * (1 - 1e-9)
    values = [one["specimen"][PLANE]["value"] for one in own]
    assert block["moduli"]["specimen"][PLANE]["value"] == pytest.approx(
        math.sqrt(math.prod(values))
    )
    pair = block["pairs"]["acetal/specimen"]["reduced_modulus_Pa"]
    assert pair["u"] / pair["value"] > 1e-3
    of_parameter = block["parameters"]["surface.specimen"]
    assert of_parameter["u"] == pytest.approx(block["moduli"]["specimen"][PLANE]["u"])


def test_a_familys_budget_accounts_for_the_open_name(
    family: tuple[dict[str, Any], list[dict[str, Any]]],
) -> None:
    """The squares of the contributions still add up, with a row for not knowing the name."""
    block, _ = family
    for key in (PLANE, "youngs_modulus_Pa"):
        budget = block["budget"]["moduli"]["specimen"][key]
        stated = block["moduli"]["specimen"][key]
        assert budget["u"] == pytest.approx(stated["u"])
        total = sum(row["contribution"] ** 2 for row in budget["rows"])
        assert total == pytest.approx((stated["u"] / stated["value"]) ** 2)
        assert sum(row["share"] for row in budget["rows"]) == pytest.approx(1.0)
        assert any(row["input"] == "names" for row in budget["rows"])


def test_a_member_of_little_evidence_moves_the_value_little(leaky: Diagnosis) -> None:
    """Ten thousand squares behind, a rival widens the interval and leaves the value."""
    taken = leaky.chosen[0]
    near = dataclasses.replace(leaky, verdict="family", rivals={taken.effect_id: [_second(leaky)]})
    last = leaky.steps[-1]
    after = inputs_freed(as_fit_result(last.problem, last.fitted, heldout=False))
    block = _block(after)
    alone = block["moduli"]["specimen"][PLANE]["value"]
    widen_over_family(block, family_members(near, after))
    assert block["moduli"]["specimen"][PLANE]["value"] == pytest.approx(alone, rel=1e-9)


def _explained(result: FitResult) -> bool:
    return is_noise_without_statements(result.problem, result)


def _withheld(result: FitResult) -> dict[str, Any]:
    """Return the specimen's modulus of a fit that leaves structure."""
    block = _block(result)
    withhold_sought(block, result, explained=_explained(result))
    specimen: dict[str, Any] = block["moduli"]["specimen"]
    return specimen


def _misstated(made: tuple[Any, Campaign], relative_u: float) -> Campaign:
    """Return a campaign of spheres known so well, whose polycarbonate is stated 40 % too high."""
    rig, campaign = made
    spheres = {
        n: dataclasses.replace(
            s,
            youngs_modulus_pa=Quantity(rig.moduli[n][0], relative_u * rig.moduli[n][0]),
            poissons_ratio=Quantity(rig.moduli[n][1], relative_u),
        )
        for n, s in campaign.spheres.items()
    }
    coupon = campaign.surfaces["polycarbonate"]
    said = coupon.youngs_modulus_pa
    assert said is not None
    wrong = dataclasses.replace(coupon, youngs_modulus_pa=Quantity(1.4 * said.value, 1.4 * said.u))
    surfaces = campaign.surfaces | {"polycarbonate": wrong}
    return dataclasses.replace(campaign, spheres=spheres, surfaces=surfaces)


@pytest.fixture(scope="module")
def contradicted(made: tuple[Any, Campaign]) -> FitResult:
    """A sound model of records that contradict one statement; the others are far better known."""
    return fit_campaign(_misstated(made, 1e-4), "kv")


@pytest.fixture(scope="module")
def resting(made: tuple[Any, Campaign]) -> FitResult:
    """The same with spheres that are known no better than usual: moduli lean on the culprit."""
    return fit_campaign(_misstated(made, 2e-2), "kv", heldout=False)


def test_a_modulus_that_does_not_rest_on_the_culprit_is_stated(
    contradicted: FitResult, made: tuple[Any, Campaign]
) -> None:
    """What stays when the culprit is left out is stated, with an interval about the truth."""
    assert contradicted.explained_by_a_statement
    specimen = _withheld(contradicted)
    assert specimen["status"] == "fitted"
    assert specimen["without_conflicts"]["stable"]
    low, high = specimen["youngs_modulus_Pa"]["interval95"]
    assert low <= made[0].moduli["specimen"][0] <= high


def test_whether_statements_explain_all_is_answered_when_the_time_is_over(
    contradicted: FitResult,
) -> None:
    """The budget ends a search, and never the document."""
    spent = Watch(budget=TimeBudget(1.0, iter(range(0, 10**6, 100)).__next__))
    assert is_noise_without_statements(spent.over(contradicted.problem), contradicted)


def test_where_nobody_asked_on_what_a_modulus_rests_it_is_withheld(contradicted: FitResult) -> None:
    """Without the time for a fit without the culprit nothing is stated beside a contradiction."""
    cut_short = dataclasses.replace(contradicted, statements_asked=False)
    specimen = cut_short.moduli()["specimen"]
    assert specimen["status"] == "withheld"
    assert "surfaces.polycarbonate.youngs_modulus_Pa" in specimen["reason"]
    assert not cut_short.explained_by_a_statement


def test_the_sentence_says_who_it_is_and_what_stays(contradicted: FitResult) -> None:
    """The culprit, what the shots say of it, that noise is left without it, and what stays."""
    said = " ".join(_provisos(contradicted, blames=_explained(contradicted)))
    assert "of polycarbonate is" in said
    assert "u from what the shots and all other statements say" in said
    assert "Without it the model leaves only noise." in said
    assert "specimen hardly moves without it" in said


def test_a_modulus_that_rests_on_the_culprit_is_withheld(
    resting: FitResult, made: tuple[Any, Campaign]
) -> None:
    """With the culprit it would be wrong by many u: it is withheld, and says on what it rests."""
    specimen = resting.moduli()["specimen"]
    assert specimen["status"] == "withheld"
    assert "surfaces.polycarbonate.youngs_modulus_Pa" in specimen["reason"]
    assert not specimen["without_conflicts"]["stable"]
    low, high = specimen["without_conflicts"]["youngs_modulus_Pa"]["interval95"]
    assert low <= made[0].moduli["specimen"][0] <= high
    assert "specimen rests on it" in resting.to_json()["sentence"]
    assert _withheld(resting)["status"] == "withheld"


def test_where_more_than_the_statement_is_wrong_moduli_are_withheld(
    made: tuple[Any, Campaign],
) -> None:
    """Structure that stays without the culprit may move any modulus, stable or not."""
    wrong = _misstated(made, 1e-4)
    shots = tuple(
        dataclasses.replace(s, signal=s.signal + 0.05 * np.roll(s.signal, 12)) for s in wrong.shots
    )
    found = fit_campaign(dataclasses.replace(wrong, shots=shots), "kv", heldout=False)
    assert not found.explained_by_a_statement
    assert _withheld(found)["status"] == "withheld"
