"""`impactd sign-in-code`: a code, where to type it, and a picture for a camera."""

from __future__ import annotations

import json
import sys

import httpx2
import pytest

from impactd.console.sign_in import _is_loopback

from ..api.conftest import Rig, run_daemon, simulated_settings
from .test_terminal import on_a_terminal

PAGE = "https://rig.example"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory):
    """A daemon that answers."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("daemon")))


@pytest.fixture
def signed_in(daemon: Rig, monkeypatch: pytest.MonkeyPatch) -> Rig:
    """The daemon, with the environment of somebody who has a token."""
    monkeypatch.setenv("IMPACTD_URL", daemon.url)
    monkeypatch.setenv("IMPACTD_TOKEN", daemon.token("operate", "ada"))
    return daemon


def test_it_prints_a_code_that_works_and_the_page(run, signed_in):
    """The code is in the first line, the address in the second; a pipe gets no picture."""
    shown = run("sign-in-code", "--page", PAGE + "/")
    assert shown.exit_code == 0, shown.output
    first, second, last = shown.stdout.splitlines()
    assert second == f"Page: {PAGE}"
    assert "5 minutes" in last
    assert "the token ada (operate)" in last
    code = {"code": first.removeprefix("Code: ")}
    answer = signed_in.anybody.post("/v1/session/by-code", json=code)
    assert answer.status_code == 201
    assert answer.json()["name"] == "ada"


def test_json_has_code_page_and_link(run, signed_in):
    """The code is in the link's fragment, which no browser sends."""
    made = json.loads(run("sign-in-code", "--json").stdout)
    assert made["page"] == signed_in.url
    assert made["link"] == f"{signed_in.url}/#/sign-in/{made['code']}"
    assert httpx2.URL(made["link"]).query == b""
    assert (made["name"], made["scope"], made["life_s"]) == ("ada", "operate", 300)


def test_an_address_of_this_computer_is_named_as_such(run, signed_in):
    """A picture of a loopback address would lead a telephone to itself: it is left out."""
    words = [sys.executable, "-m", "impactd", "sign-in-code"]
    seen = on_a_terminal(*words)
    assert "works on this computer only" in seen
    assert "--page" in seen
    assert "█" not in seen
    assert _is_loopback("http://[::1]:8642")
    assert _is_loopback("http://localhost:8642")
    assert not _is_loopback("http://rig.example:8642")


def test_a_terminal_shows_the_link_as_a_picture(signed_in):
    """The dots are those of the QR code of the link; a dumb terminal gets text."""
    segno = pytest.importorskip("segno")
    words = [sys.executable, "-m", "impactd", "sign-in-code", "--page", PAGE]
    seen = on_a_terminal(*words, NO_COLOR="1", PYTHONIOENCODING="utf-8")
    code = seen.splitlines()[0].removeprefix("Code: ").strip()
    rows = [
        line.removeprefix("\x1b[97;40m").removesuffix("\x1b[0m")
        for line in seen.splitlines()
        if line.startswith("\x1b[97;40m")
    ]
    dark = {" ": (1, 1), "▀": (0, 1), "▄": (1, 0), "█": (0, 0)}
    matrix = [[dark[one][half] for one in row] for row in rows for half in (0, 1)]
    wanted = segno.make_qr(f"{PAGE}/#/sign-in/{code}").matrix_iter(border=4)
    assert matrix[: len(matrix[0])] == [list(row) for row in wanted]
    assert "█" not in on_a_terminal(*words, TERM="dumb")
    assert "█" not in on_a_terminal(*words, PYTHONIOENCODING="ascii")


def test_without_a_token_it_says_what_to_do(run, daemon, monkeypatch):
    """A code is made by somebody who is signed in."""
    monkeypatch.delenv("IMPACTD_TOKEN", raising=False)
    refused = run("sign-in-code", "--url", daemon.url)
    assert refused.exit_code == 1
    assert "no bearer token" in str(refused.exception)
    assert "impactd token create" in str(refused.exception)


@pytest.mark.parametrize("page", ["rig.example", "https://", "http://[::1", "ftp://rig.example"])
def test_a_page_that_is_no_address_is_wrong_usage(run, page):
    """It is refused before a code is made."""
    refused = run("sign-in-code", "--page", page)
    assert refused.exit_code == 2
    assert "--page" in refused.output
