"""Signing in with a code that a terminal shows, typed or by its link."""

from __future__ import annotations

import json

import pytest
from playwright.sync_api import expect


def test_a_code_that_is_typed_signs_in_once(daemon, visitor):
    """The code is readable while it is typed; a second use is told in words."""
    page = visitor.page
    made = daemon.sign_in_code()
    for status in ("entered", "refused"):
        page.goto(daemon.url)
        page.get_by_label("Code or token").fill(made["code"].lower())
        expect(page.get_by_label("Code or token")).to_have_attribute("type", "text")
        if status == "entered":
            page.get_by_role("button", name="Sign in").click()
            page.get_by_role("heading", name="Drop", exact=True).wait_for()
            visitor.assert_clean()
            visitor.go("Log")
            page.get_by_text("the operate signed in with a code").first.wait_for()
            page.get_by_role("button", name="Sign out").click()
            page.get_by_role("heading", name="Sign in").wait_for()
        else:
            page.get_by_role("button", name="Sign in").click()
            wrong = page.get_by_role("alert").filter(has_text="mistyped, used")
            wrong.wait_for()
            assert "impactd sign-in-code" in wrong.inner_text()


def test_a_link_brings_its_code_and_leaves_no_trace_of_it(daemon, visitor):
    """One press signs in; no request, address, history or storage holds the code."""
    page = visitor.page
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    made = daemon.sign_in_code()
    page.goto(made["link"])
    button = page.get_by_role("button", name="Sign in")
    expect(button).to_be_focused()
    expect(page.get_by_label("Code or token")).to_have_value(made["code"])
    assert page.url == f"{daemon.url}/"
    button.press("Enter")
    page.get_by_role("heading", name="Drop", exact=True).wait_for()
    kept = page.evaluate("JSON.stringify([{...localStorage}, {...sessionStorage}, location.href])")
    assert made["code"] not in kept
    assert not any(made["code"] in url for url in asked)
    page.reload()
    page.get_by_role("heading", name="Drop", exact=True).wait_for()
    visitor.assert_clean()


def test_a_link_in_an_open_tab_fills_in_the_form(daemon, visitor):
    """Only the part behind the # changes, so that the page is not loaded again."""
    page = visitor.page
    page.goto(daemon.url)
    page.get_by_label("Code or token").wait_for()
    made = daemon.sign_in_code()
    page.evaluate("(link) => location.assign(link)", made["link"])
    expect(page.get_by_label("Code or token")).to_have_value(made["code"])
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("heading", name="Drop", exact=True).wait_for()
    visitor.assert_clean()


@pytest.mark.parametrize("way", ["loaded", "followed"])
def test_a_link_changes_nobody_who_is_signed_in(daemon, visitor, way):
    """The page says so, and the code stays unused."""
    page = visitor.page
    visitor.sign_in()
    made = daemon.sign_in_code("read")
    if way == "loaded":
        page.goto("about:blank")
        page.goto(made["link"])
    else:
        page.evaluate("(link) => location.assign(link)", made["link"])
    page.get_by_text("You are signed in already, with the token the operate.").wait_for()
    page.get_by_role("heading", name="Drop", exact=True).wait_for()
    assert made["code"] not in page.url
    found = page.evaluate("fetch('/v1/session').then((answer) => answer.text())")
    assert json.loads(found)["scope"] == "operate"
    visitor.assert_clean()


def test_a_token_is_hidden_as_soon_as_it_is_pasted(daemon, visitor):
    """The field shows a code and covers a token."""
    page = visitor.page
    page.goto(daemon.url)
    field = page.get_by_label("Code or token")
    field.fill(daemon.token())
    expect(field).to_have_attribute("type", "password")
    field.fill("K7QW-9M2D")
    expect(field).to_have_attribute("type", "text")
