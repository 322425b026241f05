"""A USB-2637 in front of a test source, closed after each test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb2637_device import SimulatedUsb2637
from drivers.usb2637.device import Usb2637
from drivers.usb2637.settings import Usb2637Settings

RATE = {"sample_rate_hz": 1.0e6, "sample_rate_u_hz": 10.0}


@dataclass
class Bench:
    """What a test of the digitizer holds in its hands."""

    source: Any
    board: SimulatedUsb2637
    digitizer: Usb2637


@pytest.fixture
def make_bench() -> Iterator[Callable[..., Bench]]:
    """Return a maker of digitizers in front of a source."""
    made: list[Bench] = []

    def make(
        source: Any = None, settings: dict[str, Any] | None = None, **board_options: Any
    ) -> Bench:
        source = source or PulseSource()
        board = SimulatedUsb2637(source, **board_options)
        digitizer = Usb2637(Usb2637Settings(**(RATE | (settings or {}))), backend=board)
        made.append(Bench(source, board, digitizer))
        return made[-1]

    yield make
    for bench in made:
        bench.digitizer.close()
