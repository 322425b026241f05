"""A real daemon in a process of its own, and Debian's chromium looking at its page."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from impactd.data_lock import read_holder
from impactd.storage.archive import Archive
from tests.simulated_rig import write_simulated_rig

TABLET = {"width": 768, "height": 1024}
SMALL_SCREEN = {"width": 1024, "height": 768}
DESKTOP = {"width": 1440, "height": 900}
PATIENCE_MS = int(os.environ.get("PATIENCE_MS", "200000"))
"""A busy host compiles for a minute before the first fit; less than a test's limit, so that what
was waited for is named."""


class Daemon:
    """`impactd serve` on the simulated rig, which can be killed and started again.

    The rig's clock runs fast; `delay_s` is how long its technician takes to hang a sphere.
    """

    def __init__(self, folder: Path, *, delay_s: float = 0.0) -> None:
        self.folder = folder
        self.data = folder / "data"
        delay = {"technician_delay_s = 0.0": f"technician_delay_s = {delay_s}"}
        self.config = write_simulated_rig(folder, clock_speed="8.0", changes=delay)
        self.url = ""
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, on the port it had before."""
        port = self.url.rpartition(":")[2] or "0"
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen(
                self._command("serve", "--port", port), stdout=log, stderr=log
            )
        end_s = time.monotonic() + 280  # a starved host imports for minutes
        while True:
            holder = read_holder(self.data) if self.data.is_dir() else {}
            if holder.get("pid") == self.process.pid and holder.get("url"):
                self.url = str(holder["url"])
                return
            said = (self.folder / "log").read_text(encoding="utf-8")[-2000:]
            assert self.process.poll() is None, said
            assert time.monotonic() < end_s, said
            time.sleep(0.1)

    def token(self, scope: str = "operate") -> str:
        """Return a fresh token, made as a person makes it."""
        made = subprocess.run(
            self._command("token", "create", "--scope", scope, "--name", f"the {scope}"),
            capture_output=True,
            text=True,
            check=True,
        )
        return made.stdout.strip()

    def sign_in_code(self, scope: str = "operate") -> dict[str, str]:
        """Return a sign-in code with its link, made as a person makes it."""
        made = subprocess.run(
            [sys.executable, "-m", "impactd", "sign-in-code", "--json", "--url", self.url],
            env={**os.environ, "IMPACTD_TOKEN": self.token(scope)},
            capture_output=True,
            text=True,
            check=True,
        )
        return json.loads(made.stdout)

    def raise_alarms(self, *alarms: tuple[str, str, str]) -> None:
        """Write alarms into the archive of a daemon that does not run."""
        with Archive.open(self.data, reserve_bytes=0) as archive:
            for alarm in alarms:
                archive.alarms.raise_alarm(*alarm)

    def kill(self) -> None:
        """End it as a power cut does."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> None:
        """End it in order."""
        if self.process is not None and self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(30)
            except subprocess.TimeoutExpired:
                self.kill()

    def _command(self, *words: str) -> list[str]:
        own = ["--config", str(self.config), "--data", str(self.data)]
        return [sys.executable, "-m", "impactd", *words, *own]


class Visitor:
    """A browser's tab, with everything it complained of and everybody it asked."""

    def __init__(self, daemon: Daemon, browser, *, size: dict[str, int], **context) -> None:
        self.daemon = daemon
        self.context = browser.new_context(viewport=size, accept_downloads=True, **context)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.hosts.add(request.url.split("/")[2]))

    def _heard(self, message) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def sign_in(self, scope: str = "operate") -> None:
        """Go through the first visit."""
        self.page.goto(self.daemon.url)
        self.page.get_by_label("Token").fill(self.daemon.token(scope))
        self.page.get_by_role("button", name="Sign in").click()
        self.page.get_by_role("heading", name="Drop", exact=True).wait_for()

    def go(self, view: str) -> None:
        """Choose a view as a person does."""
        self.page.get_by_role("navigation").get_by_role("link", name=view).click()
        self.page.get_by_role("heading", name=view, level=1).wait_for()

    def choose(self, sphere: str, surface: str, height_mm: float, drops: int = 1) -> None:
        """Fill in what is to be dropped."""
        self.page.get_by_role("radio", name=sphere).first.check()
        self.page.get_by_role("group", name="Surface").get_by_role("radio", name=surface).check()
        self.page.get_by_label("Drop height / mm").fill(str(height_mm))
        self.page.get_by_label("Drops", exact=True).fill(str(drops))
        self.page.get_by_label("Operator").fill("Ada")

    def arm_and_drop(self) -> None:
        """Press the large button once the rig is ready."""
        self.page.locator(".go button[aria-disabled=false]").click()

    def shot(self, number: int) -> None:
        """Wait until a shot and its modulus are shown."""
        self.page.get_by_role("heading", name=f"Shot {number}", exact=True).wait_for()
        self.page.locator(".modulus").wait_for()

    def assert_clean(self) -> None:
        """Nothing was complained of, nobody else was asked."""
        assert self.complaints == []
        assert self.hosts == {self.daemon.url.removeprefix("http://")}


@pytest.fixture(scope="session")
def daemon(tmp_path_factory: pytest.TempPathFactory, chromium: str) -> Iterator[Daemon]:
    """Share one daemon among the tests that leave it as they found it: idle."""
    one = Daemon(tmp_path_factory.mktemp("daemon"))
    try:
        one.start()
        yield one
    finally:
        one.stop()


def at_three_sizes(fixture: str) -> pytest.MarkDecorator:
    """Run a test with a visitor on a tablet, and among the slow tests on two other screens."""
    slow = pytest.mark.slow
    sizes = (TABLET, pytest.param(SMALL_SCREEN, marks=slow), pytest.param(DESKTOP, marks=slow))
    return pytest.mark.parametrize(
        fixture, sizes, indirect=True, ids=("tablet", "small", "desktop")
    )


@pytest.fixture
def visitor(request: pytest.FixtureRequest, daemon: Daemon, browser) -> Iterator[Visitor]:
    """A fresh browser, on a tablet unless a test asks for another size."""
    one = Visitor(daemon, browser, size=getattr(request, "param", TABLET))
    yield one
    one.context.close()


@pytest.fixture
def slow_hands(request: pytest.FixtureRequest, tmp_path: Path, browser) -> Iterator[Visitor]:
    """A browser before a rig whose technician takes long, on a daemon of its own."""
    with _visitor_of(
        tmp_path, browser, delay_s=60.0, size=getattr(request, "param", DESKTOP)
    ) as one:
        yield one


@pytest.fixture
def calm_hands(tmp_path: Path, browser) -> Iterator[Visitor]:
    """Two seconds for every sphere: what a series says between its drops can be read."""
    with _visitor_of(tmp_path, browser, delay_s=2.0) as one:
        yield one


@contextmanager
def _visitor_of(
    folder: Path, browser, *, delay_s: float, size: dict[str, int] = DESKTOP
) -> Iterator[Visitor]:
    daemon = Daemon(folder, delay_s=delay_s)
    try:
        daemon.start()
        one = Visitor(daemon, browser, size=size)
        yield one
        one.context.close()
    finally:
        daemon.stop()
