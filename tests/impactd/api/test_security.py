"""Who may do what."""

from __future__ import annotations

import uuid

import httpx2
import pytest

from impactd.api.app import create_app
from impactd.api.security import LOOPBACK, PUBLIC, ROUTE_SCOPES, Scope

_IDS = {
    "{number}": "1",
    "{fit_id}": "1",
    "{calibration_id}": "1",
    "{diagnosis_id}": "1",
    "{folder}": "css",
    "{name}": "base.css",
}


def _path(template: str) -> str:
    for name, value in _IDS.items():
        template = template.replace(name, value)
    return template


def _guarded(scope: Scope) -> list[tuple[str, str]]:
    return [route for route, needed in ROUTE_SCOPES.items() if needed == scope]


def test_every_route_stands_in_the_table_and_nothing_else_does(rig):
    """The scope table and the routes are the same list."""
    app = create_app(rig.daemon)
    routes = {
        (method.upper(), path)
        for path, operations in app.openapi()["paths"].items()
        for method in operations
    }
    undescribed = {"/openapi.json", "/guides", "/guides/{name:path}"}
    assert routes | {("GET", path) for path in undescribed} == set(ROUTE_SCOPES)


@pytest.mark.parametrize(
    "route", [route for route, needed in ROUTE_SCOPES.items() if isinstance(needed, Scope)]
)
def test_a_route_with_a_scope_refuses_a_request_without_a_token(rig, route):
    """No token, no answer: 401 as a problem that says how to get one."""
    method, path = route
    answer = rig.anybody.request(method, _path(path))
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")
    if method != "HEAD":
        assert answer.json()["type"] == "urn:impactd:problem:token-missing"


@pytest.mark.parametrize("route", _guarded(Scope.OPERATE))
def test_a_read_token_moves_nothing(rig, route):
    """A token without scope `operate` is refused by everything that moves, before it moves."""
    method, path = route
    before = rig.daemon.archive.drops()
    answer = rig.reader.request(
        method, _path(path), json={}, headers={"Idempotency-Key": str(uuid.uuid4())}
    )
    assert answer.status_code == 403
    assert answer.json()["scope"] == "operate"
    assert rig.daemon.archive.drops() == before


@pytest.mark.parametrize("route", _guarded(Scope.ADMIN))
def test_an_operate_token_does_not_administrate(rig, route):
    """Scope `operate` does not hold `admin`."""
    method, path = route
    assert rig.operator.request(method, _path(path), json={"name": "kv"}).status_code == 403


@pytest.mark.parametrize(
    "token", ["x", "impactd_" + "A" * 43, "\N{LATIN SMALL LETTER SHARP S}"], ids=repr
)
def test_a_token_nobody_made_is_refused(rig, token):
    """An invented token gets 401, whatever it looks like."""
    header = b"Bearer " + token.encode()
    answer = rig.anybody.get("/v1/drops", headers=[(b"Authorization", header)])
    assert answer.status_code == 401


def test_a_revoked_token_is_refused_at_once(rig):
    """Revoking takes effect on the next request."""
    tokens = rig.daemon.archive.tokens
    token, secret = tokens.create("short", "read", 1)
    client = httpx2.Client(
        base_url=rig.url, headers={"Authorization": f"Bearer {secret}"}, trust_env=False
    )
    with client:
        assert client.get("/v1/drops").status_code == 200
        tokens.revoke(token.id)
        answer = client.get("/v1/drops")
    assert answer.status_code == 401
    assert answer.json()["type"] == "urn:impactd:problem:token-invalid"


def test_an_expired_token_is_refused(rig):
    """A token dies on its day."""
    _, secret = rig.daemon.archive.tokens.create("mayfly", "read", 1e-9)
    answer = rig.anybody.get("/v1/drops", headers={"Authorization": f"Bearer {secret}"})
    assert answer.status_code == 401


def test_a_larger_scope_holds_the_smaller_ones(rig):
    """An admin token may read."""
    assert rig.admin.get("/v1/drops").status_code == 200


def test_public_and_loopback_routes_answer_without_a_token(rig):
    """Health, metrics and status can be watched from the same machine without a secret."""
    for (method, path), needed in ROUTE_SCOPES.items():
        if needed in (PUBLIC, LOOPBACK) and method == "GET":
            # the manual may not be built; tests/impactd/api/test_guides.py has one
            usual = {307, 404} if path.startswith("/guides") else {200}
            assert rig.anybody.request(method, _path(path)).status_code in usual, path


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "", "[::1", "localhost@x"]
)
def test_a_foreign_host_name_is_refused(rig, host):
    """DNS rebinding ends at the Host header."""
    answer = rig.reader.get("/v1/status", headers={"Host": host})
    assert answer.status_code in (400, 421)
    if answer.status_code == 421:
        assert answer.json()["type"] == "urn:impactd:problem:host-not-allowed"


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:1", "127.0.0.1:8642", "[::1]:8642"])
def test_a_local_host_name_is_served(rig, host):
    """The names of this machine are allowed with any port."""
    assert rig.anybody.get("/v1/status", headers={"Host": host}).status_code == 200


def test_every_answer_carries_the_security_headers(rig):
    """Good and bad answers alike cannot be framed, sniffed or cached."""
    for path in ("/v1/status", "/v1/drops", "/nowhere"):
        headers = rig.anybody.get(path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["cache-control"] == "no-store"
        assert "server" not in headers


def test_no_other_site_may_read_answers(rig):
    """There is no CORS: a preflight request is an unknown method."""
    answer = rig.anybody.options(
        "/v1/drops",
        headers={"Origin": "https://evil.example", "Access-Control-Request-Method": "POST"},
    )
    assert answer.status_code == 405
    assert not [name for name in answer.headers if name.startswith("access-control")]
