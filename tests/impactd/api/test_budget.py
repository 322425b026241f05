"""Budgets of the moduli over HTTP, and decisions against limits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import resources

import jsonschema_rs
import pytest

from tests.impactd.reports.laboratory import SECRET, Laboratory


def _is_as_its_schema_says(document) -> bool:
    text = resources.files("impactd.schemas").joinpath("budget.json").read_text("utf-8")
    return bool(jsonschema_rs.validator_for(json.loads(text)).is_valid(document))


@pytest.fixture(scope="module")
def measured(rig):
    """A rig with one analysed shot on a reference and one on the specimen."""
    rig.analysed_shot()
    number = rig.drop(
        {"sphere": "acetal", "surface": "specimen", "drop_height_m": 0.03, "operator": "ab"}
    ).json()["number"]
    assert rig.ended(number, ("analysed", "failed"))["state"] == "analysed"
    moduli = rig.reader.get("/v1/moduli").json()
    takes_part = number in [shot["number"] for shot in moduli["shots"]]
    assert takes_part, (moduli["model"], moduli["excluded"], moduli["warnings"])
    return rig


def test_a_budget_adds_up_to_what_the_moduli_say(measured):
    """Rows with their shares, and a sentence that says what would improve the modulus most."""
    stated = measured.reader.get("/v1/moduli").json()["moduli"]
    found = measured.reader.get("/v1/moduli/budget").json()
    assert found["format"] == "impactd-budget/1"
    assert found["status"]["specimen"] == "fitted"
    one = found["moduli"]["specimen"]["youngs_modulus_Pa"]
    assert one["u"] == pytest.approx(stated["specimen"]["youngs_modulus_Pa"]["u"], rel=1e-6)
    inputs = {row["input"]: row for row in one["rows"]}
    assert not inputs["noise"]["common"]
    assert inputs["spheres.acetal.youngs_modulus_Pa"]["common"]
    assert one["improve"].endswith(".")
    assert "conformity" not in one
    assert _is_as_its_schema_says(found)


def test_a_limit_gets_a_decision(measured):
    """The specimen's modulus passes far within a limit, fails far beyond, and says why."""
    path = "/v1/moduli/budget?specimen=specimen"
    young = measured.reader.get(path).json()["moduli"]["specimen"]["youngs_modulus_Pa"]
    decisions = {}
    for name, factor in (("low", 0.2), ("high", 5.0)):
        asked = f"{path}&lower_Pa={factor * young['value']}"
        one = measured.reader.get(asked).json()["moduli"]["specimen"]["youngs_modulus_Pa"]
        decisions[name] = one["conformity"]
    assert decisions["low"]["decision"] == "pass"
    assert decisions["high"]["decision"] == "fail"
    assert decisions["high"]["sentence"].startswith("E of specimen fails: at least")
    plane = measured.reader.get(f"{path}&upper_Pa=1e12&modulus=plane_strain_modulus_Pa").json()
    assert _is_as_its_schema_says(plane)
    assert plane["moduli"]["specimen"]["plane_strain_modulus_Pa"]["conformity"]["rule"] == "both"


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("lower_Pa=2e9", "without a specimen"),
        ("specimen=specimen&lower_Pa=2.2", "2.2 GPa is 2.2e9"),
        ("specimen=specimen&lower_Pa=2e9&upper_Pa=1e9", "not below"),
        ("specimen=sand&lower_Pa=2e9", "not stated"),
        ("specimen=specimen&lower_Pa=nan", "no modulus"),
    ],
)
def test_limits_that_mean_nothing_are_refused_in_words(measured, query, words):
    """What cannot be decided is a problem document with the cause, never a decision."""
    answer = measured.reader.get(f"/v1/moduli/budget?{query}")
    assert answer.status_code == 422
    assert words in answer.json()["detail"]


def test_the_command_shows_and_reports_the_archives_budget(measured, tmp_path):
    """`impactd moduli --budget` has rows, sentence and decision, and writes the page."""
    named = {"IMPACTD_URL": measured.url, "IMPACTD_TOKEN": measured.token("read", "a terminal")}
    limit = ["--specimen", "specimen", "--lower", "1e6", "--report", str(tmp_path / "b.html")]
    done, refused = (
        subprocess.run(
            [sys.executable, "-m", "impactd", "moduli", "--budget", *words],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **named},
        )
        for words in (limit, ["--lower", "1e6"])
    )
    assert done.returncode == 0, done.stderr
    assert "noise and" in done.stdout  # "scatter of the single shots": a long label is folded
    assert "E of specimen passes: at least 1 MPa was asked" in done.stdout
    assert "E of specimen passes" in (tmp_path / "b.html").read_text(encoding="utf-8")
    assert refused.returncode == 2
    assert "--specimen" in refused.stderr


def test_a_sheet_of_the_archive_is_signed(measured, tmp_path):
    """`impactd moduli --report` signs the modulus of the specimen on this side of the wire."""
    laboratory, sheet = Laboratory.founded_in(tmp_path), tmp_path / "sheet.pdf"
    named = {"IMPACTD_URL": measured.url, "IMPACTD_TOKEN": measured.token("read", "a terminal")}
    done = subprocess.run(
        [sys.executable, "-m", "impactd", "moduli", "--specimen", "specimen", "--report", sheet,
         "--sign-with", laboratory.pkcs12()],
        capture_output=True, text=True, check=False,
        env={**os.environ, **named, "IMPACTD_SIGN_PASSPHRASE": SECRET},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert laboratory.check(sheet.read_bytes()).bottom_line
