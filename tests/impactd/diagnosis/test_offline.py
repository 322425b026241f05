"""`impactd diagnose CAMPAIGN.json` as a person runs it."""

from __future__ import annotations

import json
import subprocess
import sys


def test_a_campaign_is_diagnosed_offline(leaky_campaign, tmp_path):
    """JSON and page are written, the summary is printed, a pipe sees no progress."""
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
    assert made.stderr == ""
    assert "IDENTIFIED" in made.stdout
    found = json.loads(out.read_text())
    assert found["format"] == "impactd-diagnosis/1"
    assert found["effects"][0]["id"] == "coupler_highpass"
    assert report.read_text().startswith("<!doctype html>")
