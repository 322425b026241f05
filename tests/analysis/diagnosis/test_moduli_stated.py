"""Which moduli a diagnosis states: those of a model that leaves noise, whoever is its true name."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.document.diagnosis_json import _block, diagnosis_json
from analysis.diagnosis.document.moduli_stated import hold_for_all, members
from analysis.diagnosis.forward_selection import make_step
from analysis.diagnosis.held_out import quality
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.fit.freed_inputs import inputs_freed

from .conftest import small_campaign

PLANE = "plane_strain_modulus_Pa"


def _second(leaky: Diagnosis) -> Refit:
    """Return the best fit to the leaky campaign by another effect than the coupler's."""
    return next(r for r in leaky.steps[0].refits if r.usable and r.effect_id != "coupler_highpass")


@pytest.fixture(scope="module")
def half(leaky: Diagnosis) -> Diagnosis:
    """A diagnosis that stops at an effect which leaves structure."""
    first, second = leaky.steps[0], _second(leaky)
    step = make_step(second.problem, second.fitted)
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
    assert "Withheld is the modulus of specimen" in found["sentence"]
    assert found["after"]["parameters"]  # the cell's and the effect's own


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
    after = inputs_freed(quality(last.problem, last.fitted, heldout=False))
    both = members(near, after)
    # as if both left alike, which no two effects of a test of seconds do
    alike = [dataclasses.replace(one, squares=0.0) for one in both]
    block = _block(after)
    hold_for_all(block, alike)
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
    after = inputs_freed(quality(last.problem, last.fitted, heldout=False))
    block = _block(after)
    alone = block["moduli"]["specimen"][PLANE]["value"]
    hold_for_all(block, members(near, after))
    assert block["moduli"]["specimen"][PLANE]["value"] == pytest.approx(alone, rel=1e-9)
