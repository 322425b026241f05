"""Pictures of every view, to look at by eye: ``python -m tests.page.take_pictures FOLDER``.

A fresh daemon on the simulated rig is calibrated, drops a few spheres, one of them too high, and is
looked at on a tablet and on a desktop, by day and by night. What the README shows comes from here.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.conftest import CHROMIUM
from tests.page.conftest import DESKTOP, TABLET, Daemon, Visitor

_VIEWS = (
    "rig",
    "shots",
    "shots/{last}",
    "results",
    "health",
    "materials",
    "compare/{some}",
    "calibration",
    "diagnoses",
    "recordings",
    "models",
    "log",
)
_WITH_CHART = ("rig", "calibration")
_SETTLED_MS = 1500


def main(folder: Path) -> None:
    """Take the pictures.

    Parameters
    ----------
    folder : Path
        Where they go; made when absent.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place, sync_playwright() as engine:
        daemon = Daemon(Path(place), delay_s=2.0)
        browser = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            daemon.start()
            _work(Visitor(daemon, browser, size=TABLET), folder)
            for name, size in (("tablet", TABLET), ("desktop", DESKTOP)):
                for scheme in ("light", "dark"):
                    visitor = Visitor(daemon, browser, size=size, color_scheme=scheme)
                    _look(visitor, folder, f"{name}-{scheme}")
        finally:
            browser.close()
            daemon.stop()


def _work(visitor: Visitor, folder: Path) -> None:
    page = visitor.page
    visitor.sign_in()
    visitor.choose("acetal", "specimen", 30)
    visitor.arm_and_drop()
    page.locator(".instruction").get_by_text("Load the sphere").wait_for()
    page.screenshot(path=folder / "drop-under-way.png")
    page.locator(".modulus").wait_for()
    visitor.go("Calibration")
    page.locator("button[aria-disabled=false]").get_by_text("Start a calibration").click()
    page.get_by_role("heading", name=re.compile(r"[2-7] of 8 drops done")).wait_for()
    page.screenshot(path=folder / "calibration-under-way.png")
    page.locator(".badge").get_by_text("valid", exact=True).wait_for()
    visitor.go("Drop")
    for sphere, surface, height_mm in (("acetal", "aluminium", 120), ("hdpe", "polycarbonate", 40)):
        visitor.choose(sphere, surface, height_mm)
        visitor.arm_and_drop()
        page.get_by_text(f"{sphere} on {surface} from {height_mm} mm").nth(1).wait_for()
    page.locator(".modulus").wait_for()
    visitor.context.set_offline(True)
    page.get_by_role("alert").first.wait_for()
    page.screenshot(path=folder / "line-lost.png")
    visitor.context.close()


def _look(visitor: Visitor, folder: Path, name: str) -> None:
    page = visitor.page
    page.goto(visitor.daemon.url)
    page.get_by_label("Token").wait_for()
    page.screenshot(path=folder / f"sign-in-{name}.png")
    visitor.sign_in("admin")
    last = page.evaluate("fetch('/v1/shots').then((a) => a.json())")["items"][0]["number"]
    for view in _VIEWS:
        address = view.format(last=last, some=f"{last - 3},{last - 2},{last}")
        page.goto(f"{visitor.daemon.url}/#/{address}")
        if view == "results":
            page.locator("summary").first.click()
            page.get_by_role("table").first.wait_for()
        if view in _WITH_CHART or "/" in view:
            page.locator(".chart .main-svg").first.wait_for(state="attached")
        page.wait_for_timeout(_SETTLED_MS)
        page.screenshot(path=folder / f"{view.split('/')[0]}-{name}{'-one' * ('last' in view)}.png")
    print(name, visitor.complaints or "no complaint")
    visitor.context.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
