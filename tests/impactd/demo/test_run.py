"""The demo as a whole, and what it does to a folder that is already there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from impactd.console.failure import Failure
from impactd.demo import run_demo
from impactd.demo.drops import plan


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    """A folder that holds anything a demo did not make is refused, and nothing in it is touched."""
    (tmp_path / "thesis.tex").write_text("important")
    with pytest.raises(Failure, match=r"thesis\.tex"):
        run_demo(out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_the_campaign_has_enough_drops_to_tell_materials_apart() -> None:
    """At least twelve drops, three spheres, two surfaces, three heights."""
    spheres, surfaces, heights = (set(column) for column in zip(*plan(), strict=True))
    assert len(plan()) >= 12
    assert (len(spheres), len(surfaces), len(heights)) == (3, 2, 3)


@pytest.mark.slow
def test_the_demo_finds_the_truth(tmp_path: Path) -> None:
    """Through the real daemon, KV finds every pair within its uncertainty; HSD is biased high."""
    out = tmp_path / "out"
    command = [sys.executable, "-m", "impactd", "demo", "--seed", "3", "--out", str(out)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=280)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in (out / "daemon.log").read_text()
    moduli = json.loads((out / "moduli.json").read_text())
    for pair in moduli["pairs"].values():
        # Pairs share the cell's error, so one in twenty seeds is beyond 2 u for all of them; 4 u
        # is beyond chance.
        assert abs(pair["kv"]["value"] - pair["truth_Pa"]) < 4 * pair["kv"]["u"]
        assert pair["hsd"]["value"] > 1.1 * pair["truth_Pa"]
    for name in ("report.html", "trace.png", "moduli.png", "shots/campaign.json", "truth.json"):
        assert (out / name).stat().st_size > 0
