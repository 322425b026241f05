"""Trials in a file: written as they end, gone on with, counted."""

from __future__ import annotations

import dataclasses
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated.mistakes import Mistake
from impactd.bench.blind import runs, trial
from impactd.bench.blind.__main__ import main
from impactd.bench.blind.plan import draw_plan
from impactd.bench.blind.runs import Task, read, run_into
from impactd.bench.blind.trial import Trial
from impactd.bench.blind.visibility import VISIBLE, visibility
from impactd.bench.simulated_campaign import simulated_campaign

ATrial = Callable[..., Trial]


def written(path: Path, *trials: Trial) -> Path:
    """Write trials as lines."""
    path.write_text("".join(json.dumps(t.to_json()) + "\n" for t in trials))
    return path


def test_a_run_goes_on_behind_the_last_whole_line(tmp_path: Path, a_trial: ATrial) -> None:
    """What a file holds is not run again; what a kill cut short is dropped."""
    path = written(tmp_path / "t.jsonl", a_trial("echo", named=["echo"]))
    with path.open("a") as out:
        out.write('{"kind": "library", "se')
    assert list(run_into(path, [Task("library", 1)])) == []
    assert [t.seed for t in read([path])] == [1]


def test_a_line_that_is_no_trial_is_named(tmp_path: Path) -> None:
    """With file, line and what to do."""
    path = tmp_path / "t.jsonl"
    path.write_text('{"kind": "library"}\n')
    with pytest.raises(ValueError, match=r"t\.jsonl, line 1 is no trial"):
        read([path])


def test_the_table_is_printed_from_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], a_trial: ATrial
) -> None:
    """Shares with goals, one row an effect, and who was taken for whom as data."""
    path = written(
        tmp_path / "t.jsonl",
        a_trial("echo", named=["echo"], seed=1, visible=9e4, visible_each=[9e4], seconds=3.0),
        a_trial("echo", named=["clipping"], seed=2, visible=9e4, visible_each=[9e4], seconds=4.0),
        a_trial("echo", verdict="adequate", seed=3, visible=9.0, visible_each=[9.0]),
        a_trial(kind="clean", seed=4, verdict="adequate"),
    )
    matrix = tmp_path / "matrix.json"
    assert main(["--table", str(path), "--confusion", str(matrix)]) == 0
    printed = capsys.readouterr().out
    assert (
        "| clean called discrepant, white and AR(1) | 1 | 0 | 0 .. 0.793 | <= 0.01 | met |"
        in printed
    )
    assert "| library: right name or family | 2 | 0.5 |" in printed
    assert "| library: wrong name | 2 | 0.5 |" in printed
    assert "| echo | electronics | 3 | 2 | 2 | 1 |  | 1 |" in printed
    found = json.loads(matrix.read_text())
    assert found["rows"] == ["none", "echo"]
    assert found["columns"] == ["adequate", "clipping", "echo"]
    assert found["counts"]["all"] == [[1, 0, 0], [1, 1, 1]]
    assert found["counts"]["detectable"] == [[0, 0, 0], [0, 1, 1]]


def test_what_cannot_be_simulated_ends_no_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], a_trial: ATrial
) -> None:
    """A draw beyond the simulator is written down with its reason, and counts nowhere."""
    path = written(tmp_path / "t.jsonl", a_trial("echo", named=["echo"], seed=1))
    beyond = Task("pair", 46_300_024, "closed")  # relaxation of 3.5 us on a tape of 7e8 N/m
    (ended,) = run_into(path, [beyond])
    assert not ended.was_simulated
    assert ended.truth == ["stress_relaxation", "adhesive_layer"]
    assert "more than 400000 steps" in str(ended.error)
    matrix = tmp_path / "matrix.json"
    assert main(["--table", str(path), "--confusion", str(matrix)]) == 0
    assert "Not simulated and not counted: 1." in capsys.readouterr().out
    assert json.loads(matrix.read_text())["rows"] == ["echo"]


def test_an_effect_shows_as_far_as_its_size() -> None:
    """By the simulator's account, a trial's effects count from the noise alone upwards."""
    plan = draw_plan("library", 1)
    seen = visibility(plan, simulated_campaign(plan.settings, plan.campaign_seed))
    assert seen is not None
    assert seen.together > VISIBLE
    clean = draw_plan("clean", 1)
    assert visibility(clean, simulated_campaign(clean.settings, clean.campaign_seed)) is None


