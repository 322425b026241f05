"""The page: complete in itself, and saying what the JSON says."""

from __future__ import annotations

import base64
import copy
import re
from html.parser import HTMLParser

import pytest

from analysis.written_numbers import measured
from impactd.diagnosis.report import page, write_report

VOID = {"meta", "img", "br", "link"}


class Balanced(HTMLParser):
    """Checks that every element is closed, and collects what a page refers to."""

    def __init__(self):
        super().__init__()
        self.open, self.sources, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        """Remember an element."""
        if tag not in VOID:
            self.open.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        """Close it again."""
        assert self.open.pop() == tag

    def handle_data(self, data):
        """Collect text."""
        self.text.append(data)


def read(made: str) -> Balanced:
    """Return a page as a browser takes it apart."""
    reader = Balanced()
    reader.feed(made)
    assert reader.open == []
    return reader


def test_the_page_is_one_file_that_needs_no_other(document, tmp_path):
    """Pictures are inside; nothing is fetched."""
    file = tmp_path / "report.html"
    write_report(file, document)
    reader = read(file.read_text(encoding="utf-8"))
    assert len(reader.sources) >= 4
    assert all(source.startswith("data:image/") for source in reader.sources)


def test_the_page_tells_the_whole_story(document):
    """Verdict, effect, both errors, every candidate, what remains and what to drop next."""
    text = " ".join(read(page(document)).text)
    for said in (
        "identified",
        document["sentence"],
        "time_constant_s",
        f"{document['before']['heldout_rms_V'] * 1e3:.4g}",
        f"{document['after']['heldout_rms_V'] * 1e3:.4g}",
        "specimen",
        "What remains",
        "What to drop next",
        *(line["id"] for line in document["candidates"]),
    ):
        assert said in text


def test_the_answer_and_the_modulus_come_first(document):
    """Verdict, then the modulus with its unit, then the errors."""
    text = " ".join(read(page(document)).text)
    modulus = measured(
        document["after"]["moduli"]["specimen"]["youngs_modulus_Pa"], scale=1e-9, sign="±"
    )
    places = [
        text.index(said) for said in (document["sentence"], f"{modulus} GPa", "error on held-out")
    ]
    assert places == sorted(places)


def test_a_reference_shows_what_was_stated_beside_what_the_shots_make_of_it(document):
    """Prior and posterior of one material are two numbers, and each is named."""
    found = document["after"]["moduli"]["aluminium"]
    stated, now = (
        measured(found[key], scale=1e-9, sign="±")
        for key in ("stated_youngs_modulus_Pa", "youngs_modulus_Pa")
    )
    (row,) = re.findall(r"<tr><td>aluminium</td><td>reference</td>.*</tr>", page(document))
    assert f"<td>{now}</td>" in row
    assert f">stated {stated}<" in row


def test_pictures_of_pure_noise_are_folded(document):
    """The residual after a whole repair; all of them where nothing was missing."""
    folded = "<details><summary>The residual of "
    assert f"{folded}{document['after']['model']}, which is noise" in page(document)
    partial = copy.deepcopy(document)
    partial["remaining"]["structured"] = True
    assert folded not in page(partial)
    adequate = copy.deepcopy(document)
    adequate.update(verdict="adequate", effects=[], slots={}, slot=None, after=document["before"])
    adequate["residual"]["after"] = None
    inside = page(adequate).partition("<details><summary>The residual is noise")[2]
    assert "Power density" in inside.partition("</details>")[0]


def test_the_mean_of_the_other_hits_stands_beside_before_and_after(document):
    """In the headline and in the table; where there is none, the reason is said."""
    mean = f"{document['mean_waveform']['heldout_rms_V'] * 1e3:.4g}"
    text = " ".join(read(page(document)).text)
    assert "mean of the other hits" in text
    assert mean in text
    few = copy.deepcopy(document)
    few["mean_waveform"] = {"heldout_rms_V": None, "shots": 0, "reason": "2 shots leave none"}
    assert "No mean of the other hits: 2 shots leave none." in " ".join(read(page(few)).text)
    older = copy.deepcopy(document)
    del older["mean_waveform"]
    assert mean not in " ".join(read(page(older)).text)


def test_a_waveform_stands_beside_the_best_closure_of_few_numbers(document):
    """Both closures are named, each with what it does on held-out shots."""
    unknown = copy.deepcopy(document)
    held = document["before"]["heldout_rms_V"]
    unknown.update(verdict="unknown", effects=[])
    unknown["closure"] = {
        "family": "mean_waveform",
        "scope": "pair",
        "coefficients": {},
        "by_shot": {},
        "heldout_rms_V": held / 8,
        "by_columns": {"family": "creep", "scope": "rig", "heldout_rms_V": held / 3},
    }
    text = " ".join(" ".join(read(page(unknown)).text).split())
    assert "the mean waveform of a pair's other hits" in text
    assert "reduces the residual 8-fold" in text
    assert "Without it the best is" in text
    assert "reduces the residual 3-fold" in text


def test_the_page_says_what_each_uncertainty_is_made_of(document):
    """The found modulus has its inputs, the part no repetition lessens, and what improves it."""
    text = " ".join(read(page(document)).text)
    budget = document["after"]["budget"]["moduli"]["specimen"]["youngs_modulus_Pa"]
    assert "Uncertainty budgets" in text
    assert budget["improve"] in text
    assert "common to all shots" in text
    assert budget["rows"][0]["label"] in text
    older = copy.deepcopy(document)
    del older["after"]["budget"]  # of a version that accounted for nothing
    assert "Uncertainty budgets" not in page(older)


