"""The ladder beside the truth: rungs, rows, files."""

from __future__ import annotations

import dataclasses
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from impactd.demo.figures import draw_moduli
from impactd.demo.outcome import Estimate
from impactd.demo.report import write_report
from impactd.demo.terminal import show
from impactd.demo.words import gigapascals, off_by, true_gigapascals, true_number

Make = Callable[..., Any]


def test_the_ladder_ends_with_what_was_found(outcome_of: Make, diagnosis_of: Make) -> None:
    """HSD, KV, closed KV and that with the named effect: each with error and modulus."""
    outcome = outcome_of(diagnosis_of("identified", ("finite_thickness",)), "finite_thickness")
    assert [rung.name for rung in outcome.rungs] == [
        "HSD",
        "KV",
        "closed KV",
        "closed KV + finite_thickness",
    ]
    assert [rung.heldout_rms_v for rung in outcome.rungs] == [0.2, 8e-3, 5e-3, 1.5e-3]
    (pair,) = outcome.pairs
    assert pair.truth_pa == pytest.approx(0.25e9)
    assert pair.to_json()["kv2_holds_truth"] is False
    assert pair.to_json()["after_holds_truth"] is True
    assert outcome.held("kv2") == (0, 1)
    assert outcome.held("after") == (1, 1)


def test_the_ladder_has_three_rungs_where_nothing_was_missing(
    outcome_of: Make, diagnosis_of: Make
) -> None:
    """Without a discrepancy there is nothing to add to the closed KV."""
    outcome = outcome_of(diagnosis_of("adequate"))
    assert outcome.last.name == "closed KV"
    assert outcome.to_json()["right"] is True


def test_moduli_name_the_model_they_come_from(outcome_of: Make, diagnosis_of: Make) -> None:
    """`moduli.json` is plain JSON and holds the last rung's moduli with its model."""
    outcome = outcome_of(diagnosis_of("identified", ("finite_thickness",)), "finite_thickness")
    content = json.loads(json.dumps(outcome.to_json(), allow_nan=False))
    assert content["model"] == "kv2+finite_thickness"
    assert content["moduli"] == outcome.diagnosis["after"]["moduli"]
    assert [rung["rung"] for rung in content["ladder"]] == ["hsd", "kv", "kv2", "after"]


def test_the_mean_of_the_other_drops_stands_below_the_ladder(
    outcome_of: Make, diagnosis_of: Make
) -> None:
    """Where the diagnosis has it; it is no rung, as it has no moduli."""
    mean = {"heldout_rms_V": 31.4e-3, "shots": 3, "reason": None}
    outcome = outcome_of(diagnosis_of("adequate", mean_waveform=mean))
    assert outcome.mean_waveform_rms_v == 31.4e-3
    assert outcome.last.name == "closed KV"
    console = Console(record=True, width=160, file=io.StringIO())
    show(console, outcome)
    assert "mean of the other hits" in console.export_text()
    assert outcome_of(diagnosis_of("adequate")).mean_waveform_rms_v is None


def test_a_withheld_modulus_stays_withheld(outcome_of: Make, diagnosis_of: Make) -> None:
    """Nothing is printed in place of a number that the fit would not state."""
    sphere, surface = outcome_of(diagnosis_of("adequate")).materials
    assert sphere.known
    assert gigapascals(surface.estimates["kv2"]) == "withheld"
    assert off_by(surface.estimates["kv2"], 1.0) == "-"


def test_a_truth_has_the_digits_of_the_sharpest_estimate_beside_it() -> None:
    """So that one number is written alike wherever it stands."""
    blunt, sharp = (Estimate(1.6e9, u, (1.5e9, 1.7e9)) for u in (14e6, 2.2e6))
    assert true_gigapascals(1.59546e9, [blunt, None, sharp]) == "1.5955"
    assert true_gigapascals(1.59546e9, [blunt]) == "1.595"
    assert true_number(0.7239512, [None]) == "0.72395"
    assert true_number(1.2074386e-8, [{"value": 1.2e-8, "u": 1e-10}]) == "1.2074e-08"


