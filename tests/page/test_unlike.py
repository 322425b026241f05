"""A shot that is unlike its repetitions is said on the page, in words and in the warning colour."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.page.conftest import TABLET, Daemon, Visitor

PICTURES = os.environ.get("IMPACTD_PICTURES")
"""A folder for what was seen, to be looked at by eye; none by default."""
GOOD = 4


@pytest.mark.slow
def test_another_gain_is_told_on_top_and_beside_the_shot(tmp_path: Path, browser) -> None:
    """Four drops say nothing. The conditioner's gain is changed, and the fifth is told of."""
    daemon = Daemon(tmp_path)
    try:
        daemon.start()
        visitor = Visitor(daemon, browser, size=TABLET)
        visitor.sign_in()
        visitor.choose("acetal", "polycarbonate", 30)
        for number in range(1, GOOD + 1):
            visitor.arm_and_drop()
            visitor.shot(number)
        assert visitor.page.get_by_text("unlike its").count() == 0
        visitor.context.close()
        daemon.stop()
        config = daemon.config.read_text(encoding="utf-8")
        changed = config.replace("{ value = 1.2e-8,", "{ value = 1.32e-8,")
        assert changed != config
        daemon.config.write_text(changed, encoding="utf-8")
        daemon.start()
        visitor = Visitor(daemon, browser, size=TABLET)
        page = visitor.page
        visitor.sign_in()
        visitor.choose("acetal", "polycarbonate", 30)
        visitor.arm_and_drop()
        words = f"it is unlike its {GOOD} repetitions. Its signal is 0.9"
        page.locator(".notice.warn").get_by_text(f"Shot {GOOD + 1}: {words}").wait_for()
        visitor.shot(GOOD + 1)
        beside = page.locator("[data-advice=check]")
        beside.get_by_text(words).wait_for()
        assert "another gain, or an off-centre hit" in beside.inner_text()
        if PICTURES:
            page.wait_for_timeout(1500)
            page.screenshot(path=Path(PICTURES) / "unlike-tablet.png")
        visitor.assert_clean()
    finally:
        daemon.stop()
