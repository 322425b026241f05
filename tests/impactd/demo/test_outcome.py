"""Fits beside the truth: rows, verdicts and the one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from impactd.demo.figures import draw_moduli
from impactd.demo.outcome import Estimate, Outcome, compare
from impactd.demo.report import gigapascals, write_report


def measurand(value: float, u: float) -> dict[str, Any]:
    """Return a modulus as the API states it."""
    return {"value": value, "u": u, "unit": "Pa", "interval95": [value - 2 * u, value + 2 * u]}


def fit(factor: float) -> dict[str, Any]:
    """Return a joint fit whose moduli are the truth times a factor."""
    return {
        "pairs": {"ptfe/ptfe": {"shots": 3, "reduced_modulus_Pa": measurand(0.25e9 * factor, 1e7)}},
        "moduli": {
            "sphere:ptfe": {
                "side": "sphere",
                "status": "reference",
                "youngs_modulus_Pa": measurand(0.4e9 * factor, 1e7),
            },
            "surface:ptfe": {"side": "surface", "status": "withheld", "youngs_modulus_Pa": None},
        },
        "shots": [{"sphere": "ptfe", "surface": "ptfe"}] * 3,
        "parameters": {"sensor.gain_N_per_V": {"value": 2.3, "u": 0.1}},
    }


@pytest.fixture
def outcome() -> Outcome:
    """KV right, HSD 60 % high, one modulus withheld."""
    material = {"youngs_modulus_Pa": 0.4e9, "plane_strain_modulus_Pa": 0.5e9}
    truth = {"spheres": {"ptfe": material}, "surfaces": {"ptfe": material}, "effects": []}
    return compare(fit(1.6), fit(1.01), {"number": 1, "drops": [1, 2]}, truth, 5)


def test_a_pair_is_held_against_the_truth_of_both_materials(outcome: Outcome) -> None:
    """The true E* comes from both plane-strain moduli, and each interval is judged by it."""
    (pair,) = outcome.pairs
    assert pair.truth_pa == pytest.approx(0.25e9)
    assert pair.to_json()["kv_holds_truth"] is True
    assert pair.to_json()["hsd_holds_truth"] is False
    assert "1 of 1 pairs" in outcome.sentence()
    assert "+60%" in outcome.sentence()


def test_a_model_that_leaves_structure_is_not_praised(outcome: Outcome) -> None:
    """Where KV leaves more than the noise, the sentence says that its intervals do not cover it."""
    outcome.fits["kv"]["chi2_per_dof"] = 39.0
    assert "39 times the noise" in outcome.sentence()


def test_a_withheld_modulus_stays_withheld(outcome: Outcome) -> None:
    """Nothing is printed in place of a number that the fit would not state."""
    sphere, surface = outcome.materials
    assert sphere.known
    assert surface.kv is None
    assert gigapascals(surface.kv) == "withheld"


def test_results_are_complete_files(outcome: Outcome, tmp_path: Path) -> None:
    """moduli.json is plain JSON, and the page holds its pictures and names nothing outside."""
    json.dumps(outcome.to_json(), allow_nan=False)
    picture = tmp_path / "moduli.png"
    draw_moduli(picture, outcome)
    write_report(tmp_path / "report.html", outcome, {"moduli": picture, "trace": picture})
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 2
    assert "http" not in page.replace("HTTP", "")
    assert "$" not in page


@pytest.mark.parametrize(
    ("value_pa", "u_pa", "text"),
    [
        (2.3456e9, 0.0412e9, "2.346 ± 0.041"),
        (69e9, 1.38e9, "69.0 ± 1.4"),
        (194e9, 12e9, "194 ± 12"),
    ],
)
def test_moduli_are_printed_to_two_digits_of_their_uncertainty(
    value_pa: float, u_pa: float, text: str
) -> None:
    """Digits that the uncertainty does not support are not printed."""
    assert gigapascals(Estimate(value_pa, u_pa, (0.0, 1.0))) == text