def test_the_page_is_complete_but_for_the_diagnosis_beside_it(
    outcome_of: Make, diagnosis_of: Make, tmp_path: Path
) -> None:
    """Pictures are inside, the one link is the diagnosis, and the truth is told."""
    mean = {"heldout_rms_V": 31.4e-3, "shots": 3, "reason": None}
    outcome = outcome_of(diagnosis_of("unknown", mean_waveform=mean), "x_sphere_spin")
    picture = tmp_path / "moduli.png"
    draw_moduli(picture, outcome)
    write_report(tmp_path / "report.html", outcome, {"moduli": picture, "trace": picture})
    page, _, script = (tmp_path / "report.html").read_text().partition("<script")
    assert page.count("data:image/png;base64,") == 2
    assert page.count('data-chart="error"') == script.count('id="plotly"') == 1
    assert page.count("href=") == 1
    assert 'href="diagnosis.html"' in page
    assert "x_sphere_spin" in page
    assert "<td>mean of the other hits</td><td>31.4</td>" in page
    assert "http" not in page.replace("HTTP", "")
    assert "$" not in page


@pytest.mark.parametrize("calibrated", [True, False])
def test_the_load_cell_says_whose_interval_holds_the_truth(
    outcome_of: Make, diagnosis_of: Make, tmp_path: Path, calibrated: bool
) -> None:
    """A calibration that gave no result is no column of dashes, but a reason."""
    outcome = outcome_of(diagnosis_of("adequate"))
    gain = {"value": 2.3, "u": 0.1, "interval95": [2.1, 2.5], "unit": "N/V"}
    block = {**outcome.diagnosis["before"], "parameters": {"sensor.gain_N_per_V": gain}}
    result = {"parameters": {}, "identifiable": {"gain_N_per_V": gain}} if calibrated else None
    outcome = dataclasses.replace(
        outcome,
        rungs=[*outcome.rungs[:-1], dataclasses.replace(outcome.last, block=block)],
        truth={**outcome.truth, "sensor": {"gain_N_per_V": 2.7}},
        calibration={
            **outcome.calibration,
            "result": result,
            "problem": None if calibrated else {"detail": "The fit did not converge."},
        },
    )
    picture = tmp_path / "moduli.png"
    draw_moduli(picture, outcome)
    write_report(tmp_path / "report.html", outcome, {"moduli": picture, "trace": picture})
    page = (tmp_path / "report.html").read_text()
    (row,) = re.findall(r"<tr><td>gain_N_per_V</td>.*</tr>", page)
    cells = ["2.30 ± 0.20"] * (2 if calibrated else 1)
    assert re.findall(r"<td>(.*?)</td>", row) == ["gain_N_per_V", *cells, "2.70", "no"]
    assert "<th>in the 95 % of all drops, closed KV?</th>" in page
    assert ("gave no result: The fit did not converge." in page) is not calibrated


def test_the_page_says_that_nothing_was_sealed(
    outcome_of: Make, diagnosis_of: Make, tmp_path: Path
) -> None:
    """Without an effect there is no table of effects; the verdict is judged all the same."""
    outcome = outcome_of(diagnosis_of("adequate", sentence="a < b"))
    picture = tmp_path / "moduli.png"
    draw_moduli(picture, outcome)
    write_report(tmp_path / "report.html", outcome, {"moduli": picture, "trace": picture})
    page = (tmp_path / "report.html").read_text()
    assert "Nothing: the base model is complete." in page
    assert "<b>RIGHT</b>" in page
    assert "a &lt; b" in page
    assert ">sealed<" not in page


@pytest.mark.parametrize(
    ("value_pa", "u_pa", "text"),
    [
        (2.3456e9, 0.0412e9, "2.346 ± 0.081"),
        (69e9, 1.38e9, "69.0 ± 2.7"),
        (194e9, 12e9, "194 ± 24"),
    ],
)
def test_moduli_are_printed_to_two_digits_of_their_uncertainty(
    value_pa: float, u_pa: float, text: str
) -> None:
    """Digits that the uncertainty does not support are not printed."""
    assert gigapascals(Estimate(value_pa, u_pa, (0.0, 1.0))) == text
