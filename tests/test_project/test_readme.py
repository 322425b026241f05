"""README keeps its word: its links exist, its commands are real, its session runs."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.recordings import as_csv, simulated_drops

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```sh\n(.*?)```", README, flags=re.S)
LINES = [line for block in BLOCKS for line in block.splitlines()]
SESSION = next(block for block in BLOCKS if "impactd serve" in block)
OWN_CSV = next(block for block in BLOCKS if "values.json" in block)


GUIDES = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "impactd/guides").glob("*.md"))
LINKING = ["README.md", "systemd/README.md", "tests/README.md", "analysis/plots/README.md", *GUIDES]


@pytest.mark.parametrize("document", LINKING)
def test_links_lead_somewhere(document: str) -> None:
    """Every relative link and picture of a document is a file of the repository."""
    text = (ROOT / document).read_text()
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if not target.startswith("http"):
            assert ((ROOT / document).parent / target).exists(), f"{document} links to {target}"


def test_the_top_folder_holds_nothing_else() -> None:
    """The packages, settings, tests, units and the project's own files; no file left by a trial."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False, timeout=30
    )
    if listed.returncode:
        pytest.skip("this is no checkout")
    top = {name.partition("/")[0] for name in listed.stdout.splitlines()}
    folders = {"analysis", "config", "drivers", "impactd", "systemd", "tests"}
    files = {"CHANGELOG.md", "LICENSE", "Makefile", "README.md", "pyproject.toml"}
    assert {name for name in top if not name.startswith(".")} == folders | files


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize("line", [line for line in LINES if line.startswith("make ")])
def test_make_knows_each_target(line: str) -> None:
    """Each `make` command of the README is a target of the Makefile."""
    command = [*shlex.split(line), "--dry-run"]
    result = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30
    )
    assert result.returncode == 0, result.stderr


def test_makefile_lists_what_readme_names() -> None:
    """`make help` shows every target that the README names, with a line about it."""
    shown = subprocess.run(
        ["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True, timeout=30
    ).stdout
    for line in LINES:
        if line.startswith("make "):
            assert re.search(rf"^{line.split()[0]} {line.split()[1]}\s+\S", shown, flags=re.M)


@pytest.mark.parametrize(
    "document",
    [
        "README.md",
        "systemd/README.md",
        "impactd/README.md",
        "config/README.md",
        "impactd/certificates/README.md",
        "systemd/container/README.md",
        *GUIDES,
    ],
)
def test_each_command_and_option_exists(document: str) -> None:
    """Each `impactd` command in a document's blocks has a help page that names its options."""
    blocks = re.findall(r"```(?:sh)?\n(.*?)```", (ROOT / document).read_text(), flags=re.S)
    for line in "\n".join(blocks).splitlines():
        found = re.search(r"(?:^|\$\(|/bin/)impactd ((?:(?:token|certificate) )?[a-z-]+)(.*)", line)
        if not found or line.lstrip().startswith("#"):
            continue
        words, rest = found[1].split(), found[2]
        page = subprocess.run(
            [sys.executable, "-m", "impactd", *words, "--help"],
            capture_output=True,
            text=True,
            check=False,
            timeout=30,
        )
        assert page.returncode == 0, line
        for option in re.findall(r"--[a-z-]+", rest):
            assert option in page.stdout, f"{document}: {line}"


@pytest.mark.timeout(240)
def test_the_session_runs_as_printed(tmp_path: Path) -> None:
    """README's session by hand runs to its end, line by line, on a port of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    (tmp_path / "config").symlink_to(ROOT / "config")
    # as printed, but for the port, and a wait where a person would have typed the next line
    script = SESSION.replace(
        "impactd-data 2>impactd.log &",
        f"impactd-data --port {port} >impactd.log 2>&1 &\n"
        "daemon=$!\n"
        "trap 'kill $daemon; wait $daemon' EXIT\n"
        "until impactd status 2>&1 | grep -q '^READY'; do kill -0 $daemon; sleep 0.2; done",
    )
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        ["bash", "-euxo", "pipefail", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PATH": tools, "IMPACTD_URL": f"http://127.0.0.1:{port}"},
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    log = tmp_path / "impactd.log"
    said = log.read_text()[-2000:] if log.exists() else ""
    assert result.returncode == 0, f"{result.stdout}\n{result.stderr}\n{said}"
    assert "READY" in result.stdout
    assert (tmp_path / "my-campaign" / "campaign.json").is_file()


@pytest.mark.slow
def test_a_stranger_comes_from_a_csv_to_a_modulus_and_a_report(tmp_path: Path) -> None:
    """README's way from four CSVs of drops, line by line: the true modulus, and a verdict."""
    made = simulated_drops(0.02, 0.045)
    drops = zip(made["campaign"]["shots"], made["codes"], strict=True)
    in_order = sorted(drops, key=lambda drop: (drop[0]["surface"], drop[0]["drop_height_m"]))
    for number, (shot, codes) in enumerate(in_order, start=1):
        (tmp_path / f"drop-{number}.csv").write_bytes(as_csv(shot, codes, "time,volts"))
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", OWN_CSV], cwd=tmp_path,
        env={**os.environ, "PATH": tools}, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert result.returncode == 0, f"{result.stdout}\n{result.stderr}"
    (line,) = (one for one in result.stdout.split("ADEQUATE")[0].splitlines() if " fitted " in one)
    value, expanded = map(float, re.findall(r"([\d.]+) \+- ([\d.]+)", line)[-1])
    truth = made["truth"]["surfaces"]["specimen"]
    plane_strain_gpa = truth["youngs_modulus_Pa"] / (1 - truth["poissons_ratio"] ** 2) / 1e9
    assert abs(value - plane_strain_gpa) < expanded
    assert "ADEQUATE" in result.stdout
    assert "</html>" in (tmp_path / "my-diagnosis.html").read_text()
