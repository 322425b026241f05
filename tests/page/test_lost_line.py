"""A lost connection, a daemon that is killed, an alarm that stays."""

from __future__ import annotations

import re

import pytest

from tests.page.conftest import TABLET, Daemon, Visitor


@pytest.mark.slow
def test_a_lost_connection_is_said_and_mended_without_a_hand(visitor):
    """The light claims nothing, the notice says from when the screen is, then all is back."""
    page = visitor.page
    visitor.sign_in()
    page.locator("#light[data-light=ready]").wait_for()
    visitor.context.set_offline(True)
    lost = page.get_by_role("alert").filter(has_text="The connection is lost.")
    lost.wait_for()
    assert re.search(r"The screen shows the state at \d\d:\d\d:\d\d\.", lost.inner_text())
    assert page.locator("#light").get_attribute("data-light") == "unknown"
    assert page.locator(".go button").inner_text() == "Not connected"
    page.get_by_role("button", name="Abort").click()
    page.get_by_role("alert").filter(has_text="Abort did not get through.").wait_for()
    visitor.context.set_offline(False)
    lost.wait_for(state="detached")
    page.locator("#light[data-light=ready]").wait_for()
    page.get_by_text("The connection is back").wait_for()
    assert visitor.hosts == {visitor.daemon.url.removeprefix("http://")}


@pytest.mark.slow
def test_an_alarm_outlives_a_killed_daemon_until_somebody_acknowledges_it(tmp_path, browser):
    """Killed in the middle of a drop, started again, still signed in: it stands, then goes."""
    daemon = Daemon(tmp_path, delay_s=60.0)
    try:
        daemon.start()
        visitor = Visitor(daemon, browser, size=TABLET)
        page = visitor.page
        visitor.sign_in()
        visitor.choose("acetal", "specimen", 20)
        visitor.arm_and_drop()
        page.locator(".instruction").get_by_text("Load the sphere: acetal").wait_for()
        daemon.kill()
        page.get_by_role("alert").filter(has_text="The connection is lost.").wait_for()
        daemon.start()
        for _ in range(2):
            page.goto(daemon.url)  # a session outlives the restart
            alarm = page.get_by_role("alert").filter(has_text="Drop 1 was interrupted")
            alarm.wait_for()
            page.reload()
            alarm.wait_for()
            daemon.stop()
            daemon.start()
        page.goto(daemon.url)  # a session outlives the restart
        page.get_by_role("button", name="What to do").click()
        page.get_by_role("button", name="Acknowledge: Drop 1").click()
        alarm.wait_for(state="detached")
        page.reload()
        page.locator("#light[data-light=ready]").wait_for()
        assert page.get_by_role("button", name="Acknowledge").count() == 0
        visitor.go("Log")
        page.get_by_text("Acknowledged alarms (1)").click()
        page.get_by_text("acknowledged by the operate").wait_for()
        visitor.context.close()
    finally:
        daemon.stop()
