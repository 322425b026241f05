"""A page's session: a cookie that no script reads and no other site can use."""

from __future__ import annotations

import httpx2
import pytest

from impactd.api import sessions
from impactd.api.sessions import COOKIE, CSRF_HEADER, Sessions
from impactd.storage.tokens import Token


@pytest.fixture
def browser(rig):
    """Return a client that keeps cookies and has logged in as an operator; and its answer."""
    with httpx2.Client(base_url=rig.url, timeout=30, trust_env=False) as client:
        token, secret = rig.daemon.archive.tokens.create("page", "operate", 1)
        answer = client.post("/v1/session", headers={"Authorization": f"Bearer {secret}"})
        assert answer.status_code == 201
        client.token_id, client.secret = token.id, secret
        yield client, answer


def test_the_cookie_is_hidden_from_scripts_and_other_sites(browser):
    """HttpOnly, SameSite=Strict, for the whole host, for some hours; and it is not the token."""
    client, answer = browser
    cookie = answer.headers["set-cookie"]
    for part in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"):
        assert part in cookie
    assert client.secret not in cookie
    assert client.secret not in answer.text
    assert answer.json() == {"name": "page", "scope": "operate", "csrf": answer.json()["csrf"]}
    assert answer.json()["csrf"] not in cookie


def test_a_session_reads_by_itself_and_writes_with_its_second_secret(browser):
    """Without the header, or with a wrong one, a write is 403 and nothing moves."""
    client, answer = browser
    assert client.get("/v1/drops").status_code == 200
    csrf = answer.json()["csrf"]
    for headers in ({}, {CSRF_HEADER: ""}, {CSRF_HEADER: "x" + csrf[1:]}):
        refused = client.post("/v1/abort", headers=headers)
        assert refused.status_code == 403
        assert refused.json()["type"] == "urn:impactd:problem:csrf"
    assert client.post("/v1/abort", headers={CSRF_HEADER: csrf}).status_code == 200
    assert client.get("/v1/session").json()["csrf"] == csrf


def test_a_session_has_the_scope_of_its_token(rig):
    """A read token's page moves nothing, second secret or not."""
    with httpx2.Client(base_url=rig.url, trust_env=False) as client:
        bearer = {"Authorization": f"Bearer {rig.token('read')}"}
        csrf = client.post("/v1/session", headers=bearer).json()["csrf"]
        assert client.post("/v1/abort", headers={CSRF_HEADER: csrf}).status_code == 403


def test_a_session_ends_with_its_token(rig, browser):
    """Revoking the token takes effect on the session's next request."""
    client, _ = browser
    rig.daemon.archive.tokens.revoke(client.token_id)
    assert client.get("/v1/drops").status_code == 401


def test_a_log_out_ends_the_session_and_not_the_token(rig, browser):
    """The cookie is worth nothing afterwards, even to somebody who kept it."""
    client, answer = browser
    kept = client.cookies[COOKIE]
    left = client.delete("/v1/session", headers={CSRF_HEADER: answer.json()["csrf"]})
    assert left.status_code == 204
    again = httpx2.get(
        rig.url + "/v1/drops", headers={"Cookie": f"{COOKIE}={kept}"}, trust_env=False
    )
    assert again.status_code == 401
    bearer = {"Authorization": f"Bearer {client.secret}"}
    assert rig.anybody.get("/v1/drops", headers=bearer).status_code == 200


def test_a_cookie_begins_no_session(rig, browser):
    """A stolen cookie cannot be made to live for ever."""
    client, answer = browser
    headers = {CSRF_HEADER: answer.json()["csrf"]}
    assert client.post("/v1/session", headers=headers).status_code == 401


@pytest.mark.parametrize("cookie", ["", "x", "ü", "a" * 4000])
def test_an_invented_cookie_is_refused(rig, cookie):
    """401, whatever it looks like."""
    header = f"{COOKIE}={cookie}".encode()
    answer = rig.anybody.get("/v1/drops", headers=[(b"Cookie", header)])
    assert answer.status_code == 401


def test_many_logins_of_one_token_end_nobody_elses_session(rig, browser):
    """Seventy logins with a read token make room among themselves."""
    client, _ = browser
    bearer = {"Authorization": f"Bearer {rig.token('read')}"}
    with httpx2.Client(base_url=rig.url, headers=bearer, timeout=30, trust_env=False) as reader:
        for _ in range(70):
            assert reader.post("/v1/session").status_code == 201
            reader.cookies.clear()
    assert client.get("/v1/drops").status_code == 200


def test_sessions_end_by_time_and_make_room(monkeypatch):
    """Twelve hours, and eight at most of one token; the oldest goes first."""
    token = Token(1, "page", "read", "", None, None)
    kept = Sessions()
    _, first = kept.begin(token)
    others = [kept.begin(token)[1] for _ in range(8)]
    assert kept.find(first) is None
    assert kept.find(others[-1]) is not None
    monkeypatch.setattr(sessions, "LIFE_S", -1.0)
    _, over = kept.begin(token)
    assert kept.find(over) is None


def test_a_session_outlives_a_restart_and_its_file_holds_no_secret(tmp_path):
    """The same cookie finds the same second secret; a damaged file is no session and no error."""
    file = tmp_path / "sessions.json"
    token = Token(7, "page", "operate", "", None, None)
    session, secret = Sessions(file).begin(token)
    again = Sessions(file).find(secret)
    assert again == session
    assert secret not in file.read_text()
    assert session.csrf not in file.read_text()
    assert file.stat().st_mode & 0o007 == 0
    file.write_text("nonsense")
    assert Sessions(file).find(secret) is None
