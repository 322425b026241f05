"""A code from a terminal signs one browser in: once, for minutes, with no more than its token."""

from __future__ import annotations

import re

import httpx2
import pytest
import structlog.testing

from impactd.api.failed_logins import FailedLogins
from impactd.api.guess_limit import GuessLimit
from impactd.api.sessions import COOKIE, CSRF_HEADER
from impactd.api.sign_in_codes import ALPHABET, LIFE_S, SignInCodes

from .conftest import until

WRONG = {"code": "2222-2222"}


@pytest.fixture
def clock(rig):
    """Codes and limits of the running server, on a clock that the test sets; in seconds."""
    state = rig.server.config.app.state
    before = state.sign_in_codes, state.guess_limit, state.failed_logins
    now_s = [1000.0]
    state.sign_in_codes = SignInCodes(lambda: now_s[0])
    state.guess_limit = GuessLimit(lambda: now_s[0])
    state.failed_logins = FailedLogins()
    yield now_s
    state.sign_in_codes, state.guess_limit, state.failed_logins = before


@pytest.fixture
def browser(rig):
    """Return a client that keeps cookies, at an address that a proxy on this machine names."""
    with httpx2.Client(
        base_url=rig.url, timeout=30, trust_env=False, headers={"X-Forwarded-For": "192.0.2.10"}
    ) as client:
        yield client


def made(client: httpx2.Client) -> str:
    """Return a new code of a client's token."""
    answer = client.post("/v1/sign-in-codes")
    assert answer.status_code == 201, answer.text
    return answer.json()["code"]


def slug(answer: httpx2.Response) -> str:
    """Return which problem an answer is."""
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["detail"]
    assert answer.json()["remedy"]
    return answer.json()["type"].rpartition(":")[2]


def test_a_code_gives_an_ordinary_session(rig, clock, browser):
    """The cookie and the second secret are those of a token's session, and it reads and writes."""
    told = rig.operator.post("/v1/sign-in-codes").json()
    assert re.fullmatch(f"[{ALPHABET}]{{4}}-[{ALPHABET}]{{4}}", told["code"])
    assert (told["life_s"], told["name"], told["scope"]) == (LIFE_S, "operate token", "operate")
    answer = browser.post("/v1/session/by-code", json={"code": told["code"]})
    assert answer.status_code == 201
    for part in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"):
        assert part in answer.headers["set-cookie"]
    assert answer.json() == browser.get("/v1/session").json()
    assert answer.json()["name"] == "operate token"
    assert browser.post("/v1/abort").status_code == 403
    csrf = {CSRF_HEADER: answer.json()["csrf"]}
    assert browser.post("/v1/abort", headers=csrf).status_code == 200


def test_a_code_works_once(rig, clock, browser):
    """The second use is refused in words, and says what to do."""
    code = {"code": made(rig.reader)}
    assert browser.post("/v1/session/by-code", json=code).status_code == 201
    again = browser.post("/v1/session/by-code", json=code)
    assert again.status_code == 401
    assert again.headers["www-authenticate"].startswith("Bearer")
    assert slug(again) == "code-invalid"
    assert "used" in again.json()["detail"]
    assert "impactd sign-in-code" in again.json()["remedy"]


def test_a_code_may_be_typed_as_people_type(rig, clock, browser):
    """Small letters, spaces and a missing hyphen do not matter."""
    code = made(rig.reader).lower().replace("-", "  ")
    typed = {"code": f" {code} "}
    assert browser.post("/v1/session/by-code", json=typed).status_code == 201


def test_a_code_ends_after_five_minutes(rig, clock, browser):
    """At 299 s it is valid, at 300 s it is not."""
    for age_s, status in ((299.0, 201), (300.0, 401)):
        code = made(rig.reader)
        clock[0] += age_s
        assert browser.post("/v1/session/by-code", json={"code": code}).status_code == status


def test_a_new_code_ends_the_last_one_of_its_token_alone(rig, clock, browser):
    """Whoever asks twice has one code; another token's code stays."""
    others, first, second = made(rig.operator), made(rig.reader), made(rig.reader)
    for code, status in ((first, 401), (second, 201), (others, 201)):
        assert browser.post("/v1/session/by-code", json={"code": code}).status_code == status


def test_a_code_has_the_rights_of_its_token_and_no_more(rig, clock, browser):
    """A read token's code moves nothing, second secret or not."""
    answer = browser.post("/v1/session/by-code", json={"code": made(rig.reader)})
    assert answer.json()["scope"] == "read"
    refused = browser.post("/v1/abort", headers={CSRF_HEADER: answer.json()["csrf"]})
    assert slug(refused) == "scope-too-small"


def test_a_code_and_its_session_end_with_the_token(rig, clock, browser):
    """After the token is revoked, neither an unused code nor a session from a code holds."""
    token, secret = rig.daemon.archive.tokens.create("leaving", "read", 1)
    bearer = {"Authorization": f"Bearer {secret}"}
    code = browser.post("/v1/sign-in-codes", headers=bearer).json()["code"]
    assert browser.post("/v1/session/by-code", json={"code": code}).status_code == 201
    code = browser.post("/v1/sign-in-codes", headers=bearer).json()["code"]
    rig.daemon.archive.tokens.revoke(token.id)
    assert browser.get("/v1/drops").status_code == 401
    refused = browser.post("/v1/session/by-code", json={"code": code})
    assert slug(refused) == "code-invalid"
    assert "revoked" in refused.json()["detail"]


