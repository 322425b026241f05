"""The guides keep their word: every block of commands and code runs, on a real daemon."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from tests.simulated_rig import write_simulated_rig

ROOT = Path(__file__).parents[2]
GUIDES = ROOT / "impactd" / "guides"
LIMIT_S = 900
"""For a guide on a starved machine; nothing here measures speed."""


def blocks(document: Path) -> list[tuple[str, str]]:
    """Return (language, text) of every block of a document that can be run, in order."""
    found = re.findall(r"```(sh|python)\n(.*?)```", document.read_text(), flags=re.S)
    return [(language, text) for language, text in found]


def script_of(parts: list[tuple[str, str]]) -> str:
    """Return blocks as one bash script, in order.

    What is Python shares one process, as in a notebook beside the terminal; it runs where its
    first block stands.
    """
    python = "\n".join(text for language, text in parts if language == "python")
    lines: list[str] = []
    for language, text in parts:
        if language == "sh":
            lines.append(text)
        elif python:
            lines.append(f"python - <<'END OF PYTHON'\n{python}\nEND OF PYTHON")
            python = ""
    return "\n".join(lines)


@dataclass(frozen=True)
class Desk:
    """A folder with a campaign in it, and the environment of somebody who works there."""

    folder: Path
    environment: dict[str, str]

    def run(self, script: str, **more: str) -> str:
        """Run a script to its end and return what it printed."""
        made = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", script],
            cwd=self.folder,
            env={**self.environment, **more},
            capture_output=True,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )
        assert made.returncode == 0, f"{made.stdout}\n{made.stderr}"
        assert "Traceback" not in made.stderr
        return made.stdout


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Desk:
    """A folder with ``my-campaign``, recorded through a coupler that forgets."""
    folder = tmp_path_factory.mktemp("desk")
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        effects=(make_effect("coupler_highpass", {"time_constant_s": 5e-3}),),
    )
    made = simulate_campaign(settings, 3)
    write_campaign_folder(folder / "my-campaign", made)
    write_campaign_folder(folder / "impactd-demo" / "shots", made)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    clean = {k: v for k, v in os.environ.items() if not k.startswith("IMPACTD_")}
    return Desk(folder, {**clean, "PATH": path, "PYTHONPATH": str(ROOT)})


@pytest.fixture(scope="module")
def rig(desk: Desk) -> Iterator[Desk]:
    """The same desk beside a daemon on the simulated rig, with a token in the environment."""
    config = write_simulated_rig(desk.folder)
    where = ["--config", str(config), "--data", str(desk.folder / "rig")]
    with (desk.folder / "daemon.log").open("w") as log:
        daemon = subprocess.Popen(
            [sys.executable, "-m", "impactd", "serve", *where, "--port", "0", "--json"],
            stdout=subprocess.PIPE, stderr=log, text=True, cwd=desk.folder, env=desk.environment,
        )  # fmt: skip
    assert daemon.stdout is not None
    try:
        url = json.loads(daemon.stdout.readline())["url"]
        make = ["token", "create", "--scope", "operate", "--name", "me", *where]
        token = desk.run(" ".join(["impactd", *make])).strip()
        named = {"IMPACTD_URL": url, "IMPACTD_TOKEN": token}
        seated = Desk(desk.folder, {**desk.environment, **named})
        seated.run("until impactd status | grep -q '^READY'; do sleep 0.5; done")
        yield seated
    finally:
        daemon.terminate()
        daemon.wait(timeout=60)
        daemon.stdout.close()


@pytest.mark.timeout(LIMIT_S)
def test_the_notebook_of_the_front_page_runs(desk: Desk) -> None:
    """Ten lines take somebody's own csv, fit, diagnose and plot, without a daemon."""
    text = (ROOT / "README.md").read_text()
    section = text[text.index("## In a notebook") : text.index("## On a real rig")]
    parts = re.findall(r"```(sh|python)\n(.*?)```", section, flags=re.S)
    text = "\n".join(code for language, code in parts if language == "python")
    code = [line for line in text.splitlines() if line.strip() and "import" not in line]
    assert len(code) <= 10
    times_s = np.arange(40_000) / 50e3
    force = np.random.default_rng(1).normal(0.0, 0.05, times_s.size)
    for begin in (8000, 20_000, 32_000):
        force[begin : begin + 60] += 50 * np.sin(np.pi * np.arange(60) / 60) ** 1.5
    np.savetxt(
        desk.folder / "my-hits.csv", np.column_stack((times_s, force)),
        delimiter=",", header="time_s,force_N", comments="",
    )  # fmt: skip
    made = ("sh", "impactd new my-hits.csv --out my-drops")  # as the section before it does
    said = desk.run(script_of([made, *parts]))
    assert "coupler_highpass" in said
    for name in re.findall(r'savefig\("(.*?)"\)', text):
        assert (desk.folder / name).stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.timeout(LIMIT_S)
