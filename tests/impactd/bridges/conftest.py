"""Bridges before a real daemon."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.impactd.api.conftest import Rig, run_daemon, simulated_settings


@pytest.fixture(scope="package")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A daemon that answers."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("daemon")))