def test_a_cookie_makes_no_code(rig, clock, browser):
    """A stolen cookie cannot be made to live for ever."""
    csrf = browser.post("/v1/session/by-code", json={"code": made(rig.admin)}).json()["csrf"]
    refused = browser.post("/v1/sign-in-codes", headers={CSRF_HEADER: csrf})
    assert refused.status_code == 401
    assert slug(refused) == "token-missing"


def test_an_address_gets_five_wrong_codes_a_minute(rig, clock, browser):
    """Then even the right code is not read, the answer says for how long, and others may go on."""
    code = {"code": made(rig.reader)}
    for _ in range(5):
        assert slug(browser.post("/v1/session/by-code", json=WRONG)) == "code-invalid"
    refused = browser.post("/v1/session/by-code", json=code)
    assert (refused.status_code, slug(refused)) == (429, "too-many-guesses")
    assert refused.headers["retry-after"] == "60"
    assert COOKIE not in browser.cookies
    elsewhere = {"X-Forwarded-For": "192.0.2.11"}
    answer = browser.post("/v1/session/by-code", json=WRONG, headers=elsewhere)
    assert slug(answer) == "code-invalid"
    clock[0] += 60.0
    assert browser.post("/v1/session/by-code", json=code).status_code == 201


def test_all_addresses_together_get_thirty_wrong_codes_a_minute():
    """Whoever changes the address gains nothing, and what is kept stays small."""
    now_s = [0.0]
    limit = GuessLimit(lambda: now_s[0])
    read = 0
    for number in range(1000):
        address = f"192.0.2.{number}"
        if limit.wait_s(address) == 0.0:
            limit.note(address)
            read += 1
    assert read == 30
    assert len(limit._wrong) <= 31
    now_s[0] = 60.0
    assert limit.wait_s("192.0.2.1") == 0.0


def test_uses_and_failures_are_told(rig, clock, browser):
    """Making and using are events with the token's name, failures are logged, and no code is."""
    code = made(rig.operator)
    with structlog.testing.capture_logs() as lines:
        browser.post("/v1/session/by-code", json=WRONG)
        browser.post("/v1/session/by-code", json={"code": code})
    failed = [line for line in lines if line["event"] == "authentication failed"]
    assert [(one["address"], one["what"], one["path"]) for one in failed] == [
        ("192.0.2.10", "code", "/v1/session/by-code")
    ]

    def told() -> list[tuple[str, str, int]]:
        items = rig.reader.get("/v1/log?about=people&limit=5").json()["items"]
        found = [item["data"] for item in items if item["kind"] == "request"]
        return [(one["by"], one["path"], one["status"]) for one in found]

    events = until(told, lambda found: found[0][1] == "/v1/session/by-code")
    assert events[:2] == [
        ("operate token", "/v1/session/by-code", 201),
        ("operate token", "/v1/sign-in-codes", 201),
    ]
    assert code not in str(lines)
    assert code not in rig.reader.get("/v1/log?limit=50").text


def test_only_the_hash_of_a_code_is_kept():
    """What is in memory is not the code."""
    codes = SignInCodes()
    code = codes.make(1)
    kept = str(vars(codes))
    assert code not in kept
    assert code.replace("-", "") not in kept


@pytest.mark.parametrize("body", [{}, {"code": ""}, {"code": 5}, {"code": "x" * 65}])
def test_what_is_no_code_at_all_is_named(rig, clock, body):
    """422 with the field, as everywhere; it is no guess."""
    answer = rig.anybody.post("/v1/session/by-code", json=body)
    assert answer.status_code == 422
    assert "code" in answer.json()["detail"]


@pytest.mark.parametrize("code", ["ü" * 8, "\x00", "----", " ", "ſ" * 8])
def test_odd_text_is_a_wrong_code(rig, clock, browser, code):
    """401, whatever it looks like."""
    assert browser.post("/v1/session/by-code", json={"code": code}).status_code == 401


def test_a_form_of_another_site_signs_nobody_in(rig, clock, browser):
    """A code comes as JSON, which no form can send."""
    code = made(rig.reader)
    for kind in ("application/x-www-form-urlencoded", "text/plain", "multipart/form-data"):
        content = f'{{"code": "{code}"}}'
        answer = browser.post(
            "/v1/session/by-code", content=content, headers={"Content-Type": kind}
        )
        assert answer.status_code == 415


def test_the_description_says_who_may(rig):
    """In OpenAPI, using a code needs no token, and making one needs one."""
    paths = rig.anybody.get("/openapi.json").json()["paths"]
    assert paths["/v1/session/by-code"]["post"]["security"] == []
    assert {"HTTPBearer": []} in paths["/v1/sign-in-codes"]["post"]["security"]
