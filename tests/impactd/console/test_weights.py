"""The table of weights that `impactd calibrate --static` reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from impactd.console.calibrations import readings_of
from impactd.console.failure import Failure


def test_readings_are_read(tmp_path: Path) -> None:
    """Columns in any order, a byte order mark, blanks, an uncertainty left out."""
    file = tmp_path / "weights.csv"
    file.write_text("\ufeffvolts, mass_kg,u_volts\n0.01,0,1e-4\n2.76,0.5,\n", encoding="utf-8")
    assert readings_of(file) == [
        {"volts": 0.01, "mass_kg": 0.0, "u_volts": 1e-4},
        {"volts": 2.76, "mass_kg": 0.5},
    ]


@pytest.mark.parametrize(
    "text", ["mass,volts\n1,2\n", "", "mass_kg,volts\n1,x\n", "mass_kg,volts\n1\n"]
)
def test_other_tables_are_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    """Wrong columns, an empty file, a word for a number, a missing cell: each names the file."""
    file = tmp_path / "weights.csv"
    file.write_text(text)
    with pytest.raises(Failure, match=r"weights\.csv"):
        readings_of(file)
