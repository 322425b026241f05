"""A calibration from the page."""

from __future__ import annotations

import re

import pytest

_WHILE_CHECKING = """async () => {
  const { showCalibrationUnderWay } = await import('/page/parts/series.js');
  const place = document.createElement('div');
  const next = { sphere: 'acetal', surface: 'aluminium', drop_height_m: 0.025 };
  const series = { number: 1, done: 1, of: 8, next };
  showCalibrationUnderWay(place, { state: 'CHECKING', series });
  return [...place.querySelectorAll('.instruction')].map((one) => one.textContent).join();
}"""
"""What a person is asked while a held sphere waits for a quiet input."""

_OVERFLOWING = """() => [...document.querySelectorAll('.chart .main-svg')]
  .filter((one) => one.getBoundingClientRect().width > one.closest('.card').offsetWidth)
  .map((one) => one.closest('.card').innerText)"""
"""Charts that are drawn wider than their card."""


@pytest.mark.slow
def test_a_calibration_tells_what_to_load_and_ends_in_the_chart(calm_hands):
    """Progress with the next sphere, then values with U, a due date and a point in the chart."""
    visitor = calm_hands
    page = visitor.page
    visitor.sign_in()
    visitor.go("Results")
    page.get_by_text("No modulus yet").wait_for()
    assert not page.get_by_role("region", name="Take away").is_visible()  # there is nothing
    visitor.go("Shots")
    page.get_by_text("No shot yet").wait_for()
    visitor.go("Calibration")
    page.locator("button[aria-disabled=false]").get_by_text("Start a calibration").click()
    running = page.get_by_role("region", name="Calibration 1")
    running.get_by_text("Load the next sphere: acetal").wait_for()
    running.get_by_role("heading", name=re.compile(r"[1-7] of 8 drops done")).wait_for()
    page.get_by_text("to go").wait_for()
    page.get_by_text(re.compile(r"^[2-8] drops so far$")).wait_for()  # it follows the progress
    assert page.evaluate(_WHILE_CHECKING) == ""
    visitor.go("Drop")
    page.get_by_role("region", name="Calibration 1").wait_for()
    visitor.go("Calibration")
    history = page.get_by_role("region", name="All calibrations")
    history.get_by_text(re.compile(r"^(done|failed)$")).wait_for()
    assert "failed" not in history.inner_text()
    page.locator(".badge").get_by_text("valid", exact=True).wait_for()
    facts = page.get_by_role("region", name="The valid calibration").inner_text()
    assert "in 30 days" in facts
    assert "±" in facts
    page.locator(".chart .point").first.wait_for(state="attached")
    assert page.locator(".chart .point").count() == 1
    visitor.go("Rig")
    page.locator("[aria-labelledby=gain-title] .xtick").first.wait_for(state="attached")
    days = page.locator("[aria-labelledby=gain-title] .xtick").all_text_contents()
    assert not any(re.search(r":\d\d\.", one) for one in days), days
    page.locator("[aria-labelledby=noise-title] .main-svg").first.wait_for(state="attached")
    assert page.evaluate(_OVERFLOWING) == []
    visitor.assert_clean()


@pytest.mark.slow
def test_an_aborted_calibration_says_who_ended_it_and_after_how_many_drops(slow_hands):
    """Not that it goes on, nor that there is a sphere to load."""
    visitor = slow_hands
    page = visitor.page
    visitor.sign_in()
    visitor.go("Calibration")
    page.locator("button[aria-disabled=false]").get_by_text("Start a calibration").click()
    page.get_by_role("region", name="Calibration 1").get_by_text("0 of 8 drops done").wait_for()
    page.locator("#light[data-light=busy]").wait_for()
    page.get_by_role("button", name="Abort").click()
    row = page.get_by_role("region", name="All calibrations").get_by_role("row").nth(1)
    row.get_by_text("aborted by the operate").wait_for()
    assert re.search(r"\b[01] drops?\b", row.inner_text())
    assert row.locator(".badge").inner_text() == "aborted"
    assert "so far" not in row.inner_text()
    page.get_by_role("region", name="Calibration 1").wait_for(state="detached")
    assert page.get_by_text("Load the next sphere").count() == 0
    visitor.assert_clean()
