"""A token is seen once by who asked for it, and by nobody else in any place."""

from __future__ import annotations

import ast
import os
import stat
import subprocess
import sys
import urllib.parse
import uuid
from pathlib import Path

import httpx2
import pytest

from impactd.api.security import LOOPBACK, PUBLIC, ROUTE_SCOPES, Scope

from ..storage.daemon_process import DROP, DaemonProcess, until

API = Path(__file__).parents[3] / "impactd" / "api"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory):
    """A daemon in a process of its own, started with an ordinary umask."""
    before = os.umask(0o022)
    running = DaemonProcess(tmp_path_factory.mktemp("secrets") / "rig", clock_speed="inf")
    running.start()
    os.umask(before)
    yield running
    running.stop()


def _token(daemon: DaemonProcess, scope: str) -> str:
    """Make a token as a person does."""
    command = [sys.executable, "-m", "impactd", "token", "create", "--scope", scope]
    command += ["--config", str(daemon.config), "--data", str(daemon.data)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return next(word for word in done.stdout.split() if word.startswith("impactd_"))


def test_no_secret_is_written_anywhere(daemon: DaemonProcess) -> None:
    """Used rightly and wrongly, in headers, paths, queries and bodies: in no log and no file."""
    secret = _token(daemon, "operate")
    bearer = {"Authorization": f"Bearer {secret}"}
    with httpx2.Client(base_url=daemon.url, timeout=30, trust_env=False) as client:
        logged_in = client.post("/v1/session", headers=bearer)
        secrets = [secret, logged_in.json()["csrf"], client.cookies["impactd_session"]]
        client.cookies.clear()
        code = client.post("/v1/sign-in-codes", headers=bearer).json()["code"]
        secrets += [code, code.replace("-", "")]
        for _ in range(2):  # rightly, then once too often
            client.post("/v1/session/by-code", json={"code": code})
            client.cookies.clear()
        answers = [
            client.get("/v1/drops", headers=bearer),
            client.get(f"/v1/drops?token={secret}&access_token={secret}"),
            client.get(f"/v1/{secret}", headers=bearer),
            client.get("/v1/drops", headers={"Authorization": f"Basic {secret}"}),
            client.get("/v1/drops", headers={"Authorization": secret}),
            client.post("/v1/drops", json={"sphere": secret}, headers=bearer),
            client.post("/v1/drops", json=DROP, headers=bearer | {"Idempotency-Key": "a"}),
            client.post("/v1/abort", headers=bearer),
        ]
    for answer in answers:
        for value in answer.headers.values():
            assert secret not in value
    until(lambda: daemon.get("/v1/status"), lambda status: status["ready"])
    files = [path for path in daemon.data.rglob("*") if path.is_file()] + [daemon.log]
    for path in files:
        content = path.read_bytes()
        for one in secrets:
            assert one.encode() not in content, path


def test_a_token_in_a_url_opens_nothing(daemon: DaemonProcess) -> None:
    """URLs end in histories and logs: a token there is no token."""
    secret = urllib.parse.quote(_token(daemon, "admin"))
    for query in (f"token={secret}", f"access_token={secret}", f"Authorization=Bearer%20{secret}"):
        answer = httpx2.get(f"{daemon.url}/v1/drops?{query}", trust_env=False)
        assert answer.status_code == 401


def test_nothing_in_the_data_directory_is_open_to_others(daemon: DaemonProcess) -> None:
    """Neither to read nor to write, whatever the umask."""
    assert not stat.S_IMODE(daemon.data.stat().st_mode) & stat.S_IRWXO
    for path in daemon.data.rglob("*"):
        mode = stat.S_IMODE(path.stat().st_mode)
        assert not mode & stat.S_IWOTH, path


def test_a_revoked_token_is_listed_and_opens_nothing(daemon: DaemonProcess) -> None:
    """As a person does it: create, list, revoke; the list never shows a secret."""
    secret = _token(daemon, "read")
    where = ["--config", str(daemon.config), "--data", str(daemon.data)]
    run = [sys.executable, "-m", "impactd", "token"]
    listed = subprocess.run([*run, "list", *where], capture_output=True, text=True, check=True)
    assert secret not in listed.stdout
    bearer = {"Authorization": f"Bearer {secret}"}
    assert httpx2.get(f"{daemon.url}/v1/drops", headers=bearer, trust_env=False).is_success
    number = max(int(word) for word in listed.stdout.split() if word.isdigit())
    subprocess.run([*run, "revoke", str(number), *where], capture_output=True, check=True)
    answer = httpx2.get(f"{daemon.url}/v1/drops", headers=bearer, trust_env=False)
    assert answer.status_code == 401


def _routes_in_the_code() -> set[tuple[str, str]]:
    """Return method and path of every handler, read from the source and not from the program."""
    found = set()
    for path in (API / "routes").glob("*.py"):
        tree, prefix = ast.parse(path.read_text()), ""
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "APIRouter":
                given = {word.arg: ast.literal_eval(word.value) for word in node.keywords}
                prefix = str(given.get("prefix", ""))
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                for mark in node.decorator_list:
                    if isinstance(mark, ast.Call) and ast.unparse(mark.func).startswith("router."):
                        method = ast.unparse(mark.func).removeprefix("router.").upper()
                        found.add((method, prefix + str(ast.literal_eval(mark.args[0]))))
    return found


def test_every_handler_has_its_scope() -> None:
    """The table and the code know the same routes; what writes is open only to a sign-in code."""
    assert _routes_in_the_code() | {("GET", "/openapi.json")} == set(ROUTE_SCOPES)
    for (method, path), needed in ROUTE_SCOPES.items():
        if needed in (PUBLIC, LOOPBACK):
            assert method == "GET" or path == "/v1/session/by-code", path
        elif method not in ("GET", "HEAD") and path not in ("/v1/session", "/v1/sign-in-codes"):
            assert isinstance(needed, Scope)
            assert needed >= Scope.OPERATE, path


def test_a_page_of_another_site_moves_nothing(daemon: DaemonProcess) -> None:
    """Forms and scripts of other sites: wrong type, no second secret, no permission to read."""
    bearer = {"Authorization": f"Bearer {_token(daemon, 'operate')}"}
    with httpx2.Client(base_url=daemon.url, timeout=30, trust_env=False) as browser:
        browser.post("/v1/session", headers=bearer)
        before = daemon.get("/v1/drops")
        elsewhere = {"Origin": "https://evil.example", "Idempotency-Key": str(uuid.uuid4())}
        forms = ("application/x-www-form-urlencoded", "text/plain", "multipart/form-data")
        for kind in forms:
            answer = browser.post(
                "/v1/drops", content=b"{}", headers=elsewhere | {"Content-Type": kind}
            )
            assert answer.status_code == 415
        for method, path in (
            ("POST", "/v1/drops"),
            ("POST", "/v1/abort"),
            ("DELETE", "/v1/drops/1"),
        ):
            answer = browser.request(method, path, headers=elsewhere)
            assert answer.status_code == 403, path
            assert not [name for name in answer.headers if name.startswith("access-control")]
        assert daemon.get("/v1/drops") == before
