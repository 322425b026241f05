"""Three files as LabVIEW wrote them, against the same impacts as somebody's own script cut them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis import load_campaign
from impactd.cli import app

DATA = Path(__file__).parents[4] / "shared" / "data"
RAW = sorted((DATA / "raw" / "board-impacts").glob("*.lvm"))


@pytest.mark.skipif(not RAW, reason="the measured recordings are not here")
def test_raw_labview_files_become_a_campaign_in_one_command(tmp_path: Path) -> None:
    """Changing time formats and a stray fourth column are no matter; the samples are the same."""
    words = ["new", *map(str, RAW), "--unit", "g", "--out", str(tmp_path / "out"), "--yes"]
    made = CliRunner().invoke(app, words, catch_exceptions=False)
    assert made.exit_code == 0, made.output
    assert "column 4 is filled in 1 of 20000 rows only" in made.output
    ours = load_campaign(tmp_path / "out")
    theirs = {str(int(shot.name)): shot for shot in load_campaign(DATA / "board-impacts").shots}
    assert [shot.name for shot in ours.shots] == ["03", "05", "07"]
    for shot in ours.shots:
        known = theirs[str(int(shot.name))]
        assert shot.quantity == known.quantity
        assert shot.sample_rate_hz == pytest.approx(known.sample_rate_hz, rel=1e-6)
        shift = int(np.argmax(shot.signal)) - int(np.argmax(known.signal))
        # of a contact of 41 samples
        assert abs(shot.trigger_index - known.trigger_index - shift) <= 5
        first, count = known.trigger_index - 150, 1200
        wanted = known.signal[first : first + count]
        got = shot.signal[first + shift : first + shift + count]
        assert np.max(np.abs(got - wanted)) < 1e-3  # the files print a millionth of a g