def test_other_verdicts_have_a_page_too(document):
    """Without effect, with a closure, or without anything to find, the page still closes."""
    unknown = copy.deepcopy(document)
    unknown.update(
        verdict="unknown",
        effects=[],
        closure={
            "family": "locked",
            "scope": "rig",
            "numbers": 2,
            "coefficients": {"0 us after touch-down": 0.3},
        },
    )
    assert "learned discrepancy" in page(unknown)
    adequate = copy.deepcopy(document)
    adequate.update(verdict="adequate", effects=[], slots={}, slot=None, after=document["before"])
    adequate["residual"]["after"] = None
    assert "+0.00 %" not in " ".join(read(page(adequate)).text)


def test_a_withheld_modulus_is_among_the_figures_that_matter(document):
    """Who reads only the top of the page sees that there is no modulus, and why further down."""
    withheld = copy.deepcopy(document)
    for block in (withheld["before"], withheld["after"]):
        block["moduli"]["specimen"] = {
            "youngs_modulus_Pa": None,
            "plane_strain_modulus_Pa": None,
            "side": "surface",
            "status": "withheld",
            "reason": "State the modulus of acetal.",
        }
    text = " ".join(read(page(withheld)).text)
    assert "specimen: its modulus; the reason is in the table of moduli" in text
    assert "State the modulus of acetal." in text


def test_what_people_typed_is_escaped(document):
    """A file name cannot put a script into the page."""
    nasty = copy.deepcopy(document)
    nasty["rejected"] = [{"name": "<script>", "path": "/shots/0", "reason": "a & b"}]
    made = page(nasty)
    assert "<script>" not in made
    assert "a &amp; b" in made


def test_the_next_drop_is_told_as_a_drop(document):
    """Sphere, surface, height, how often, and which rivals it tells apart."""
    asking = copy.deepcopy(document)
    asking["next_drop"] = {
        "sphere": "acetal_small",
        "surface": "specimen",
        "drop_height_m": 0.0465,
        "repeats": 3,
        "separates": ["echo", "second_mode"],
        "expected_distance": 7.31,
    }
    text = " ".join(read(page(asking)).text)
    for said in ("acetal_small on specimen from 46.5 mm", "3 times", "echo", "second_mode", "7.31"):
        assert said in text


def test_a_closure_is_drawn_over_time_and_its_formula_told(document):
    """Coefficients that belong to moments become a curve; a formula stands in the page."""
    unknown = copy.deepcopy(document)
    moments = {f"{at} us after touch-down": 1e-3 * at for at in (0, 30, 60, 150, 400)}
    unknown.update(verdict="unknown", effects=[])
    unknown["closure"] = {
        "family": "locked",
        "scope": "rig",
        "numbers": 5,
        "coefficients": moments,
        "formula": "0.3 * delta**2 < 1",
    }
    made = page(unknown)
    assert "The discrepancy over time." in made
    assert "0.3 * delta**2 &lt; 1" in made
    unknown["closure"].update(coefficients={"square": 1.0}, formula=None)
    assert "The discrepancy over time." not in page(unknown)


def test_where_in_time_the_residual_lives_is_told(document):
    """Before touch-down, in contact, in the ring and later, for both models."""
    text = " ".join(read(page(document)).text)
    for phase in ("before touch-down", "contact", "ring after lift-off", "later"):
        assert phase in text


def everything(made: str) -> str:
    """Return a page's words and those inside its pictures."""
    reader = read(made)
    drawn = [base64.b64decode(one.partition(",")[2]).decode() for one in reader.sources]
    return " ".join([*reader.text, *drawn])


@pytest.mark.parametrize(
    ("quantities", "unit", "density", "factor"),
    [
        (None, "mV", "V²/Hz", 1e3),
        (["acceleration_m_per_s2"], "m/s²", "(m/s²)²/Hz", 1.0),
        (["force_N"], "N", "N²/Hz", 1.0),
        (["force_N", "voltage"], "unit of the record", "(unit of the record)²/Hz", 1.0),
    ],
)
def test_a_page_speaks_the_unit_of_its_recordings(document, quantities, unit, density, factor):
    """Words and pictures of an acceleration campaign never say mV, those of a voltage one do."""
    other = copy.deepcopy(document)
    other["campaign"].pop("quantities", None)
    if quantities:
        other["campaign"]["quantities"] = quantities
        other["sentence"] = "Said of the recording in its own unit, by whoever made the diagnosis."
    curve = other["residual"]["before"]["stacks"]["by_pair_and_height"][0]
    shot = {"pair": curve["pair"], "drop_height_m": 0.01, "time_us": [0.0, 9.0, 18.0]}
    shot.update({key: [0.0, 1.0, 0.5] for key in ("pulse", "residual", "added", "left")})
    other["closure"] = {
        "family": "locked",
        "scope": "rig",
        "coefficients": {"square": 1.0},
        "curves": {"shots": [shot], "force": None},
    }
    text = everything(page(other))
    for said in (f"held out / {unit}", f"residual / {unit}", f"power density / ({density})"):
        assert said in text
    assert f"{document['noise_rms_V'] * factor:.4g} {unit} rms" in text
    assert f">{unit}</text>" in text
    assert ("mV" in text) == (unit == "mV")


def test_recordings_without_names_are_called_unnamed(document):
    """Neither None nor a question mark stands for a sphere or a surface."""
    nameless = copy.deepcopy(document)
    nameless["campaign"].update(spheres=["None"], surfaces=[None])
    for curve in nameless["residual"]["before"]["stacks"]["by_pair_and_height"]:
        curve["pair"] = "?/?"
    text = everything(page(nameless))
    assert "shots of an unnamed sphere on an unnamed surface" in text
    assert "unnamed pair" in text
    assert "?/?" not in text
