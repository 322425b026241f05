"""Anything a client may send: a problem document, never a failure, and nothing lost."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from impactd.storage.archive import FINAL_STATES, Archive

from ..storage.daemon_process import DaemonProcess, until

# Left out: the event stream, which never ends; readiness and metrics, whose 503 and text are their
# purpose. Of the checks, those that take every schema-valid value for acceptable, because which
# models, shots and heights a rig knows stands in no schema, and a deleted resource for gone, as
# DELETE of a drop, a calibration or a diagnosis ends it and its row stays. One worker: the tool
# parses sources as it goes, and before Python 3.11.8 `ast` fails in two threads at once
# (python/cpython issue 106905).
LEFT_OUT = ("/v1/events", "/readyz", "/metrics")
NOT_ASKED = "positive_data_acceptance,use_after_free"


def _fuzz(folder: Path, examples: int, at_least: int, *phases: str) -> None:
    daemon = DaemonProcess(
        folder, clock_speed="inf", changes={"loading_s = 20.0": "loading_s = 2.0"}
    )
    with Archive.open(daemon.data, reserve_bytes=0) as archive:
        secret = archive.tokens.create("fuzzer", "admin")[1]
    outside = _files(folder, but=daemon.data)
    daemon.start()
    try:
        done = subprocess.run(
            [str(Path(sys.executable).with_name("schemathesis")), "run"]
            + [f"{daemon.url}/openapi.json", "-H", f"Authorization: Bearer {secret}"]
            + [part for path in LEFT_OUT for part in ("--exclude-path", path)]
            + ["--exclude-checks", NOT_ASKED, "-n", str(examples)]
            + [f"--phases={','.join(phases)}"]
            + ["--continue-on-failure", "--seed", "1", "--workers", "1", "--no-color"]
            + ["--generation-database", "none", "--suppress-health-check", "all"],
            capture_output=True,
            text=True,
            check=False,
            cwd=folder.parent,
        )
        found = re.search(r"(\d+) generated", done.stdout)
        assert found is not None, done.stdout[-3000:]
        print(f"schemathesis, {', '.join(phases)}: {found[1]} cases, exit {done.returncode}")
        assert done.returncode == 0, done.stdout[-6000:]
        assert int(found[1]) >= at_least
        assert daemon.client is not None
        daemon.client.post("/v1/abort")
        until(lambda: daemon.get("/v1/status"), lambda status: status["ready"])
    finally:
        daemon.stop()
    assert _files(folder, but=daemon.data) - outside <= {folder / "serve.log", daemon.journal}
    log = daemon.log.read_text()
    assert "Traceback" not in log
    assert secret not in log
    with Archive.open(daemon.data, reserve_bytes=0) as archive:
        assert [found for found in archive.verify() if found.problem is not None] == []
        for drop in archive.drops(limit=200):
            assert drop.state in FINAL_STATES, drop
            if drop.shot is not None:
                assert archive.read_shot(drop.shot).recording.samples.size


def _files(folder: Path, *, but: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.is_file() and but not in path.parents}


def test_generated_requests_meet_no_failure(tmp_path: Path) -> None:
    """A drawn request for each operation: no 5xx, no answer beside its schema, nothing lost."""
    _fuzz(tmp_path / "rig", 1, 100, "fuzzing")


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("examples", "cases"),
    [(8, 1000), pytest.param(150, 5000, marks=pytest.mark.soak)],
)
def test_thousands_of_generated_requests_meet_no_failure(
    tmp_path: Path, examples: int, cases: int
) -> None:
    """At least so many, at the limits of each value, with links from answer to request."""
    _fuzz(tmp_path / "rig", examples, cases, "examples", "coverage", "fuzzing", "stateful")


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory):
    """A daemon with one shot, in a process of its own."""
    running = DaemonProcess(tmp_path_factory.mktemp("raw") / "rig", clock_speed="inf")
    running.start()
    body = {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "operator": "ab"}
    running.post("/v1/drops", body, "first")
    until(lambda: running.get("/v1/drops/1"), lambda drop: drop["shot"] is not None)
    yield running
    running.stop()


def _raw(daemon: DaemonProcess, request: bytes) -> bytes:
    """Send bytes as they are; return the beginning of what comes back."""
    host, port = daemon.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        try:
            connection.sendall(request)
            return b"".join(iter(lambda: connection.recv(65536), b""))
        except (BrokenPipeError, ConnectionResetError):
            return b""


PATHS = [
    "/v1/shots/../../../../etc/passwd",
    "/v1/shots/..%2f..%2f..%2fetc%2fpasswd",
    "/v1/shots/%2e%2e/%2e%2e/index.sqlite",
    "/v1/shots/1.h5/../../../index.sqlite",
    "/v1/shots/..\\..\\index.sqlite",
    "/v1/shots/1%00.h5",
    "/v1/shots/1.h5%00",
    "//etc/passwd",
    "/v1/diagnoses/../../etc/passwd/report.html",
    "/v1/shots/999999999999999999999999.h5",
    "/v1/shots/-1.h5",
    "/v1/shots/١.h5",
]


@pytest.mark.parametrize("path", PATHS)
def test_no_path_leads_out_of_the_archive(daemon: DaemonProcess, path: str) -> None:
    """Whatever is asked for by path is refused by name."""
    token = daemon._headers["Authorization"]
    head = f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: {token}\r\n"
    answer = _raw(daemon, f"{head}Connection: close\r\n\r\n".encode())
    status = int(answer.split(b" ", 2)[1])
    assert 400 <= status < 500, answer[:200]
    assert b"root:" not in answer
    assert b"SQLite" not in answer


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"null",
        b"[]",
        b'{"sphere":"../../x","surface":"aluminium","drop_height_m":0.03,"operator":"ab"}',
        b'{"sphere":"acetal","surface":"aluminium","drop_height_m":1e999,"operator":"ab"}',
        b'{"sphere":"acetal","surface":"aluminium","drop_height_m":NaN,"operator":"ab"}',
        b'{"sphere":"\\ud800","surface":"aluminium","drop_height_m":0.03,"operator":"ab"}',
        b'{"a":' * 30_000,
        b"[" * 60_000,
        b"1" * 60_000,
    ],
    ids=lambda body: repr(body[:24]),
)
def test_a_malformed_body_is_answered_with_a_problem(daemon: DaemonProcess, body: bytes) -> None:
    """4xx with what is wrong; no drop."""
    assert daemon.client is not None
    before = daemon.get("/v1/drops")
    answer = daemon.client.post(
        "/v1/drops",
        content=body,
        headers={"Content-Type": "application/json", "Idempotency-Key": "malformed"},
    )
    assert 400 <= answer.status_code < 500, answer.text
    assert answer.json()["type"].startswith("urn:impactd:problem:")
    assert daemon.get("/v1/drops") == before


@pytest.mark.parametrize("chunked", [False, True])
def test_ten_megabytes_are_refused_at_the_door(daemon: DaemonProcess, chunked: bool) -> None:
    """With and without a stated length: 413, and the daemon goes on."""
    token = daemon._headers["Authorization"]
    head = (
        "POST /v1/drops HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        f"Authorization: {token}\r\nIdempotency-Key: large\r\n"
    ).encode()
    if chunked:
        chunk = b"10000\r\n" + b"x" * 65536 + b"\r\n"
        answer = _raw(daemon, head + b"Transfer-Encoding: chunked\r\n\r\n" + 160 * chunk)
    else:
        answer = _raw(daemon, head + b"Content-Length: 10485760\r\n\r\n" + b"x" * 10_485_760)
    # A client that still sends may find the connection closed before it has read the answer.
    assert answer == b"" or answer.startswith(b"HTTP/1.1 413")
    assert daemon.get("/v1/status")["ready"]


@pytest.mark.parametrize("moment", ["1.7976931348623157e308", "-1e308", "1e7", "nan", "inf"])
def test_a_moment_beyond_any_record_is_refused(daemon: DaemonProcess, moment: str) -> None:
    """422, not an overflow."""
    assert daemon.client is not None
    for name in ("start_s", "stop_s"):
        answer = daemon.client.get("/v1/shots/1/trace", params={name: moment})
        assert answer.status_code == 422, answer.text
