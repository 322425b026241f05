"""The import contracts hold, and a breach of each is caught."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import grimp
import pytest
from scipy.sparse import dok_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[2]
PACKAGES = ("impactd", "drivers", "analysis")


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the contracts over a copy of the packages."""
    return subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Copy the sources, to break them."""
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("module", "breach", "contract"),
    [
        ("analysis/errors.py", "import socket", "the analysis touches no files"),
        ("analysis/errors.py", "import drivers.errors", "strangers"),
        ("drivers/errors.py", "import impactd.events", "strangers"),
        ("drivers/errors.py", "import drivers.simulated.world", "real drivers never"),
        ("impactd/client/errors.py", "import impactd.storage.shots", "a client needs nothing"),
        (
            "analysis/diagnosis/basis/groupings.py",
            "import analysis.diagnosis.score_test",
            "the rooms of the diagnosis",
        ),
    ],
)
def test_a_breach_is_caught(module: str, breach: str, contract: str, copy: Path) -> None:
    """An import that a contract forbids breaks that contract, by name."""
    with (copy / module).open("a") as file:
        file.write(f"\n{breach}\n")
    result = lint_imports(copy)
    assert result.returncode == 1
    broken = [line for line in result.stdout.splitlines() if " BROKEN" in line]
    assert any(contract in line for line in broken), result.stdout


def test_no_module_of_the_analysis_needs_itself() -> None:
    """What a module imports while it runs never leads back to it."""
    graph = grimp.build_graph("analysis", exclude_type_checking_imports=True)
    modules = sorted(graph.modules)
    imports = dok_array((len(modules), len(modules)))
    for row, module in enumerate(modules):
        for imported in graph.find_modules_directly_imported_by(module):
            imports[row, modules.index(imported)] = 1
    _, group = connected_components(imports.tocsr(), connection="strong")
    circles = [
        [m for m, own in zip(modules, group, strict=True) if own == one]
        for one in range(len(modules))
        if list(group).count(one) > 1
    ]
    assert not circles
