"""A digitizer in front of a test source, closed after each test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from drivers.daq3500.device import Daq3500
from drivers.daq3500.settings import Daq3500Settings
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb_device import SimulatedDaq3500


@dataclass
class Bench:
    """What a test of the digitizer holds in its hands."""

    source: Any
    board: SimulatedDaq3500
    digitizer: Daq3500


@pytest.fixture
def make_settings() -> Callable[..., Daq3500Settings]:
    """Return a maker of settings for the simulated board."""

    def make(**changes: Any) -> Daq3500Settings:
        values: dict[str, Any] = {
            "vendor_id": 0x0622,
            "product_id_unloaded": 0x0470,
            "product_id_loaded": 0x2C01,
            "sample_rate_hz": 990_786.0,
            "sample_rate_u_hz": 20.0,
        }
        return Daq3500Settings(**(values | changes))

    return make


@pytest.fixture
def make_bench(make_settings: Callable[..., Daq3500Settings]) -> Iterator[Callable[..., Bench]]:
    """Return a maker of digitizers in front of a source."""
    made: list[Bench] = []

    def make(
        source: Any = None,
        settings: dict[str, Any] | None = None,
        wrap: Callable[[Any], Any] = lambda board: board,
        **board_options: Any,
    ) -> Bench:
        source = source or PulseSource()
        board = SimulatedDaq3500(source, **board_options)
        digitizer = Daq3500(make_settings(**(settings or {})), backend=wrap(board))
        made.append(Bench(source, board, digitizer))
        return made[-1]

    yield make
    for bench in made:
        bench.digitizer.close()


@pytest.fixture
def bench(make_bench: Callable[..., Bench]) -> Bench:
    """Return a ready digitizer in front of a pulse source."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    return bench
