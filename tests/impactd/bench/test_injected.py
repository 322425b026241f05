"""Effects are put into recordings as they are said to be, and what is said of them is counted."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from analysis import load_campaign
from impactd.bench.injected import EFFECTS, Case, Said, drawn_cases, injected, main, table

RATE_HZ, SAMPLES = 1e5, 4000
RECORDINGS = Path(__file__).parents[4] / "shared" / "data"


def folder_of_hits(where: Path, samples: int = SAMPLES) -> Path:
    """Write a campaign folder of three pulses on a line that is not zero."""
    where.mkdir(parents=True)
    t = (np.arange(samples) - 400) / RATE_HZ
    shots = []
    for number in range(3):
        noise = np.random.default_rng(number).normal(0.0, 1e-4, samples)
        np.save(
            where / f"{number}.npy", 0.5 + (1 + 0.1 * number) * np.exp(-((t / 1e-4) ** 2)) + noise
        )
        about = {"sample_rate_Hz": RATE_HZ, "trigger_index": 390, "quantity": "force_N"}
        shots.append({"file": f"{number}.npy", **about})
    document = {"format": "impactd-campaign/1", "spheres": {}, "surfaces": {}, "shots": shots}
    (where / "campaign.json").write_text(json.dumps(document))
    return where


def test_hum_is_asked_only_where_a_record_holds_a_period(tmp_path: Path) -> None:
    """And every set is judged as it is, once."""
    folder_of_hits(tmp_path / "long")
    folder_of_hits(tmp_path / "short", samples=1000)
    cases = list(drawn_cases(tmp_path, range(2)))
    assert sum(case.effect == "" for case in cases) == 2
    assert {Path(c.folder).name for c in cases if c.effect == "mains_hum"} == {"long"}
    assert {case.effect for case in cases} == {"", *EFFECTS}
    assert len(cases) == 2 + 2 * (4 + 3)


def test_what_is_put_in_is_what_is_said(tmp_path: Path) -> None:
    """A ceiling, a tail that dies away, a tone, noise that is cut; nothing leaves all as it was."""
    campaign = load_campaign(folder_of_hits(tmp_path / "a"))

    def first(effect: str, size: float) -> np.ndarray:
        """Return the first record with its line taken off."""
        changed = injected(campaign, Case("", effect, 1, size))
        return np.asarray(changed.shots[0].signal) - 0.5

    assert injected(campaign, Case("", "", 1)) is campaign
    assert np.sum(first("clipping", 0.6) > 0.6 * 1.099) > 5
    assert first("clipping", 0.6).max() == pytest.approx(0.6 * 1.1, rel=1e-2)
    behind = np.cumsum(first("coupler_highpass", 1e-3))
    assert behind[-1] < 0.1 * behind[420]
    tone = first("mains_hum", 0.05)[1000:3000]
    assert np.ptp(tone) == pytest.approx(2 * 0.05 * 1.1, rel=0.05)
    quiet = first("amplifier_lowpass", 0.1)[:300]
    assert np.std(quiet) < 0.7 * np.std(campaign.shots[0].signal[:300])


def test_the_table_counts_what_was_named() -> None:
    """A name on an untouched set is wrong, and so is an effect that is not named."""
    case = Case("data/hammer", "clipping", 0, 0.6)
    bare = dataclasses.replace(case, effect="", size=0.0)
    said = [
        Said(case, "partial", ("clipping",), 0, 1.0),
        Said(case, "unknown", (), 0, 1.0),
        Said(bare, "unknown", (), 0, 1.0),
        Said(bare, "partial", ("echo",), 0, 1.0),
    ]
    shown = table(said)
    assert "| nothing | 1 of 2 | 1 of 2 |" in shown
    assert "| clipping | 1 of 2 | 1 of 2 |" in shown
    assert "named in 1 of 2" in shown


def test_without_recordings_it_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An empty folder is wrong usage."""
    assert main(["--data", str(tmp_path)]) == 2
    assert "holds no campaign folder" in capsys.readouterr().err


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the shared recordings are not here")
def test_a_real_set_is_judged_and_written_down(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hammer with a ceiling: named, in one line of JSON and one of the table."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "hammer").symlink_to(RECORDINGS / "hammer")
    out = tmp_path / "cases.jsonl"
    words = ["--data", str(tmp_path / "data"), "--draws", "1", "--only", "clipping"]
    assert main([*words, "--budget", "5", "--json", str(out)]) == 0
    line = json.loads(out.read_text())
    assert line["names"] == ["clipping"]
    assert "| clipping | 1 of 1 | 1 of 1 |" in capsys.readouterr().out
