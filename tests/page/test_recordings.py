"""Own recordings: a CSV is dragged into the page, and a modulus is read from it."""

from __future__ import annotations

import json

import pytest

from tests.page.conftest import DESKTOP, SMALL_SCREEN, TABLET, Visitor
from tests.page.test_for_everybody import PHONE, TOO_SMALL, serious
from tests.recordings import VALUES, simulated_csv

DROP = """(files) => {
  const dragged = new DataTransfer();
  for (const [name, text] of files) dragged.items.add(new File([text], name));
  const place = document.querySelector(".drop-zone");
  for (const kind of ["dragover", "drop"]) {
    const how = { dataTransfer: dragged, bubbles: true, cancelable: true };
    place.dispatchEvent(new DragEvent(kind, how));
  }
}"""


@pytest.mark.parametrize(
    "size",
    [
        SMALL_SCREEN,
        *(pytest.param(one, marks=pytest.mark.slow) for one in (PHONE, TABLET, DESKTOP)),
    ],
    ids=str,
)
def test_a_dragged_csv_becomes_a_modulus(daemon, browser, size):
    """Hits and assumptions, the missing values typed in, verdict, modulus and report."""
    visitor = Visitor(daemon, browser, size=size, bypass_csp=True)
    page = visitor.page
    files, shots = simulated_csv()
    visitor.sign_in()
    visitor.go("Own recordings")
    dragged = {name: text.decode() for name, text in files.items()}
    page.evaluate(DROP, [*dragged.items(), ("values.json", json.dumps(VALUES))])
    page.get_by_role("heading", name=": 4 hits").wait_for()
    assert page.get_by_text("is in V, as the file states").is_visible()
    assert page.get_by_text("drop-1, drop-2, drop-3, drop-4: drop height.").is_visible()
    assert page.get_by_role("textbox", name="Radius / mm", exact=True).input_value() == "4.76"
    assert page.get_by_label("Coupon of drop-1", exact=True).input_value() == ""
    for name, shot in shots.items():
        page.get_by_label(f"Coupon of {name}", exact=True).select_option(shot["surface"])
        height = page.get_by_label(f"Drop height of {name} / mm")
        height.fill(f"{1e3 * shot['drop_height_m']:.3f}")
    assert page.evaluate(TOO_SMALL) == []
    page.get_by_role("button", name="Fit and diagnose").click()
    specimen = page.get_by_role("region", name="specimen", exact=True)
    assert specimen.locator(".modulus").inner_text().startswith("E 3.4")  # 3.44 is the truth
    answer = page.get_by_role("group", name="Answer")
    assert answer.get_by_text("Adequate: nothing is missing").is_visible()
    assert serious(page) == []
    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert page.get_by_role("button", name="Abort").is_visible()
    with page.expect_popup() as opened:
        answer.get_by_role("link", name="Read the report").click()
    opened.value.locator("h1").first.wait_for()
    assert answer.get_by_role("link", name="One page as PDF").is_visible()
    page.reload()  # nothing is lost with the browser's memory
    page.get_by_role("region", name="specimen", exact=True).locator(".modulus").wait_for()
    assert visitor.complaints == []
    visitor.context.close()


def test_a_table_of_drops_and_the_rigs_materials_fill_the_form(visitor):
    """Dragged in with the recordings; a set that is not needed any more is deleted."""
    page = visitor.page
    files, _ = simulated_csv()
    table = "name;sphere;surface;drop_height_mm\n" + "".join(
        f"{file};acetal;specimen;{height}\n"
        for file, height in zip(files, ("19,1", "44,4", "19,1", "44,4"), strict=True)
    )
    visitor.sign_in()
    visitor.go("Own recordings")
    dragged = {name: text.decode() for name, text in files.items()}
    page.evaluate(DROP, [*dragged.items(), ("drops.csv", table)])
    page.get_by_role("heading", name=": 4 hits").wait_for()
    assert page.get_by_label("Drop height of drop-2 / mm").input_value() == "44.4"
    assert page.get_by_label("Sphere of drop-1", exact=True).input_value() == "acetal"
    assert page.get_by_role("textbox", name="Radius / mm", exact=True).input_value() == ""
    page.get_by_label("Take a sphere of the rig").select_option("acetal")
    assert page.get_by_role("textbox", name="Radius / mm", exact=True).input_value() == "4.76"
    page.get_by_label("Take a coupon of the rig").select_option("aluminium")
    assert page.get_by_label("Coupon of drop-1", exact=True).input_value() == "specimen"
    assert page.evaluate(TOO_SMALL) == []
    assert serious(page) == []
    name = page.evaluate("location.hash").rpartition("/")[2]
    page.get_by_text("Delete these recordings").click()
    page.get_by_role("button", name=f"Delete {name}").click()
    page.get_by_role("heading", name="Earlier recordings").wait_for()
    assert page.get_by_role("link", name=name).count() == 0
    assert visitor.complaints == []


@pytest.mark.slow
def test_a_file_that_is_no_recording_says_what_to_do(visitor):
    """What, why and what to do, in the page's own words; the fields that help are open."""
    page = visitor.page
    visitor.sign_in()
    visitor.go("Own recordings")
    numbers = "\n".join(str(at % 7) for at in range(2000))
    page.evaluate(DROP, [("column.csv", numbers)])
    alert = page.get_by_role("alert").filter(has_text="how fast it was sampled")
    alert.get_by_text("Sample rate").wait_for()
    page.get_by_label("Sample rate / Hz").wait_for()
