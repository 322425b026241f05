"""The manual as the daemon serves it; `tests/test_project/test_manual.py` builds it."""

from __future__ import annotations

from pathlib import Path

import pytest

from impactd.api.routes.diagnoses import REPORT_POLICY
from impactd.api.routes.guides import POLICY
from impactd.guides import files

PICTURE = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small site in place of the built one."""
    for name, content in {
        files.FIRST: b"<!doctype html><title>The manual</title>",
        "searchindex.js": b"Search.setIndex({})",
        "_images/shot.png": PICTURE,
        "_downloads/ab/rig.toml": b"[rig]\n",
        "_downloads/cd/report.html": b"<style></style>",
        "objects.inv": b"for other manuals",
    }.items():
        path = tmp_path / "site" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    monkeypatch.setattr(files, "SITE", tmp_path / "site")
    files._files.cache_clear()
    yield tmp_path / "site"
    files._files.cache_clear()


@pytest.mark.parametrize("address", ["/guides", "/guides/"])
def test_guides_leads_to_the_first_page(rig, site, address):
    """Without a token, under a policy that allows nothing inline and no other host."""
    asked = rig.anybody.get(address)
    assert asked.status_code == 307
    page = rig.anybody.get(asked.headers["location"])
    assert page.status_code == 200
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"] == POLICY
    assert "The manual" in page.text
    assert "unsafe" not in POLICY
    assert "http" not in POLICY


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("searchindex.js", "text/javascript; charset=utf-8"),
        ("_images/shot.png", "image/png"),
        ("_downloads/ab/rig.toml", "text/plain; charset=utf-8"),
        ("_downloads/cd/report.html", "text/html; charset=utf-8"),
    ],
)
def test_each_file_has_its_type_and_is_sent_again_only_when_it_changed(rig, site, name, kind):
    """Sources are shown as text; 304 for whoever has a file already."""
    answer = rig.anybody.get(f"/guides/{name}")
    assert (answer.status_code, answer.headers["content-type"]) == (200, kind)
    assert answer.content == (site / name).read_bytes()
    again = rig.anybody.get(f"/guides/{name}", headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_a_report_shows_its_own_styles_and_runs_no_script(rig, site):
    """A linked report has the policy that reports of this daemon have."""
    answer = rig.anybody.get("/guides/_downloads/cd/report.html")
    assert answer.headers["content-security-policy"] == REPORT_POLICY


@pytest.mark.parametrize(
    "name", ["nothing.html", "..%2fsecret.html", "%2e%2e/secret.html", "objects.inv"]
)
def test_nothing_but_the_manual_is_served(rig, site, name):
    """Only what is in the list, whatever an address says."""
    (site.parent / "secret.html").write_text("secret")
    answer = rig.anybody.get(f"/guides/{name}")
    assert answer.status_code == 404
    assert answer.json()["type"] == "urn:impactd:problem:not-found"


def test_without_a_built_manual_the_answer_says_how_to_build_it(rig, monkeypatch, tmp_path):
    """404 as a problem; a build while the daemon runs is served at once."""
    monkeypatch.setattr(files, "SITE", tmp_path)
    for address in ("/guides", "/guides/impactd/guides/README.html"):
        answer = rig.anybody.get(address)
        assert answer.status_code == 404
        assert "make docs" in answer.json()["remedy"]
    (tmp_path / "searchindex.js").write_text("")
    (tmp_path / "page.html").write_text("built")
    files._files.cache_clear()
    assert rig.anybody.get("/guides/page.html").text == "built"
    files._files.cache_clear()


@pytest.mark.parametrize("query", ["v=7f41d439", "q=noise&check_keywords=yes&area=default"])
def test_the_queries_of_its_own_pages_are_known(rig, site, query):
    """Links to scripts carry a checksum; the search carries its words."""
    assert rig.anybody.get(f"/guides/searchindex.js?{query}").status_code == 200


def test_only_get_is_known(rig, site):
    """A write to the manual is a 405 that names the methods."""
    answer = rig.anybody.put("/guides/searchindex.js", json={})
    assert answer.status_code == 405
    assert answer.headers["allow"] == "GET, HEAD"


def test_the_status_says_whether_there_is_a_manual(rig):
    """The page links to it only then."""
    there = rig.anybody.get("/guides", follow_redirects=False).status_code != 404
    assert rig.anybody.get("/v1/status").json()["manual"] is there
