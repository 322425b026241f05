"""``impactd budget``: tables for people, JSON for programs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder


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


def test_too_few_draws_are_one_sentence(tmp_path: Path) -> None:
    """A Monte Carlo that could not say anything is refused with the number it takes."""
    write_campaign_folder(tmp_path, simulate_campaign(CampaignSettings(), 3))

    done = _run("budget", tmp_path, "--monte-carlo", 5)

    assert done.returncode == 1
    assert "take 100" in done.stderr
    assert "Traceback" not in done.stderr
