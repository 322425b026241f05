"""Diagnoses from the page: start, watch, cancel, read."""

from __future__ import annotations

import pytest


def _shots(visitor, count: int) -> list[int]:
    for _ in range(count):
        visitor.choose("acetal", "specimen", 30)
        visitor.arm_and_drop()
        visitor.page.locator(".instruction").get_by_text("is stored and fitted").wait_for()
    found = visitor.page.evaluate(
        "fetch('/v1/shots?surface=specimen&sphere=acetal').then((answer) => answer.json())"
    )
    return [item["number"] for item in found["items"][:count]]


@pytest.mark.slow
def test_a_diagnosis_can_be_started_from_the_history_and_cancelled(visitor):
    """The chosen shots are in the form; a cancelled diagnosis says so and stays in the list."""
    page = visitor.page
    visitor.sign_in()
    (number,) = _shots(visitor, 1)
    visitor.go("Shots")
    page.get_by_label(f"Choose shot {number}", exact=True).check()
    page.get_by_role("link", name="Diagnose", exact=True).click()
    assert page.get_by_role("textbox", name="Shots", exact=True).input_value() == str(number)
    page.get_by_role("textbox", name="Shots", exact=True).fill("all of them")
    page.get_by_role("button", name="Start a diagnosis").click()
    page.get_by_role("alert").filter(has_text="Write numbers of shots").wait_for()
    page.get_by_role("textbox", name="Shots", exact=True).fill(str(number))
    page.get_by_role("button", name="Start a diagnosis").click()
    newest = page.get_by_role("article").first
    newest.get_by_role("button", name="Cancel").click()
    newest.locator(".badge").get_by_text("cancelled").wait_for()
    visitor.assert_clean()


@pytest.mark.slow
def test_a_diagnosis_ends_with_a_verdict_and_a_report_to_read(visitor):
    """Nothing is hidden on this rig: the verdict says so, and the report opens by itself."""
    page = visitor.page
    visitor.sign_in()
    numbers = _shots(visitor, 3)
    page.goto(f"{visitor.daemon.url}/#/diagnoses?shots={','.join(map(str, numbers))}")
    page.get_by_role("button", name="Start a diagnosis").click()
    newest = page.get_by_role("article").first
    report = newest.get_by_role("link", name="Read the report")
    report.wait_for(timeout=900_000)
    assert newest.locator("p").nth(1).inner_text()
    with page.expect_popup() as opened:
        report.click()
    opened.value.wait_for_load_state()
    assert opened.value.locator("h1").count() >= 1
    visitor.assert_clean()
