"""Series, abort, a clipped record, the same again."""

from __future__ import annotations

import re

import pytest

from tests.page.conftest import at_three_sizes

_AFTER_ONE = r"""() => {
  const card = document.querySelector('section[aria-label=Series]');
  const text = card ? card.innerText : '';
  return text.includes('1 of 2 drops done') && /about \d+ (s|min) to go/.test(text) && text;
}"""


def _latest(visitor) -> int:
    drops = visitor.page.evaluate("fetch('/v1/drops?limit=1').then((answer) => answer.json())")
    return drops["items"][0]["number"] if drops["items"] else 0


def _drop_one(visitor, sphere: str, surface: str, height_mm: float) -> int:
    """Make a drop, wait for its modulus and return its shot's number."""
    number = _latest(visitor) + 1
    visitor.choose(sphere, surface, height_mm)
    visitor.arm_and_drop()
    visitor.shot(number)
    return number


OUT_OF_REACH = r"""() => [...document.querySelectorAll('.drop-form :is(input, button)')]
  .filter((one) => one.checkVisibility())
  .filter((one) => {
    const { left, right, top, bottom } = one.getBoundingClientRect();
    const seen = document.elementFromPoint((left + right) / 2, bottom - 2);
    const inside = top >= 0 && bottom <= innerHeight && right <= innerWidth;
    return !inside || (seen !== one && !seen?.contains(one));
  })
  .map((one) => one.ariaLabel || one.labels?.[0]?.innerText || one.innerText)"""


@pytest.mark.parametrize(("width", "height"), [(1024, 768), (1440, 900)])
def test_the_whole_form_and_its_button_are_in_reach(visitor, width, height):
    """Nothing to fill in or to press is below the screen or under the button."""
    page = visitor.page
    page.set_viewport_size({"width": width, "height": height})
    visitor.sign_in()
    page.get_by_role("button", name="Arm and drop").wait_for()
    assert page.get_by_role("group", name="Sphere").get_by_role("radio").count() == 7
    assert page.evaluate(OUT_OF_REACH) == []
    visitor.choose("acetal", "polycarbonate", 25)
    visitor.arm_and_drop()
    page.locator(".modulus").first.wait_for()
    page.evaluate("scrollTo(0, 0)")
    assert page.evaluate(OUT_OF_REACH) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    visitor.assert_clean()


def test_a_series_tells_its_progress_and_ends_by_itself(calm_hands):
    """Two drops from one press: progress, how long to go, both shots."""
    visitor = calm_hands
    page = visitor.page
    visitor.sign_in()
    before = _latest(visitor)
    visitor.choose("acetal", "polycarbonate", 25, drops=2)
    page.get_by_text("A note, for a series of drops").click()
    page.get_by_label("Note").fill("fresh tape")
    visitor.arm_and_drop()
    page.get_by_role("region", name="Series").get_by_text("fresh tape").wait_for()
    told = page.wait_for_function(_AFTER_ONE).json_value()
    assert re.search(r"about \d+ (s|min) to go", told)
    page.get_by_text("All 2 drops are done.").wait_for()
    visitor.shot(before + 2)
    page.get_by_role("button", name="Repeat with the same settings").click()
    visitor.shot(before + 3)
    visitor.assert_clean()


@at_three_sizes("slow_hands")
@pytest.mark.slow
def test_abort_is_one_press_on_every_view_and_ends_the_series(slow_hands):
    """From another view, with the key or the button; nothing more is dropped, and it is told."""
    visitor = slow_hands
    page = visitor.page
    visitor.sign_in()
    visitor.choose("acetal", "specimen", 20, drops=5)
    visitor.arm_and_drop()
    page.locator(".instruction").get_by_text("Load the sphere: acetal").wait_for()
    page.keyboard.press("Escape")
    page.locator(".instruction.bad").get_by_text("was aborted by").wait_for()
    page.locator("#light[data-light=ready]").wait_for()
    told = page.locator("#notices .notice").all_inner_texts()
    assert len([one for one in told if "aborted" in one]) == 1
    assert len(set(told)) == len(told)
    assert page.get_by_text("Load the").count() == 0
    assert _latest(visitor) == 1
    visitor.arm_and_drop()
    page.locator(".instruction").get_by_text("Load the sphere: acetal").wait_for()
    for view in ("Shots", "Calibration", "Diagnoses", "Models", "Log"):
        visitor.go(view)
        assert page.get_by_role("button", name="Abort").is_visible()
    page.get_by_role("button", name="Abort").click()
    visitor.go("Drop")
    page.locator("#light[data-light=ready]").wait_for()
    assert _latest(visitor) == 2
    page.get_by_role("heading", name="The latest drops left no shot").wait_for()
    visitor.go("Log")
    page.get_by_text("the operate pressed Abort.").first.wait_for()
    visitor.assert_clean()


