"""A small disk of its own, for tests that fill it; and the figures of all, at the end of a run."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import structlog

DISK_BYTES = 64 * 1024 * 1024


@pytest.fixture(autouse=True, scope="session")
def _logs_beside_the_figures() -> None:
    """Let what a daemon in this process logs go to stderr, as it does in production."""
    structlog.configure(logger_factory=lambda *_: structlog.PrintLogger(sys.stderr))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what the tests measured, also those that ran in processes of their own."""
    passed = [
        report
        for report in terminalreporter.getreports("passed")
        if report.when == "call" and report.capstdout and report.nodeid.startswith("tests/faults/")
    ]
    if passed:
        terminalreporter.section("what was measured")
    for report in passed:
        terminalreporter.write_line(report.nodeid)
        terminalreporter.write_line(report.capstdout.rstrip())


class Disk:
    """A tmpfs, and a ballast file that takes its space."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ballast = path / "ballast"

    def leave(self, free_bytes: int) -> None:
        """Let so much be free, to the page. [B]"""
        with self._ballast.open("ab") as ballast:
            while True:
                at = ballast.tell()
                more = self.free() - free_bytes
                if more <= 0:
                    ballast.truncate(max(at + more, 0))
                    return
                try:
                    os.posix_fallocate(ballast.fileno(), at, more)
                except OSError as error:
                    if error.errno != errno.ENOSPC:  # else somebody wrote meanwhile
                        raise
                else:
                    return

    def free(self) -> int:
        """Return what is free. [B]"""
        found = os.statvfs(self.path)
        return found.f_bavail * found.f_frsize


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    """Mount a small disk, or skip where that is not allowed."""
    path = tmp_path / "disk"
    path.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "none", str(path)]
    done = subprocess.run(mount, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"a small disk cannot be mounted here (root is needed): {done.stderr.strip()}")
    try:
        yield Disk(path)
    finally:
        subprocess.run(["umount", "--lazy", str(path)], check=True)
