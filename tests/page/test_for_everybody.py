"""The page by keyboard alone, for a screen reader, in dark and light, on tablet and desktop."""

from __future__ import annotations

import pytest

from tests.page.conftest import DESKTOP, SMALL_SCREEN, TABLET, Visitor

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe")

PHONE = {"width": 390, "height": 844}
VIEWS = (
    "Drop",
    "Shots",
    "Results",
    "Calibration",
    "Diagnoses",
    "Own recordings",
    "Rig",
    "Materials",
    "Models",
    "Log",
)
TOO_SMALL = """() => [...document.querySelectorAll('a, button, input, select, summary')]
  .filter((one) => one.offsetParent && !one.closest('.tile, .check, .modebar, .skip'))
  .filter((one) => one.getBoundingClientRect().height < 47.5)
  .map((one) => one.outerHTML.slice(0, 120))"""


def serious(page) -> list[str]:
    """Return what axe finds serious or critical, in one line each."""
    found = axe.Axe().run(page).response["violations"]
    return [
        f"{one['id']}: {one['help']} ({one['nodes'][0]['html'][:160]})"
        for one in found
        if one["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        (TABLET, "light"),
        (DESKTOP, "dark"),
        pytest.param(TABLET, "dark", marks=pytest.mark.slow),
        pytest.param(DESKTOP, "light", marks=pytest.mark.slow),
        pytest.param(SMALL_SCREEN, "light", marks=pytest.mark.slow),
    ],
)
def test_no_view_shuts_anybody_out(daemon, browser, size, scheme):
    """On every view: no serious finding of axe, nothing too wide, nothing too small to hit."""
    # Axe puts itself into the page, which our content security policy would not let anybody do.
    visitor = Visitor(daemon, browser, size=size, color_scheme=scheme, bypass_csp=True)
    page = visitor.page
    page.goto(daemon.url)
    page.get_by_role("heading", name="Sign in").wait_for()
    assert serious(page) == []
    visitor.sign_in()
    if not page.evaluate("fetch('/v1/shots').then((a) => a.json())")["items"]:
        visitor.choose("acetal", "specimen", 30)
        visitor.arm_and_drop()
        page.locator(".modulus").wait_for()
    for view in VIEWS:
        visitor.go(view)
        page.wait_for_timeout(700)  # until the view has asked for what it shows
        assert serious(page) == [], view
        assert page.evaluate(TOO_SMALL) == [], view
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, view
    visitor.go("Shots")
    page.locator(".shot-link").first.click()
    page.locator(".chart .main-svg").nth(2).wait_for(state="attached")
    assert serious(page) == []
    assert page.evaluate(TOO_SMALL) == []
    visitor.context.close()


def test_abort_is_in_sight_on_a_phone(daemon, browser):
    """On every view the button lies within the screen, and nothing is wider than it."""
    visitor = Visitor(daemon, browser, size=PHONE)
    page = visitor.page
    visitor.sign_in()
    for view in VIEWS:
        visitor.go(view)
        page.wait_for_timeout(300)  # until the view has asked for what it shows
        box = page.get_by_role("button", name="Abort").bounding_box()
        assert box["x"] >= 0, view
        assert box["x"] + box["width"] <= PHONE["width"], view
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, view
    visitor.context.close()


def test_a_drop_is_made_by_keyboard_alone(daemon, browser):
    """From the token to the modulus without a pointer, and the focus is always to be seen."""
    visitor = Visitor(daemon, browser, size=DESKTOP)
    page = visitor.page
    page.goto(daemon.url)
    page.get_by_label("Token").wait_for()
    page.keyboard.type(daemon.token())
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Drop", exact=True).wait_for()
    page.locator(".go button[aria-disabled=false]").wait_for()
    reached = []
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.name || document.activeElement.type"))
        if reached[-1] == "sphere":
            page.keyboard.press("ArrowRight")
            page.keyboard.press("ArrowLeft")
        if page.evaluate("document.activeElement.textContent") == "Arm and drop":
            break
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline == "solid"
    assert "surface" in reached
    before = page.evaluate("fetch('/v1/drops').then((a) => a.json())")["items"]
    page.keyboard.press("Enter")
    page.locator(".instruction").get_by_text("is stored and fitted").wait_for()
    after = page.evaluate("fetch('/v1/drops').then((a) => a.json())")["items"]
    assert len(after) == len(before) + 1
    page.locator(".modulus").wait_for()
    visitor.assert_clean()
    visitor.context.close()


def test_a_screen_reader_finds_its_way(visitor):
    """Landmarks, one first heading with the focus after each way, a region that is read aloud."""
    page = visitor.page
    visitor.sign_in()
    for landmark in ("banner", "navigation", "main"):
        assert page.get_by_role(landmark).count() == 1
    visitor.go("Models")
    assert page.locator("h1").count() == 1
    assert page.evaluate("document.activeElement.tagName") == "H1"
    assert page.title() == "Models · impactd"
    assert page.locator("#said").get_attribute("aria-live") == "polite"
    assert page.get_by_role("link", name="Models").get_attribute("aria-current") == "page"
