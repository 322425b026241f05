"""Options for a real rig: ``pytest --hardware --hardware-config rig.toml tests/conformance``."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest


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
