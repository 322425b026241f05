"""Alarms in the header: how severe, what to do, who has seen them."""

from __future__ import annotations

import pytest

from tests.page.conftest import Daemon, Visitor
from tests.page.test_drops import OUT_OF_REACH
from tests.page.test_for_everybody import PHONE, serious

MAJOR = ("drop.failed", "Drop 7 failed: samples were lost.", "")
MINOR = ("environment.unknown", "Shots are stored without temperature: no file.", "Mend it.")
SIZES = ((768, 1024), (1024, 768), (1440, 900))


@pytest.fixture(scope="module")
def troubled(tmp_path_factory, chromium):
    """A daemon that had two alarms before it was started again, the minor one last."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"))
    try:
        daemon.start()
        daemon.stop()
        daemon.raise_alarms(MAJOR, MINOR)
        daemon.start()
        yield daemon
    finally:
        daemon.stop()


@pytest.mark.parametrize("size", SIZES)
def test_the_most_severe_alarm_is_in_the_header_with_what_to_do(troubled, browser, size):
    """One line on every view, the steps behind a press, Arm and drop still in reach."""
    width, height = size
    visitor = Visitor(troubled, browser, size={"width": width, "height": height}, bypass_csp=True)
    page = visitor.page
    visitor.sign_in()
    alarms = page.get_by_role("banner").get_by_role("region", name="Alarms")
    alarms.get_by_role("alert").get_by_text(MAJOR[1]).wait_for()
    alarms.get_by_text("and 1 more").wait_for()
    for view in ("Log", "Drop"):
        visitor.go(view)
        assert alarms.bounding_box()["height"] < 80
    arm = page.locator(".go button")
    arm.wait_for()
    box = arm.bounding_box()
    assert box["y"] + box["height"] <= height
    if width >= 1024:
        assert page.evaluate(OUT_OF_REACH) == []
    alarms.get_by_role("button", name="What to do").click()
    major, minor = alarms.locator("li[data-severity]").all()
    assert "Major alarm" in major.inner_text()
    assert major.locator("ol li").nth(1).inner_text().startswith("impactd doctor --config ")
    assert "Minor alarm" in minor.inner_text()
    assert minor.locator("ol li").all_inner_texts()[0] == MINOR[2]
    assert serious(page) == []
    visitor.context.close()


def test_an_alarm_is_read_whole_on_a_phone(troubled, browser):
    """Its sentence has a line of its own, and its button lies within the screen."""
    visitor = Visitor(troubled, browser, size=PHONE)
    visitor.sign_in()
    alarms = visitor.page.get_by_role("banner").get_by_role("region", name="Alarms")
    sentence = alarms.get_by_role("alert")
    sentence.get_by_text(MAJOR[1]).wait_for()
    assert sentence.evaluate("one => one.scrollWidth <= one.clientWidth")
    box = alarms.get_by_role("button", name="What to do").bounding_box()
    assert box["x"] + box["width"] <= PHONE["width"]
    assert alarms.bounding_box()["height"] < 120
    visitor.context.close()


def test_an_acknowledged_alarm_leaves_the_header_and_says_by_whom(troubled, browser):
    """On every screen at once; an onlooker cannot acknowledge; the log keeps severity and who."""
    onlooker = Visitor(troubled, browser, size={"width": 1440, "height": 900})
    onlooker.sign_in("read")
    seen = onlooker.page.get_by_role("banner").get_by_role("region", name="Alarms")
    seen.get_by_role("button", name="What to do").click()
    assert seen.get_by_role("button", name="Acknowledge").count() == 0
    visitor = Visitor(troubled, browser, size={"width": 1024, "height": 768})
    page = visitor.page
    visitor.sign_in()
    alarms = page.get_by_role("banner").get_by_role("region", name="Alarms")
    alarms.get_by_role("button", name="What to do").click()
    alarms.get_by_role("button", name=f"Acknowledge: {MAJOR[1]}").click()
    alarms.get_by_role("alert").get_by_text(MINOR[1]).wait_for()
    seen.get_by_role("alert").get_by_text(MINOR[1]).wait_for()
    alarms.get_by_role("button", name=f"Acknowledge: {MINOR[1]}").click()
    alarms.wait_for(state="hidden")
    seen.wait_for(state="hidden")
    visitor.go("Log")
    page.get_by_text("Acknowledged alarms (2)").click()
    kept = page.get_by_role("region", name="Alarms").get_by_role("listitem")
    assert "Minor alarm" in kept.first.inner_text()
    assert "acknowledged by the operate" in kept.first.inner_text()
    for one in (visitor, onlooker):
        one.assert_clean()
        one.context.close()