def test_a_mistake_shows_as_far_as_the_base_model_stumbles_over_it() -> None:
    """One shot at nine tenths is plain to see, a mass that is stated right is not."""
    plan = draw_plan("mistake", 1)
    campaign = simulated_campaign(plan.settings, plan.campaign_seed)
    odd = Mistake("odd_shot", {"shot": 5}, {"factor": 0.9})
    seen = visibility(dataclasses.replace(plan, mistake=odd), campaign)
    assert seen is not None
    assert seen.each == [seen.together]
    assert seen.together > VISIBLE
    none = Mistake("wrong_mass", {"sphere": "acetal_small"}, {"factor": 1.0})
    seen = visibility(dataclasses.replace(plan, mistake=none), campaign)
    assert seen is not None
    assert seen.together == 0.0


def test_a_trial_takes_over_what_a_document_says_of_mistakes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Shots that were set aside, the scope of a wrong record, and the first shot of a change."""
    block: dict[str, Any] = {
        "chi2_per_dof": 1.0,
        "degrees_of_freedom": 9,
        "heldout_rms_V": None,
        "moduli": {},
    }
    change = {
        "id": "change_point",
        "slot": "record",
        "scope": {"cell": "gain"},
        "parameters": {"first_shot": {"value": 30}},
    }
    document: dict[str, Any] = {
        "verdict": "identified",
        "effects": [change],
        "set_aside": [{"shot": 17, "because": "of its size"}, {"shot": 3}],
        "slot": "record",
        "also_possible_slots": [],
        "p_value": None,
        "noise_rms_V": 1e-3,
        "before": block,
        "after": block,
        "trail": [{}],
    }
    monkeypatch.setattr(trial, "diagnose", lambda *_, **__: document)
    monkeypatch.setattr(trial, "visibility", lambda *_: None)
    found = trial.run_trial("mistake", 5)
    assert found.error is None
    drawn = draw_plan("mistake", 5).mistake
    assert drawn is not None
    assert found.mistake == drawn.to_json()
    assert found.acts_on == [{"cell": "gain", "first_shot": 30}]
    assert (found.named, found.set_aside) == (["change_point"], [3, 17])
    assert Trial.from_json(json.loads(json.dumps(found.to_json()))) == found
    del document["set_aside"]
    older = trial.run_trial("clean", 5)
    assert (older.error, older.mistake, older.set_aside) == (None, None, [])


def test_the_table_has_a_row_for_each_mistake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], a_mistake: ATrial, a_trial: ATrial
) -> None:
    """Where mistakes were made; confusion counts shots that were set aside, too."""
    path = written(
        tmp_path / "t.jsonl",
        a_mistake("odd_shot", seed=1, set_aside=[5]),
        a_mistake("odd_shot", seed=2, set_aside=[5, 6]),
        a_mistake("odd_shot", seed=3, verdict="unknown"),
        a_mistake("wrong_mass", seed=4, named=["adhesion"], acts_on=[{}]),
    )
    matrix = tmp_path / "matrix.json"
    assert main(["--table", str(path), "--confusion", str(matrix)]) == 0
    printed = capsys.readouterr().out
    assert "| odd_shot | 3 | 3 | 2 | 1 | 1 |  | 1 |  | 1 |  |  | 1e+04 |" in printed
    assert "| wrong_mass | 1 | 1 | 0 | 0 |  |  |  | 1 |" in printed
    found = json.loads(matrix.read_text())
    assert (found["rows"], found["columns"]) == (
        ["odd_shot", "wrong_mass"],
        ["unknown", "adhesion", "set_aside"],
    )
    assert found["counts"]["all"] == [[1, 0, 2], [0, 1, 0]]
    clean = written(tmp_path / "c.jsonl", a_trial(kind="clean", verdict="adequate"))
    assert main(["--table", str(clean)]) == 0
    assert "| mistake |" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_run_that_is_told_to_stop_leaves_no_workers(tmp_path: Path) -> None:
    """It ends within seconds, although trials take longer, and says how to go on."""
    command = "-m impactd.bench.blind --kind outside --seed-from 70 --campaigns 4 --workers 2"
    path = tmp_path / "t.jsonl"
    arguments = [sys.executable, *command.split(), "--out", str(path)]
    process = subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True)
    while not path.exists():  # opened when the run begins
        time.sleep(0.1)
    time.sleep(1.0)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)  # also waits for workers: they hold the pipe
    assert process.returncode == 130
    assert "Stopped" in said


@pytest.mark.slow
def test_a_trial_knows_both_sides(tmp_path: Path) -> None:
    """A trial's truth comes from the simulator, its verdict from the analysis."""
    path = tmp_path / "t.jsonl"
    (found,) = run_into(path, [Task("hsd", 90_001)])
    assert found.error is None
    assert found.truth == ["crystal_dynamics"]
    assert found.seconds is not None
    assert runs.read([path]) == [found]
