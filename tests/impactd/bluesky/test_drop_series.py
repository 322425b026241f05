"""A series of drops under Bluesky's RunEngine, read back from a Tiled server."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from impactd.client import AsyncRig, mm
from tests.impactd.api.conftest import Rig, run_daemon, simulated_settings

# ruff: noqa: E402 - what is optional is asked for first
for needed in ("bluesky", "ophyd_async", "tiled", "xarray"):
    pytest.importorskip(needed)
from bluesky.callbacks.tiled_writer import TiledWriter
from bluesky.run_engine import RunEngine
from tiled.client import from_uri

from impactd.bluesky.detector import ImpactDetector
from impactd.bluesky.plans import drop_series

pytestmark = [pytest.mark.integration, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A daemon that answers."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("daemon")))


@pytest.fixture
def tiled(tmp_path: Path) -> Iterator[str]:
    """A Tiled server on loopback; the address of its catalogue."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        sys.executable, "-m", "tiled", "serve", "catalog", "--temp", "--api-key", "secret",
        "--host", "127.0.0.1", "--port", str(port), "-r", str(tmp_path / "shots"),
    ]  # fmt: skip
    (tmp_path / "shots").mkdir()
    with (tmp_path / "tiled.log").open("w") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ})
    try:
        for _ in range(600):
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except OSError:
                assert process.poll() is None, (tmp_path / "tiled.log").read_text()
                time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(timeout=30)


@pytest.mark.filterwarnings("ignore")
def test_a_series_is_read_back_from_tiled(served: Rig, tiled: str, tmp_path: Path) -> None:
    """Two drops of one run come back as xarray: numbers with U, and every sample of the files."""
    engine = RunEngine({})
    client = from_uri(tiled, api_key="secret")
    engine.subscribe(TiledWriter(client))
    rig = AsyncRig(served.url, served.token("operate"), operator="ab")
    detector = ImpactDetector(rig, tmp_path / "shots")
    (uid,) = engine(drop_series(detector, "acetal", "aluminium", 30 * mm, repeats=2))
    run = client[uid]
    assert run.metadata["start"]["sphere"] == "acetal"
    found = run["primary"].read()
    assert found["impact-reduced_modulus"].size == 2
    assert np.all(found["impact-reduced_modulus_U"] > 0)
    codes = np.asarray(found["impact-codes"]).reshape(2, -1)
    for row, number in zip(codes, np.asarray(found["impact-shot"]), strict=True):
        with h5py.File(tmp_path / "shots" / f"shot-{int(number):06d}.h5") as file:
            np.testing.assert_array_equal(row, file["entry/instrument/digitizer/data"][()])
    asyncio.run_coroutine_threadsafe(rig.close(), engine.loop).result(30)
    client.context.http_client.close()
    engine.loop.call_soon_threadsafe(engine.loop.stop)
