"""`impactd plot` finds the thing, fits it where need be and writes a figure."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from matplotlib.image import imread

from impactd.settings.settings import find_config

BEGINS = {".png": b"\x89PNG", ".pdf": b"%PDF-1", ".svg": b"<?xml"}
MATRIX = {
    "format": "impactd-blind-confusion/1",
    "rows": ["none", "echo"],
    "columns": ["adequate", "echo", "echo|clipping"],
    "counts": {"all": [[5, 0, 0], [1, 3, 1]], "detectable": [[5, 0, 0], [0, 3, 1]]},
    "trials": {},
}


@pytest.mark.parametrize("kind", ["residuals", "traces", "moduli", "trace"])
def test_a_campaign_is_drawn(kind, run, small_campaign, tmp_path):
    """Each kind of figure comes as a picture that is wider than a thumbnail."""
    out = tmp_path / "x.png"
    made = run("plot", small_campaign, "--kind", kind, "--out", out)
    assert made.exit_code == 0, made.output
    assert made.output.strip() == str(out)
    height, width = imread(out).shape[:2]
    assert width > 1000
    assert height > 400


@pytest.mark.parametrize("ending", BEGINS)
def test_the_ending_chooses_the_format_and_the_bytes_are_the_same_again(ending, run, tmp_path):
    """PDF, SVG and PNG; a figure in version control changes only when its data do."""
    files = [tmp_path / f"{name}{ending}" for name in "ab"]
    for file in files:
        assert run("plot", "figure-2", "-o", file).exit_code == 0
    first, second = (file.read_bytes() for file in files)
    assert first == second
    assert first.startswith(BEGINS[ending])


def test_other_endings_are_refused_before_any_work(run, tmp_path):
    """A typing error costs no fit."""
    made = run("plot", tmp_path / "no.json", "--out", "x.jpeg")
    assert made.exit_code == 2
    assert ".pdf or .svg or .png" in made.stderr


def test_what_was_written_by_other_commands_is_drawn(run, small_campaign, tmp_path):
    """The JSON of a fit gives the moduli; that of a blind trial its confusion matrix."""
    fit, matrix = tmp_path / "fit.json", tmp_path / "m.json"
    assert run("fit", small_campaign, "--json", fit).exit_code == 0
    matrix.write_text(json.dumps(MATRIX))
    for file in (fit, matrix):
        out = file.with_suffix(".svg")
        told = run("plot", file, "--out", out, "--json")
        assert told.exit_code == 0, told.output
        assert json.loads(told.output)["file"] == str(out)
    assert "echo|clipping" in matrix.with_suffix(".svg").read_text()
    assert "reference" in fit.with_suffix(".svg").read_text()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("not json", "is no JSON"),
        ('{"format": "recipe/1"}', "'recipe/1'"),
        ("[]", "no calibration"),
    ],
)
def test_what_cannot_be_drawn_is_one_sentence(content, said, run, tmp_path):
    """Files of another kind are named with what is wrong."""
    file = tmp_path / "thing.json"
    file.write_text(content)
    made = run("plot", file, "--out", tmp_path / "x.png")
    assert said in str(made.exception)


def test_a_shot_of_a_campaign_is_named(run, small_campaign, tmp_path):
    """An unknown name is told with some that are there."""
    made = run("plot", small_campaign, "--shot", "shot99", "--out", tmp_path / "x.png")
    assert "shot99" in str(made.exception)
    assert "shot000" in str(made.exception)


def test_a_shot_file_is_drawn_without_a_daemon(run, small_campaign, tmp_path):
    """A downloaded .h5 has all that is needed, after a way through an archive too."""
    where = ("--config", find_config("simulated.toml"), "--data", tmp_path / "archive")
    assert run("import", small_campaign, *where).exit_code == 0
    file = tmp_path / "mine.h5"
    shutil.copy(next(Path(tmp_path / "archive").glob("shots/*.h5")), file)
    made = run("plot", file, "--out", tmp_path / "x.svg")
    assert made.exit_code == 0, made.exception
    drawn = (tmp_path / "x.svg").read_text()
    for words in ("signal / V", "HSD leaves", "KV leaves", "time after touch-down / µs", "GPa"):
        assert words in drawn
