"""A whole simulated laboratory behind the service: real drivers, archive and threads."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated.world import World
from impactd.acquisition.service import AcquisitionService
from impactd.acquisition.transitions import State
from impactd.rig.build import build_rig
from impactd.settings.instrument import Usb2637Section
from impactd.settings.materials import load_materials
from impactd.settings.sections import EnvironmentSection
from impactd.settings.settings import Settings, find_config, load_settings
from impactd.storage.archive import Archive, Drop, DropRequest

REQUEST = DropRequest("acetal", "aluminium", 0.03, "ab")


class Laboratory:
    """A service on a simulated rig that runs four times as fast as a real one."""

    def __init__(self, directory: Path, **changes: dict[str, Any]) -> None:
        self.directory = directory
        self.settings = laboratory_settings(directory, **changes)
        materials = load_materials(self.settings.materials.file)
        self.rig = build_rig(self.settings, materials)
        assert self.rig.world is not None
        self.world: World = self.rig.world
        self.archive = Archive.open(directory, reserve_bytes=0)
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.service = AcquisitionService(
            self.rig, self.archive, self.settings, materials, self._publish
        )
        self._watched: dict[State, threading.Event] = {}

    def _publish(self, kind: str, data: dict[str, Any]) -> None:
        self.events.append((kind, data))

    @property
    def state(self) -> State:
        """Where the machine is."""
        return self.service._loop.machine.state

    def start(self) -> Laboratory:
        """Start the service and wait for it."""
        self.service.start()
        assert self.service.wait_ready(20.0), self.service.status().sentence
        return self

    def drop(self, request: DropRequest = REQUEST, **keywords: Any) -> Drop:
        """Make a drop and wait for its end."""
        drop = self.service.request_drop(request, owner="ab", **keywords)
        ended = self.service.wait(drop.number, 20.0)
        self.wait_told()
        return ended

    def wait_told(self) -> None:
        """Wait until all that happened so far has been told."""
        assert self.service._writer.drain(20.0)

    def wait_for(self, condition: Callable[[], bool], limit_s: float = 20.0) -> None:
        """Wait until something is so."""
        ends_s = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < ends_s, f"not within {limit_s} s: {self.events[-5:]}"
            time.sleep(0.001)

    def close(self) -> None:
        """End everything."""
        self.service.stop()
        self.rig.close()
        self.archive.close()


def laboratory_settings(directory: Path, **changes: dict[str, Any]) -> Settings:
    """Return the simulated rig's settings, faster, with some sections changed."""
    settings = load_settings(find_config("simulated.toml"), data=directory)
    wanted: dict[str, dict[str, Any]] = {
        "simulation": {"clock_speed": 4.0},
        "timeouts": {"recover_every_s": 0.2, "idle_check_every_s": 0.1, "impact_margin_s": 1.0},
        "storage": {"reserve_bytes": 0},
    }
    for section, keys in changes.items():
        wanted.setdefault(section, {}).update(keys)
    update: dict[str, Any] = {}
    if "environment" in wanted:  # the simulated rig's file has none
        update["environment"] = EnvironmentSection(**wanted.pop("environment"))
    if "driver" in wanted.get("digitizer", {}):  # another one than the simulated rig's file has
        update["digitizer"] = Usb2637Section(**wanted.pop("digitizer"))
    for name, keys in wanted.items():
        update[name] = getattr(settings, name).model_copy(update=keys)
    return settings.model_copy(update=update)


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Laboratory]:
    """A laboratory that is ready."""
    made = Laboratory(tmp_path / "data")
    try:
        yield made.start()
    finally:
        made.close()


@pytest.fixture
def build(tmp_path: Path) -> Iterator[Callable[..., Laboratory]]:
    """A maker of laboratories, not started; all on one archive, one after another."""
    made: list[Laboratory] = []

    def make(**changes: dict[str, Any]) -> Laboratory:
        made.append(Laboratory(tmp_path / "data", **changes))
        return made[-1]

    yield make
    for one in made:
        one.close()


def request(**changes: Any) -> DropRequest:
    """Return the usual request with some members changed."""
    return dataclasses.replace(REQUEST, **changes)
