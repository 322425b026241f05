"""``impactd budget``: tables for people, JSON for programs."""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import jsonschema_rs
import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.moduli.budget_report import write_budget_report


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign folder, small enough to be fitted at once."""
    settings = CampaignSettings(drop_heights_m=(0.02,), repeats=1)
    return write_campaign_folder(
        tmp_path_factory.mktemp("campaign"), simulate_campaign(settings, 3)
    )


def _run(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "impactd", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def test_budget_of_a_campaign_says_what_to_measure(tmp_path: Path) -> None:
    """Inputs with their shares, the draws beside them, and the numbers that count as exact."""
    write_campaign_folder(tmp_path, simulate_campaign(CampaignSettings(), 3))
    file = tmp_path / "campaign.json"
    root = json.loads(file.read_text())
    for ball in root["spheres"].values():
        ball["mass_kg"] = {"value": ball["mass_kg"], "u": 0.02 * ball["mass_kg"]}
    file.write_text(json.dumps(root))
    out = tmp_path / "budget.json"

    done = _run("budget", file, "--monte-carlo", 2000, "--json", out)

    assert done.returncode == 0, done.stderr
    assert "mass of the sphere" in done.stdout
    assert "Beside 2000 draws" in done.stdout
    assert "Taken as exact" in done.stdout
    document = json.loads(out.read_text())
    assert document["format"] == "impactd-budget/1"
    rows = document["moduli"]["specimen"]["plane_strain_modulus_Pa"]["rows"]
    assert any(row["input"].endswith("mass_kg") and row["common"] for row in rows)
    assert document["monte_carlo"]["draws"] == 2000
    schema = resources.files("impactd.schemas").joinpath("budget.json").read_text("utf-8")
    jsonschema_rs.validator_for(json.loads(schema)).validate(document)


def test_a_limit_is_decided_and_reported(tmp_path: Path) -> None:
    """Pass or fail stands in the tables, the JSON and the page; a PDF has a sheet a modulus."""
    write_campaign_folder(tmp_path, simulate_campaign(CampaignSettings(), 3))
    out, page, sheets = (tmp_path / f"budget.{end}" for end in ("json", "html", "pdf"))

    done = _run("budget", tmp_path, "--lower", "1e8", "--json", out, "--report", page)

    assert done.returncode == 0, done.stderr
    assert "E of specimen passes: at least 100 MPa was asked" in done.stdout
    document = json.loads(out.read_text())
    found = document["moduli"]["specimen"]["youngs_modulus_Pa"]["conformity"]
    assert (found["decision"], found["rule"]) == ("pass", "both")
    assert found["sentence"] in html.unescape(page.read_text(encoding="utf-8"))

    write_budget_report(sheets, document, ["specimen"])
    first = sheets.read_bytes()
    assert first.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", first)) == 2
    write_budget_report(sheets, document, ["specimen"])
    assert sheets.read_bytes() == first


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--lower", "2.2"), "2.2 GPa is 2.2e9"),
        (("--lower", "2e9", "--upper", "1e9"), "not below"),
        (("--lower", "2e9", "--specimen", "sand"), "sand"),
    ],
)
def test_limits_that_mean_nothing_are_one_sentence(
    campaign: Path, words: tuple[str, ...], told: str
) -> None:
    """What cannot be decided is refused with its cause."""
    done = _run("budget", campaign, *words)
    assert done.returncode == 1
    assert told in done.stderr
    assert "Traceback" not in done.stderr


def test_a_report_of_no_known_kind_is_refused_before_anything_is_fitted(tmp_path: Path) -> None:
    """The ending says what to write, so a wrong one costs nobody a fit."""
    done = _run("budget", tmp_path, "--report", "budget.doc")
    assert done.returncode == 2
    assert "must end in .html or .pdf" in done.stderr


def test_a_report_escapes_what_people_typed(tmp_path: Path) -> None:
    """Names and sources are text, whatever is in them."""
    row = {
        "input": "x",
        "label": "<script>1</script>",
        "value": 1.0,
        "u": None,
        "unit": "Pa",
        "distribution": "normal",
        "sensitivity": None,
        "sensitivity_to": "logarithm",
        "contribution": 0.01,
        "share": 1.0,
        "degrees_of_freedom": None,
        "traceable_to": "<b>",
        "common": True,
    }
    one = {"value": 1e9, "u": 1e7, "relative_u": 0.01, "relative_u_common": 0.01}
    one |= {"relative_u_averaged": 0.0, "improve": "<i>", "rows": [row]}
    document = {"model": "<kv>", "moduli": {"<pvc>": {"youngs_modulus_Pa": one}}, "software": "<s>"}
    write_budget_report(tmp_path / "a.html", document, ["<pvc>"])
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    for typed in ("<script>", '<b>"', "<i>", "<kv>", "<pvc>", "<s>"):
        assert typed not in text
    assert "&lt;script&gt;" in text


def test_too_few_draws_are_one_sentence(tmp_path: Path) -> None:
    """A Monte Carlo that could not say anything is refused with the number it takes."""
    write_campaign_folder(tmp_path, simulate_campaign(CampaignSettings(), 3))

    done = _run("budget", tmp_path, "--monte-carlo", 5)

    assert done.returncode == 1
    assert "take 100" in done.stderr
    assert "Traceback" not in done.stderr
