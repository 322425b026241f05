"""What an installation gets is locked: every package by version and hash."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LOCK = (ROOT / "systemd" / "requirements.txt").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PYTHONS = ("3.11", "3.12", "3.13")


def locked(python: str) -> dict[str, Requirement]:
    """Return what the lock gives to a Python on Linux."""
    lines = re.sub(r"\\\n", " ", LOCK).splitlines()
    found = [Requirement(line.split(" --hash")[0]) for line in lines if not line.startswith("#")]
    here = {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": "linux"}
    return {
        canonicalize_name(entry.name): entry
        for entry in found
        if entry.marker is None or entry.marker.evaluate(here)
    }


@pytest.mark.parametrize("python", PYTHONS)
def test_the_lock_covers_every_dependency(python: str) -> None:
    """Each run-time and build requirement is locked to a version that satisfies it."""
    entries = locked(python)
    needed = PROJECT["project"]["dependencies"] + PROJECT["build-system"]["requires"]
    for requirement in map(Requirement, needed):
        entry = entries[canonicalize_name(requirement.name)]
        (pin,) = entry.specifier
        assert pin.operator == "=="
        assert requirement.specifier.contains(pin.version), f"{requirement}: run `make lock`"


def test_every_locked_package_has_hashes_and_no_address() -> None:
    """A package is its hash, wherever it is fetched from."""
    for line in re.sub(r"\\\n", " ", LOCK).splitlines():
        assert line.startswith("#") or " --hash=sha256:" in line
    assert "://" not in LOCK
    assert "index-url" not in LOCK


def test_the_documented_installation_uses_the_lock() -> None:
    """The README installs what is locked, and the project itself without looking further."""
    readme = (ROOT / "systemd" / "README.md").read_text()
    assert "pip install --require-hashes -r systemd/requirements.txt" in readme
    assert "pip install --no-deps --no-build-isolation ." in readme


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.skipif(
    importlib.util.find_spec("cyclonedx_py") is None, reason="cyclonedx-bom is not installed"
)
def test_the_bill_of_materials_names_every_locked_package(tmp_path: Path) -> None:
    """`make sbom` writes valid CycloneDX with the project and each package of the lock."""
    bill = tmp_path / "bill.json"
    tools = Path(sys.executable).parent
    command = ["make", "-o", ".venv/.tools-installed", "sbom", f"BIN={tools}", f"SBOM={bill}"]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=120)
    content = json.loads(bill.read_text())
    assert content["bomFormat"] == "CycloneDX"
    assert content["metadata"]["component"]["name"] == "impactd"
    there = {(part["name"], part["version"]) for part in content["components"]}
    for python in PYTHONS:
        for entry in locked(python).values():
            (pin,) = entry.specifier
            assert (entry.name, pin.version) in there