def test_the_tutorial_leads_from_text_files_to_the_true_modulus(desk: Desk, tmp_path: Path) -> None:
    """Block after block, each in a process of its own: KV closed holds the truth, HSD does not."""
    here = Desk(tmp_path, desk.environment)
    text = (GUIDES / "tutorial.md").read_text()
    tell = """print("truth", made["truth"]["surfaces"]["specimen"]["plane_strain_modulus_Pa"])"""
    said = ""
    for language, code in blocks(GUIDES / "tutorial.md"):
        if language == "sh":
            said += here.run(code)
        else:
            more = tell if "simulate_campaign(" in code else ""
            said += here.run(f"python - <<'END OF PYTHON'\n{code}\n{more}\nEND OF PYTHON")
    truth_gpa = float(re.search(r"^truth (\S+)", said, flags=re.M)[1]) / 1e9
    found = {
        model: (float(low), float(high))
        for model, low, high in re.findall(r"^(\w+): (\S+) to (\S+) GPa", said, flags=re.M)
    }
    assert found["kv2"][0] <= truth_gpa <= found["kv2"][1]
    assert truth_gpa < found["hsd"][0]
    assert f"specimen is {truth_gpa:.2f} GPa" in " ".join(text.split())
    assert "ADEQUATE" in said
    for name in ("my-drops/recordings.png", "shot.png", "residuals.png", "diagnosis.html"):
        assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.timeout(LIMIT_S)
def test_the_scientists_guide_runs(desk: Desk) -> None:
    """A campaign is fitted, judged, drawn and diagnosed as the guide says."""
    said = desk.run(script_of(blocks(GUIDES / "scientist.md")))
    assert "IDENTIFIED" in said
    assert "residual_above_noise" in said
    for name in ("residuals.pdf", "moduli.pdf", "traces.svg", "network.svg", "diagnosis.html"):
        assert (desk.folder / name).is_file()


@pytest.mark.slow
@pytest.mark.timeout(LIMIT_S)
def test_the_technicians_day_runs(rig: Desk) -> None:
    """Light, calibration, drops, picture, result, abort: line by line."""
    said = rig.run(script_of(blocks(GUIDES / "technician.md")))
    assert "READY" in said
    assert "Advice: " in said
    assert (rig.folder / "shot9.png").is_file()
    assert "specimen" in (rig.folder / "moduli.csv").read_text(encoding="utf-8-sig")


@pytest.mark.timeout(LIMIT_S)
@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_examples_of_the_interface_run(rig: Desk) -> None:
    """Drops, shots, a problem and events by curl; a drop, a series and tables by Python."""
    rig.run("until impactd status | grep -q '^READY'; do sleep 0.5; done")
    said = rig.run(script_of(blocks(GUIDES / "api.md")))
    assert '"remedy"' in said
    assert "fitted" in said
    assert "Shot " in said
    assert (rig.folder / "shot.h5").stat().st_size > 100_000


@pytest.mark.slow
@pytest.mark.timeout(LIMIT_S)
def test_an_effect_a_board_and_a_reader_are_added_as_the_engineers_guide_says(
    desk: Desk, tmp_path: Path
) -> None:
    """In a copy of the packages: the effect is listed and fitted, valve and reader work."""
    for package in ("impactd", "drivers", "analysis"):
        shutil.copytree(
            ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copytree(ROOT / "config", tmp_path / "config")
    shutil.copytree(desk.folder / "my-campaign", tmp_path / "my-campaign")
    parts = blocks(GUIDES / "engineer.md")
    _install(tmp_path, (GUIDES / "engineer.md").read_text())
    for _, text in (part for part in parts if part[0] == "python"):
        name = re.match(r"# (\S+\.py)\n", text)
        assert name is not None
        (tmp_path / name[1]).write_text(text)
    here = Desk(tmp_path, {**desk.environment, "PYTHONPATH": str(tmp_path)})
    said = here.run(
        script_of([part for part in parts if part[0] == "sh"])
        + "\npython file_valve.py\npython use_reader.py"
    )
    assert "kv2+negative_gain" in said


def _install(folder: Path, document: str) -> None:
    """Register the entry point of a document as an installed package does."""
    toml = re.search(r"```toml\n(.*?)```", document, flags=re.S)
    assert toml is not None
    project = tomllib.loads(toml[1])["project"]
    ((group, entries),) = project["entry-points"].items()
    lines = [f"[{group}]", *(f"{name} = {where}" for name, where in entries.items())]
    made = folder / "npy_folder-1.dist-info"
    made.mkdir()
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: npy-folder\nVersion: 1\n")
    (made / "entry_points.txt").write_text("\n".join(lines))
