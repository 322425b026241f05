"""Shots that were set aside: on the page, on a terminal, and in the schema."""

from __future__ import annotations

import base64
import copy
import json
import re
from importlib import resources
from typing import Any

import jsonschema_rs
import pytest

from impactd.console.diagnoses import summary
from impactd.diagnosis.report import page
from impactd.diagnosis.set_aside import likely_words, shot_words

BECAUSE = "It leaves 6.82 times the noise, its 2 repetitions leave noise. It is like <acetal>."


def odd(shot: int, name: str = "shot.npy", **likely: str | float) -> dict[str, Any]:
    """Return a shot that was set aside, as the JSON carries it."""
    curves = {
        "time_us": [1500.0, 1501.0, 1502.0, 1503.0],
        "signal": [0.0, 1.25, 0.5, 0.0],
        "as_labelled": [0.0, 1.0, 0.75, None],
    }
    return {"shot": shot, "name": name, "because": BECAUSE, "likely": likely, "curves": curves}


@pytest.fixture
def with_odd_shots(document):
    """Return a maker of diagnoses with these shots set aside."""
    return lambda *shots: {**copy.deepcopy(document), "set_aside": list(shots)}


def words(made: str) -> str:
    """Return a page's words, escaped, and those inside its pictures."""
    drawn = re.findall(r"data:image/svg[^,]*,([^\"]*)", made)
    shown = re.sub(r"<img[^>]*>", "", made)
    return " ".join([shown, *(base64.b64decode(one).decode() for one in drawn)])


def test_the_page_shows_each_shot_that_was_set_aside(with_odd_shots):
    """Number, file, reason and picture, in the unit of the page, before what was found."""
    text = words(page(with_odd_shots(odd(17, "Shot_017.NPY", sphere="acetal"))))
    assert "1 more set aside" in text
    assert "<h2>Shots set aside</h2>" in text
    assert text.index("Shots set aside") < text.index("The error before and after")
    assert "Shot 17 (Shot_017.NPY). It leaves 6.82 times" in text
    assert "is like &lt;acetal&gt;." in text
    for drawn in (
        "shot 17 (Shot_017.NPY)",
        "model, as labelled",
        "signal / mV",
        "time in the record",
    ):
        assert f"{drawn}" in text
    assert "more are not drawn" not in text


def test_more_than_six_shots_are_listed_and_not_all_drawn(with_odd_shots):
    """Each of eight has its line; the caption says that two have no picture."""
    text = words(page(with_odd_shots(*(odd(place) for place in range(8)))))
    assert all(f"Shot {place} (shot.npy). It leaves" in text for place in range(8))
    assert "2 more are not drawn." in text
    assert ">shot 5 (shot.npy)</text>" in text
    assert ">shot 6 (shot.npy)</text>" not in text


def test_a_shot_without_curves_is_listed_without_a_picture(with_odd_shots):
    """The schema does not ask for curves."""
    bare = odd(3)
    del bare["curves"]
    text = words(page(with_odd_shots(bare)))
    assert "Shot 3 (shot.npy). It leaves" in text
    assert "as labelled" not in text


def test_without_odd_shots_nothing_is_said_of_them(document, with_odd_shots):
    """Neither where all shots belong nor in a document from before they were looked for."""
    older = copy.deepcopy(document)
    older.pop("set_aside", None)
    for plain in (older, with_odd_shots()):
        assert "et aside" not in words(page(plain))
        assert "et aside" not in summary(plain)


def test_a_terminal_has_a_line_for_each_shot_that_was_set_aside(with_odd_shots):
    """Below the verdict: which, and what it is most like, in lines of 100 columns."""
    long = odd(4, "the_recording_of_a_tuesday_with_a_name_much_longer_than_others.npy", gain=0.625)
    told = summary(with_odd_shots(odd(17, sphere="acetal_small"), long, odd(5)))
    verdict, lines, *_ = told.split("\n\n")
    assert verdict.startswith("IDENTIFIED")
    assert lines.startswith("Set aside: shot 17 (shot.npy): most like sphere acetal_small\n")
    assert "a gain of 0.625 of the others'" in " ".join(lines.split())
    assert lines.endswith("shot 5 (shot.npy)")
    assert max(len(line) for line in lines.splitlines()) <= 100


def test_a_stored_shot_is_called_by_its_number_in_the_archive():
    """Its place in the campaign is another number, which nobody can look up."""
    assert shot_words(odd(16, "shot 231")) == "shot 231"
    assert shot_words(odd(16, "shot231.npy")) == "shot 16 (shot231.npy)"


@pytest.mark.parametrize(
    ("likely", "said"),
    [
        ({"sphere": "a", "surface": "b"}, "sphere a, surface b"),
        ({"drop_height_m": 0.02861}, "a drop from 28.6 mm"),
        ({"gain": 0.5}, "a gain of 0.5 of the others'"),
        ({}, ""),
    ],
)
def test_what_a_shot_is_like_is_said_in_words(likely, said):
    """Label, height in mm, or gain; nothing where nothing explains it."""
    assert likely_words(odd(1, **likely)) == said


def test_a_shot_that_was_set_aside_is_as_the_schema_says(with_odd_shots):
    """Its reason and what it is like are asked for, its curves are not; no height is negative."""
    text = resources.files("impactd.schemas").joinpath("diagnosis.json").read_text("utf-8")
    validator = jsonschema_rs.validator_for(json.loads(text))
    validator.validate(with_odd_shots(odd(17, sphere="acetal"), odd(3)))
    bare = odd(3, gain=1.3)
    del bare["curves"]
    validator.validate(with_odd_shots(bare))
    del bare["because"]
    assert not validator.is_valid(with_odd_shots(bare))
    assert not validator.is_valid(with_odd_shots(odd(3, drop_height_m=-0.01)))
