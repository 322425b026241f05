"""The demo as a whole, and what it does to a folder that is already there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from impactd.console.failure import Failure
from impactd.demo import run_demo
from impactd.demo.drops import overloaded, plan


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    """A folder that holds anything a demo did not make is refused, and nothing in it is touched."""
    (tmp_path / "thesis.tex").write_text("important")
    with pytest.raises(Failure, match=r"thesis\.tex"):
        run_demo(out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_the_campaign_has_enough_drops_to_tell_materials_apart() -> None:
    """Three spheres of two radii, two surfaces, three heights, each of them twice."""
    spheres, surfaces, heights = (set(column) for column in zip(*plan(), strict=True))
    assert (len(spheres), len(surfaces), len(heights)) == (3, 2, 3)
    assert {"specimen", "acetal", "acetal_small"} <= spheres | surfaces
    assert all(plan().count(drop) == 2 for drop in plan())


def test_only_the_converter_overloads() -> None:
    """A shot cut at the converter's range belongs into no campaign; one cut below it does."""
    assert overloaded({"clipped": True, "peak": 10.01}, 10.0)
    assert not overloaded({"clipped": True, "peak": 6.2}, 10.0)
    assert not overloaded({"clipped": False, "peak": 9.95}, 10.0)


def demo(out: Path, *words: str) -> tuple[str, dict[str, Any]]:
    """Run the demo as a person does; return what it printed and its moduli."""
    command = [sys.executable, "-m", "impactd", "demo", *words, "--out", str(out)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=280)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in (out / "daemon.log").read_text()
    return result.stdout, json.loads((out / "moduli.json").read_text())


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_demo_finds_the_truth_where_nothing_is_hidden(tmp_path: Path) -> None:
    """Nothing is claimed, the closed KV is right about every pair, HSD is biased high."""
    said, moduli = demo(tmp_path / "out", "--seed", "3", "--effect", "none")
    assert moduli["verdict"] == "adequate"
    assert "RIGHT" in said
    for pair in moduli["pairs"].values():
        # Pairs share the cell's error, so one in twenty seeds is beyond 2 u for all of them; 4 u
        # is beyond chance.
        assert abs(pair["kv2"]["value"] - pair["truth_Pa"]) < 4 * pair["kv2"]["u"]
        assert pair["hsd"]["value"] > 1.1 * pair["truth_Pa"]


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_demo_closes_the_loop(tmp_path: Path) -> None:
    """A leaky coupler is named, its model made active, and the error falls rung by rung."""
    out = tmp_path / "out"
    said, moduli = demo(out, "--seed", "3", "--effect", "coupler_highpass")
    assert moduli["right"] is True
    assert moduli["model"] == "kv2+coupler_highpass"
    assert moduli["active_model"] == "kv2+coupler_highpass version 1"
    errors = [rung["heldout_rms_V"] for rung in moduli["ladder"]]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1.1 * moduli["noise_rms_V"]
    assert "Made the active model: kv2+coupler_highpass version 1" in said
    for name in (
        "report.html",
        "diagnosis.html",
        "diagnosis.json",
        "trace.png",
        "moduli.png",
        "shots/campaign.json",
        "truth.json",
    ):
        assert (out / name).stat().st_size > 0
