"""The charts of a report in Chromium: drawn from the file alone, with the numbers of the JSON."""

from __future__ import annotations

import re

import pytest

from impactd.api.routes.diagnoses import REPORT_POLICY
from impactd.diagnosis.interactive import error_chart
from impactd.diagnosis.report import page, write_report
from impactd.diagnosis.unit import MILLIVOLT
from impactd.reports.charts import with_library

LARGEST = 3_000_000
"""Bytes of a report with its library: what a mail takes."""


@pytest.fixture(scope="module")
def report(document, tmp_path_factory):
    """The report as a file."""
    file = tmp_path_factory.mktemp("report") / "report.html"
    write_report(file, document)
    return file


@pytest.fixture
def tab(browser):
    """A tab without network, and what its console says."""
    context = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True)
    opened = context.new_page()
    opened.said = []
    opened.on("console", lambda message: opened.said.append(message.text))
    opened.on("pageerror", lambda error: opened.said.append(str(error)))
    yield opened
    context.close()


def numbers(words: str) -> list[float]:
    """Return the numbers in a label, whose minus is typographic."""
    return [float(one.replace("−", "-")) for one in re.findall(r"[−-]?\d+\.?\d*", words)]


def test_the_mouse_shows_the_numbers_of_the_json(document, report, tab):
    """From file:// and without network: both charts are drawn, and a label is the JSON's number."""
    tab.goto(report.as_uri())
    tab.locator("[data-chart=signal] .main-svg").first.wait_for()
    tab.locator("[data-chart=error] .point").first.hover(force=True)
    label = tab.locator("[data-chart=error] .hovertext").first
    held = {
        float(f"{1e3 * document[side][key]:.4g}")
        for side in ("before", "after")
        for key in ("rms_V", "heldout_rms_V")
    }
    assert held & set(numbers(label.text_content()))
    stacks = document["residual"]["before"]["stacks"]
    choices = tab.get_by_label("what is drawn")
    assert choices.locator("option").count() == len(stacks["by_pair_and_height"])
    choices.select_option(index=1)
    tab.locator("[data-chart=signal] .nsewdrag").last.hover()
    label = tab.locator("[data-chart=signal] .hovertext").first
    shown = set()
    for side in ("before", "after"):
        curve = document["residual"][side]["stacks"]["by_pair_and_height"][1]
        both = zip(curve["signal"], curve["mean"], strict=True)
        shown |= {float(f"{1e3 * v:.4g}") for s, r in both if s is not None for v in (s, r, s - r)}
    assert set(numbers(label.text_content())) & shown
    assert tab.said == []


def test_print_has_the_pictures_and_not_the_charts(report, tab):
    """The charts are for the screen; the picture beside them stays."""
    tab.goto(report.as_uri())
    chart = tab.locator("[data-chart=signal]")
    chart.wait_for()
    tab.emulate_media(media="print")
    assert not chart.is_visible()
    assert tab.locator("figure img").first.is_visible()


def test_the_policy_lets_the_one_script_run_and_no_other(document, browser):
    """As the daemon serves it: the charts are drawn, a script slipped in is not run."""
    slipped = with_library(page(document)).replace("<body>", "<body><script>bad = 1</script>", 1)
    context = browser.new_context()
    tab = context.new_page()
    tab.route(
        "http://rig.test/*",
        lambda route: route.fulfill(
            body=slipped,
            content_type="text/html; charset=utf-8",
            headers={"Content-Security-Policy": REPORT_POLICY},
        ),
    )
    refused = []
    tab.on("console", lambda message: refused.append(message.text))
    tab.goto("http://rig.test/report.html")
    tab.locator("[data-chart=signal] .main-svg").first.wait_for()
    assert tab.evaluate("typeof bad") == "undefined"
    assert len(refused) == 1
    context.close()


def test_the_library_is_there_once_and_not_in_what_is_stored(document, report):
    """The file is of a sensible size; a page without charts stays as it is."""
    text = report.read_text(encoding="utf-8")
    assert text.count('id="plotly"') == 1
    assert len(text) < LARGEST
    assert 'id="plotly"' not in page(document)
    assert with_library("<body></body>") == "<body></body>"


def test_a_diagnosis_of_an_older_version_draws_the_residual_alone(document):
    """Where it has no signal; without any residual it has the errors alone."""
    assert '"yaxis": "y2"' in page(document)
    older = {**document, "residual": {"before": {"said": []}, "after": None}}
    made = page(older)
    assert 'data-chart="signal"' not in made
    assert 'data-chart="error"' in made
    assert error_chart(["kv"], {"held-out shots": [None]}, 1.0, MILLIVOLT) is None
