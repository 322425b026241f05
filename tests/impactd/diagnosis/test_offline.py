"""`impactd diagnose CAMPAIGN.json` as a person runs it."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys

import jsonschema_rs
import pytest

from analysis.diagnosis.progress import MethodStep
from impactd.console.diagnoses import summary


def test_a_campaign_is_diagnosed_offline(leaky_campaign, tmp_path):
    """JSON and page are written, the summary is printed, a log gets one line a step."""
    out, report = tmp_path / "found.json", tmp_path / "report.html"
    command = [sys.executable, "-m", "impactd", "diagnose", leaky_campaign]
    made = subprocess.run(
        [*command, "--json", out, "--report", report],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert made.returncode == 0, made.stderr
    lines = [line.partition(": ")[0] for line in made.stderr.splitlines()]
    assert set(lines) <= {step.heading for step in MethodStep}
    assert lines[:4] == [
        "Noise (1 of 9)", "Base fit (2 of 9)", "Is there structure? (3 of 9)",
        "Candidates (4 of 9)",
    ]  # fmt: skip
    places = [int(line.rpartition("(")[2].partition(" ")[0]) for line in lines]
    assert all(a < b for a, b in itertools.pairwise(places))
    assert places[-1] == 9
    assert "(4 of 9)" not in made.stdout
    assert "IDENTIFIED" in made.stdout
    found = json.loads(out.read_text())
    assert found["format"] == "impactd-diagnosis/1"
    assert found["effects"][0]["id"] == "coupler_highpass"
    assert report.read_text().startswith("<!doctype html>")


def test_with_a_budget_it_is_the_best_verdict_so_far(leaky_campaign, tmp_path):
    """Less than the base fit takes: a document all the same, with the words that it is one."""
    out, report = tmp_path / "found.json", tmp_path / "report.html"
    command = [sys.executable, "-m", "impactd", "diagnose", leaky_campaign, "--budget", "0.001"]
    made = subprocess.run(
        [*command, "--json", out, "--report", report],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert made.returncode == 0, made.stderr
    assert "best verdict after" in " ".join(made.stdout.split())
    found = json.loads(out.read_text())
    assert found["ended_early"]["budget_s"] == 0.001
    assert found["verdict"] == "unknown"
    schema = subprocess.run(
        [sys.executable, "-m", "impactd", "schema", "diagnosis"],
        capture_output=True, text=True, check=True, timeout=60,
    ).stdout  # fmt: skip
    jsonschema_rs.validator_for(json.loads(schema)).validate(found)
    assert "the time was over" in report.read_text()


@pytest.mark.parametrize("seconds", ["0", "-3", "nan", "inf"])
def test_a_budget_of_no_time_is_wrong_usage(leaky_campaign, seconds):
    """It is refused with its value before anything is fitted."""
    command = [sys.executable, "-m", "impactd", "diagnose", leaky_campaign, "--budget", seconds]
    made = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert made.returncode == 2
    said = " ".join(made.stderr.replace("│", " ").split())
    assert f"{seconds} is not a valid search time" in said
    assert "positive number of seconds" in said


def test_the_next_drop_is_told_in_words_with_the_command_that_makes_it(document):
    """A proposal names the drop and how far it separates whom; the daemon's has its number."""
    wanted = {
        "sphere": "acetal",
        "surface": "specimen",
        "drop_height_m": 0.0412,
        "separates": ["echo", "second_mode"],
        "expected_distance": 7.13,
        "repeats": 1,
    }
    told = summary({**document, "next_drop": wanted}, number=12)
    assert "Drop next, once: acetal on specimen from 41.2 mm" in told
    assert "it distinguishes echo from second_mode" in told
    assert told.endswith("impactd drop --proposed-by 12")
    assert "--proposed-by" not in summary({**document, "next_drop": {**wanted, "repeats": 3}})


def test_the_mean_of_the_other_hits_stands_below_the_models(document):
    """Its held-out error is a line of the table; where there is none, the reason is."""
    (line,) = [one for one in summary(document).splitlines() if "mean of the other hits" in one]
    assert f"{document['mean_waveform']['heldout_rms_V']:.3g}" in line
    few = {"heldout_rms_V": None, "shots": 0, "reason": "2 shots leave none"}
    assert "no mean of the other hits: 2 shots leave none" in summary(
        {**document, "mean_waveform": few}
    )


def test_a_record_in_other_units_is_not_told_in_volts(document):
    """An accelerometer's residual is in m/s^2."""
    assert document["campaign"]["quantities"] == ["voltage"]
    other = {**document["campaign"], "quantities": ["acceleration_m_per_s2"]}
    told = summary({**document, "campaign": other})
    assert "m/s^2 rms" in told
    assert " V rms" not in told.partition("noise before the trigger")[2]


@pytest.mark.slow
def test_from_a_rigid_cell_the_crystal_is_found_first(papers_leaky_campaign):
    """`--base hsd` names the crystal, then what else is undeclared beside the paper's KV."""
    command = [sys.executable, "-m", "impactd", "diagnose", papers_leaky_campaign, "--base", "hsd"]
    made = subprocess.run(
        [*command, "--json", "-"], capture_output=True, text=True, check=False, timeout=240
    )
    assert made.returncode == 0, made.stderr
    found = json.loads(made.stdout)
    assert found["verdict"] == "identified"
    assert [one["id"] for one in found["effects"]] == ["crystal_dynamics", "coupler_highpass"]
    assert found["before"]["model"] == "hsd"
    assert found["after"]["model"] == "kv+coupler_highpass"
    assert found["before"]["r2"] < 0.95
    assert found["after"]["r2"] > 0.999
