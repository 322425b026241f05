"""Results leave for other programs and come back as the same numbers."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import jsonschema_rs
import numpy as np
import pytest
from typer.testing import CliRunner

from analysis import fit_campaign
from impactd.cli import app
from impactd.settings.settings import find_config
from impactd.storage.campaign_folder import read_campaign


@pytest.fixture(scope="module")
def fitted(small_campaign, tmp_path_factory):
    """The small campaign fitted by the command line: JSON and CSV."""
    folder = tmp_path_factory.mktemp("fit")
    words = ["fit", str(small_campaign), "--json", f"{folder}/fit.json", "--csv", f"{folder}/f.csv"]
    made = CliRunner().invoke(app, words)
    assert made.exit_code == 0, made.output
    return json.loads((folder / "fit.json").read_text()), folder / "f.csv"


@pytest.mark.parametrize("words", [["--json"], ["--json", "--model", "kv2"], ["--json", "-"]])
def test_json_without_a_file_prints(run, small_campaign, fitted, words):
    """Wherever it stands, as in every other command; with a file it writes there."""
    printed = json.loads(run("fit", small_campaign, *words).stdout)
    assert printed["moduli"] == fitted[0]["moduli"]


def schema(run, name):
    """Return a schema as the command prints it."""
    return json.loads(run("schema", name).output)


def test_a_fit_is_as_its_schema_says(run, fitted):
    """The schema takes what the program writes, and refuses what it would never write."""
    validator = jsonschema_rs.validator_for(schema(run, "fit"))
    validator.validate(fitted[0])
    wrong = json.loads(json.dumps(fitted[0]))
    next(iter(wrong["moduli"].values()))["status"] = "guessed"
    assert not validator.is_valid(wrong)
    assert not validator.is_valid({"format": "impactd-fit/1"})


def test_a_campaign_is_as_its_schema_says(run, small_campaign):
    """Our folders fit it; a negative mass and a missing file name do not."""
    validator = jsonschema_rs.validator_for(schema(run, "campaign"))
    good = json.loads(small_campaign.read_text())
    validator.validate(good)
    good["spheres"]["acetal"]["mass_kg"] = -1
    assert not validator.is_valid(good)


@pytest.mark.parametrize("name", ["campaign", "fit", "diagnosis", "settings"])
def test_every_schema_is_one(name, run):
    """Each is a valid schema of the draft it names."""
    jsonschema_rs.validator_for(schema(run, name))


def test_a_spreadsheet_gets_the_same_numbers(fitted):
    """One number a line with unit and 95 % interval; nothing is rounded."""
    document, file = fitted
    with file.open(encoding="utf-8-sig", newline="") as lines:
        rows = list(csv.DictReader(lines))
    young = document["moduli"]["specimen"]["youngs_modulus_Pa"]
    (row,) = (r for r in rows if (r["name"], r["quantity"]) == ("specimen", "youngs_modulus_Pa"))
    assert float(row["value"]) == young["value"]
    assert [float(row["low95"]), float(row["high95"])] == young["interval95"]
    assert (row["of"], row["unit"], row["model"]) == ("material", "Pa", "kv2")
    assert {r["of"] for r in rows} == {"material", "pair", "parameter"}
    gains = [r for r in rows if r["quantity"] == "gain_N_per_V"]
    assert len(gains) == 1
    assert gains[0]["unit"] == "N/V"


def test_a_campaign_through_the_archive_gives_the_same_numbers(
    run, small_campaign, fitted, tmp_path: Path
):
    """Imported, exported and fitted: every modulus and every uncertainty to twelve digits."""
    where = ("--config", find_config("simulated.toml"), "--data", tmp_path / "archive")
    numbers = json.loads(run("import", small_campaign, "--json", *where).output)["numbers"]
    told = run("export", *numbers, "--out", tmp_path / "out", "--json", *where)
    (file,) = json.loads(told.output)["files"]
    first, second = read_campaign(small_campaign), read_campaign(Path(file))
    for one, other in zip(first.shots, second.shots, strict=True):
        np.testing.assert_array_equal(one.signal, other.signal)
    before, after = fitted[0], fit_campaign(second).to_json()
    for name, pair in before["pairs"].items():
        for key in ("value", "u"):
            one, other = (p["reduced_modulus_Pa"][key] for p in (pair, after["pairs"][name]))
            assert math.isclose(one, other, rel_tol=1e-12), (name, key, one, other)
    for name, modulus in before["moduli"].items():
        one, other = (m["youngs_modulus_Pa"] for m in (modulus, after["moduli"][name]))
        assert math.isclose(one["value"], other["value"], rel_tol=1e-12)