@at_three_sizes("visitor")
def test_a_good_shot_says_what_its_modulus_rests_on(visitor):
    """On a rig whose cell was not calibrated, beside the advice and in no contradiction to it."""
    page = visitor.page
    visitor.sign_in()
    _drop_one(visitor, "acetal", "polycarbonate", 25)
    advice = page.locator("[data-advice=use]").inner_text()
    assert "Use: no check of this record failed." in advice
    assert "The load cell was not calibrated: the modulus uses its certificate." in advice
    visitor.assert_clean()


@at_three_sizes("visitor")
@pytest.mark.slow
def test_a_clipped_record_says_repeat_and_why(visitor):
    """The advice is in words, with what to do; the history shows it, too."""
    page = visitor.page
    visitor.sign_in()
    number = _drop_one(visitor, "acetal", "aluminium", 120)
    advice = page.locator("[data-advice=repeat]")
    advice.wait_for()
    assert "Repeat this drop, because" in advice.inner_text()
    assert "Lower the height" in advice.inner_text()
    # a number that is not to be used is behind a click
    assert "±" not in page.locator(".modulus").inner_text()
    assert not page.get_by_text("Reduced modulus E* of the pair").is_visible()
    page.get_by_text("The result of the fit").click()
    page.get_by_text("Reduced modulus E* of the pair").wait_for()
    visitor.go("Shots")
    page.get_by_label("Advice").select_option("repeat")
    row = page.get_by_role("row").filter(has=page.get_by_role("link", name=str(number), exact=True))
    row.get_by_text("Repeat").wait_for()
    assert "±" not in row.inner_text()
    visitor.assert_clean()


def test_a_height_the_rig_does_not_allow_is_refused_before_it_is_asked(visitor):
    """The sentence names the limits, the field is marked, and nothing is dropped."""
    page = visitor.page
    visitor.sign_in()
    before = _latest(visitor)
    visitor.choose("acetal", "specimen", 999)
    visitor.arm_and_drop()
    page.get_by_text("This rig drops from 2 mm to 150 mm.").wait_for()
    assert page.get_by_label("Drop height / mm").get_attribute("aria-invalid") == "true"
    assert _latest(visitor) == before


def test_a_read_token_sees_everything_and_moves_nothing(visitor):
    """The button says so; the API would refuse, too."""
    visitor.sign_in("read")
    visitor.page.get_by_text("may only look").wait_for()
    assert visitor.page.locator(".go button").get_attribute("aria-disabled") == "true"


def test_a_reading_goes_with_one_press_and_needs_its_uncertainty(visitor):
    """The form asks for what is missing, and forgets the reading afterwards."""
    page = visitor.page
    visitor.sign_in()
    before = _latest(visitor)
    visitor.choose("acetal", "polycarbonate", 25)
    page.get_by_text("Temperature and humidity, if you read them").click()
    page.get_by_label("Temperature / °C", exact=True).fill("21.3")
    page.get_by_label("Relative humidity / %", exact=True).fill("45")
    page.get_by_label("Uncertainty of relative humidity / %").fill("2")
    visitor.arm_and_drop()
    page.get_by_text("A temperature needs its standard uncertainty.").wait_for()
    assert _latest(visitor) == before
    page.get_by_label("Uncertainty of temperature / K").fill("0.2")
    visitor.arm_and_drop()
    visitor.shot(before + 1)
    shot = page.evaluate("n => fetch(`/v1/shots/${n}`).then((answer) => answer.json())", before + 1)
    assert shot["environment"] == {
        "temperature_C": {"value": 21.3, "u": 0.2},
        "relative_humidity": {"value": 0.45, "u": 0.02},
    }
    assert page.get_by_label("Temperature / °C", exact=True).input_value() == ""
    visitor.assert_clean()


@pytest.mark.slow
def test_a_series_goes_on_when_the_page_is_loaded_again(calm_hands):
    """The queue is the daemon's: after a reload it is shown, can be paused, added to and ended."""
    visitor = calm_hands
    page = visitor.page
    visitor.sign_in()
    visitor.choose("acetal", "specimen", 20, drops=6)
    visitor.arm_and_drop()
    card = page.get_by_role("region", name="Series")
    card.wait_for()
    page.reload()
    card.get_by_role("button", name="Pause after this drop").click()
    card.get_by_text("Paused. the operate paused it.").wait_for()
    card.get_by_text("still planned").click()
    card.get_by_role("button", name="Take planned drop 6 out").click()
    card.get_by_role("button", name="Take planned drop 6 out").wait_for(state="detached")
    visitor.choose("hdpe", "specimen", 25)
    page.get_by_role("button", name="Add to the series").click()
    card.get_by_text("hdpe on specimen from 25 mm").wait_for()
    card.get_by_role("button", name="Go on").click()
    page.get_by_role("button", name="Abort").click()
    card.wait_for(state="detached")
    drops = _latest(visitor)
    page.locator("#light[data-light=ready], #light[data-light=look]").wait_for()
    page.wait_for_timeout(3000)
    assert _latest(visitor) == drops < 6
    visitor.assert_clean()
