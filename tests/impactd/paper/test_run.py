"""The command from simulated rigs to page, pictures and JSON."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from impactd.console.failure import Failure
from impactd.paper.run import run_paper


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return the folder and the JSON of a run with two rigs."""
    out = tmp_path_factory.mktemp("paper")
    run_paper(out=out, rigs=2, seed=1, as_json=False)
    return out, json.loads((out / "paper.json").read_text())


def test_everything_is_left_in_the_folder(written: tuple[Path, dict[str, Any]]) -> None:
    """Page, JSON and five pictures, with the command that makes them again."""
    out, found = written
    page = (out / "paper.md").read_text()
    assert f"impactd paper --out {out} --rigs 2 --seed 1" in page
    assert "{" not in page
    pictures = sorted(path.name for path in (out / "pictures").iterdir())
    assert len(pictures) == 5
    assert all(f"pictures/{name}" in page for name in pictures)
    assert found["format"] == "impactd-paper/1"
    assert (len(found["claims"]), found["rigs"], len(found["tables_4_5"])) == (24, 2, 19)


def test_calibrations_find_what_the_drops_identify(written: tuple[Path, dict[str, Any]]) -> None:
    """Gain, frequency and damping to 0.2 %; M singly only to its certificate (Table 3: 9 %)."""
    cell = written[1]["table3"]["cell"]
    for name in ("gain_N_per_V", "natural_frequency_Hz", "damping_ratio"):
        assert cell[name]["rms_relative_error"] < 2e-3
    assert 2e-3 < cell["crystal_mass_kg"]["rms_relative_error"] < 0.1


def test_a_rigid_cell_calibrates_as_in_table_3(written: tuple[Path, dict[str, Any]]) -> None:
    """S below k c whichever way; R2 near Table 3's 0.70 +- 0.18; KV's is 1 on a KV cell."""
    table = written[1]["table3"]
    true = table["cell"]["gain_N_per_V"]["true"][0]
    gains = [table["hsd_gain_N_per_V"][way][0] for way in ("peak", "aligned", "onset")]
    assert all(0.6 * true < gain < 0.95 * true for gain in gains)
    for way in ("hsd_aligned", "hsd_onset"):
        mean, std = table["r2"][way]
        assert mean == pytest.approx(0.78, abs=0.05)
        assert std == pytest.approx(0.18, abs=0.05)
    assert table["r2"]["kv"][0] > 0.999


def test_kv_is_unbiased_and_hsd_is_not(written: tuple[Path, dict[str, Any]]) -> None:
    """Each pair's E*: KV within 0.3 %; HSD 1.7-2.1 times for polypropylene on plastics."""
    rows = {(r["sphere"], r["surface"]): r for r in written[1]["tables_4_5"]}
    assert all(abs(r["ratio"]["kv_joint"][0] - 1) < 3e-3 for r in rows.values())
    assert all(r["ratio"]["hsd_onset"][0] < 1.01 for r in rows.values())
    for surface in ("pvc", "polycarbonate"):
        assert 1.6 < rows["polypropylene", surface]["ratio"]["hsd_aligned"][0] < 2.1
    assert rows["steel", "aluminium"]["ratio"]["hsd_onset"][0] == pytest.approx(0.27, abs=0.06)
    assert rows["ptfe", "ptfe"]["ratio"]["hsd_aligned"][0] == pytest.approx(0.86, abs=0.04)
    r2 = written[1]["mean_r2"]
    assert r2["kv_joint"] > 0.999
    assert r2["hsd_aligned"] == pytest.approx(0.85, abs=0.04)


def test_the_split_of_moduli_is_where_the_search_began(
    written: tuple[Path, dict[str, Any]],
) -> None:
    """Six starts, one E*, one cost, sphere's moduli apart by more than a factor of 2."""
    found = written[1]["valley"]
    moduli = [fit["reduced_modulus_Pa"] for fit in found["fits"]]
    spheres = [fit["sphere_Pa"] for fit in found["fits"]]
    assert max(moduli) / min(moduli) - 1 < 1e-5
    assert max(fit["excess_chi2"] for fit in found["fits"]) < 1e-2
    assert max(spheres) / min(spheres) > 2
    assert found["correlation_ln_moduli"] == pytest.approx(-1.0, abs=1e-9)


def test_one_rig_has_no_spread(tmp_path: Path) -> None:
    """A person who asks for one rig is told what to ask for."""
    with pytest.raises(Failure, match="--rigs 2"):
        run_paper(out=tmp_path, rigs=1, seed=1, as_json=False)


def test_the_commands_help_loads_nothing_heavy() -> None:
    """`impactd paper --help` answers from names and options alone."""
    code = (
        "import sys; from impactd.cli import app\n"
        "try: app(['paper', '--help'], prog_name='impactd')\n"
        "except SystemExit as end: assert not end.code\n"
        "assert not {'numpy', 'numba', 'scipy', 'matplotlib'} & set(sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "--rigs" in result.stdout
