"""The clients before a real daemon on the simulated rig."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from impactd.client import AsyncRig, Rig
from tests.impactd.api.conftest import Rig as Served
from tests.impactd.api.conftest import run_daemon, simulated_settings


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A daemon that answers."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("daemon")))


@pytest.fixture(scope="module")
def rig(served: Served) -> Iterator[Rig]:
    """A client that may operate it."""
    with Rig(served.url, served.token("operate"), operator="ab") as found:
        found.wait_until_ready()
        yield found


@pytest.fixture
def make_async(served: Served) -> Callable[[], AsyncRig]:
    """Make a client of the other kind, in the event loop of the test."""
    return lambda: AsyncRig(served.url, served.token("operate"), operator="ab")
