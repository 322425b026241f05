"""From a token to a modulus, on a tablet."""

from __future__ import annotations

import json

from playwright.sync_api import expect


def test_a_first_visit_ends_with_a_modulus(visitor):
    """Token, light, choice, Arm and drop: shot number, modulus with U, advice and curves."""
    page = visitor.page
    visitor.sign_in()
    page.locator("#light[data-light=ready]").wait_for()
    visitor.choose("acetal", "specimen", 30)
    visitor.arm_and_drop()
    page.locator(".modulus").get_by_text("±").wait_for()
    page.locator("[data-advice=use]").wait_for()
    page.get_by_text("Young's modulus of specimen").wait_for()
    # E of the specimen is larger than E* of this pair
    page.wait_for_function(
        """() => {
            const sizes = [".young .large", ".modulus"].map((which) => {
                const one = document.querySelector(which);  // none while the shot is drawn anew
                return one ? parseFloat(getComputedStyle(one).fontSize) : NaN;
            });
            return sizes[0] > 1.5 * sizes[1];
        }"""
    )
    # A shot is drawn anew when its fit is done: until then its charts are empty for a moment.
    expect(page.locator(".legendtext")).to_have_text(["measured", "HSD", "KV", "closed KV"])
    left_over = page.get_by_role("group", name="Model of the residual").get_by_role("button")
    expect(left_over).to_have_text(["HSD", "KV", "closed KV"])
    visitor.assert_clean()


def test_the_light_says_what_the_command_says(visitor):
    """Word for word the sentence of `impactd status`, before anybody has signed in."""
    page = visitor.page
    page.goto(visitor.daemon.url)
    page.locator("#light[data-light=ready]").wait_for()
    told = page.evaluate("fetch('/v1/status').then((answer) => answer.json())")
    assert page.locator("#light").inner_text().split() == told["sentence"].split()
    visitor.sign_in()
    assert "the load cell was never calibrated" in page.locator("#light").inner_text()
    assert page.locator("#notices").inner_text() == ""  # not said twice
    visitor.assert_clean()


def test_a_wrong_token_is_told_in_words(visitor):
    """The field is marked, and the sentence says where a token comes from."""
    page = visitor.page
    page.goto(visitor.daemon.url)
    page.get_by_label("Token").fill("no such token")
    page.get_by_role("button", name="Sign in").click()
    wrong = page.get_by_role("alert").filter(has_text="token")
    wrong.wait_for()
    assert "impactd token create" in page.get_by_role("main").inner_text()


def test_the_token_is_kept_nowhere_in_the_browser(visitor):
    """No storage a script can read holds it, and the cookie is hidden from scripts."""
    visitor.sign_in()
    kept = visitor.page.evaluate(
        "JSON.stringify([{...localStorage}, {...sessionStorage}, document.cookie])"
    )
    local, session, cookie = json.loads(kept)
    assert set(local) <= {"impactd.signed-in", "impactd.drop", "impactd.operator"}
    assert "impactd_" not in kept
    assert session == {}
    assert cookie == ""
