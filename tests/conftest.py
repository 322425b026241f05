"""Options for a real rig: ``pytest --hardware --hardware-config rig.toml tests/conformance``."""

from __future__ import annotations

import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from impactd import blas_threads

blas_threads.keep_to_one()  # as in every process of the program; before anything imports numpy

from impactd.storage.lasting import why_not_lasting  # noqa: E402 - see above

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the two options."""
    parser.addoption("--hardware", action="store_true", help="also test the real rig")
    parser.addoption(
        "--hardware-config",
        type=Path,
        help="TOML with a [digitizer] and a [valve] table: `driver` and the driver's settings",
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what needs a rig unless one is there."""
    if config.getoption("--hardware"):
        return
    for item in items:
        if item.get_closest_marker("hardware"):
            item.add_marker(pytest.mark.skip(reason="needs a real rig: --hardware"))


@pytest.fixture(scope="session")
def hardware_config(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the content of --hardware-config."""
    path: Path | None = request.config.getoption("--hardware-config")
    if path is None:
        pytest.skip("needs --hardware-config FILE")
    return tomllib.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def chromium() -> str:
    """Where Debian's chromium is."""
    if CHROMIUM is None:
        pytest.skip("needs chromium; on Debian: apt install chromium")
    return CHROMIUM


# One for each file: Playwright's event loop runs in the main thread as long as it lives,
# and a test of another folder that runs its own there would be refused.
@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[object]:
    """Debian's chromium, without a window."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    with playwright.sync_playwright() as engine:
        # Chromium refuses its own sandbox to root, who runs the tests in a container.
        options = ["--no-sandbox"] if os.geteuid() == 0 else []
        found = engine.chromium.launch(executable_path=chromium, args=options)
        yield found
        found.close()


@pytest.fixture
def lasting_folder() -> Iterator[Path]:
    """Return a folder on a disk, outside the folders for temporary files; skip without one."""
    for place in (Path.home(), Path("/var/lib"), Path.cwd()):
        if why_not_lasting(place) is None and os.access(place, os.W_OK):
            folder = Path(tempfile.mkdtemp(prefix="impactd-test-", dir=place))
            yield folder
            shutil.rmtree(folder)
            return
    pytest.skip("no folder here keeps files")
