"""One suite for every digitizer, simulated or real.

Real ones: ``pytest --hardware --hardware-config rig.toml tests/conformance``, where the TOML's
``[digitizer]`` table holds ``driver`` and that driver's settings, and optionally
``impact_timeout_s``: the time the person has to tap the load cell when asked.
Another board joins with one line in `DRIVERS` and some in `CASES`.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.daq3500.device import Daq3500
from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import Digitizer, TriggerSettings
from drivers.errors import AbortedError, DriverError, TriggerTimeoutError
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb2637_device import SimulatedUsb2637
from drivers.simulated.usb_device import SimulatedDaq3500
from drivers.simulated.world import World, WorldSettings
from drivers.usb2637.device import Usb2637
from drivers.usb2637.settings import Usb2637Settings

TRIGGER = TriggerSettings(
    level_v=0.2, hysteresis_v=0.1, pre_trigger_samples=5000, record_samples=50_000
)


@dataclasses.dataclass
class Case:
    """A digitizer and a way to hit what it listens to."""

    digitizer: Digitizer
    hit: Callable[[], None]
    hit_timeout_s: float = 20.0


def _with_paths(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: Path(value) if name.endswith("_file") else value for name, value in values.items()
    }


DRIVERS: dict[str, Callable[[dict[str, Any]], Digitizer]] = {
    "daq3500": lambda values: Daq3500(Daq3500Settings(**_with_paths(values))),
    "usb2637": lambda values: Usb2637(Usb2637Settings(**_with_paths(values))),
}


def _daq3500(source: Any) -> Digitizer:
    settings = Daq3500Settings(
        vendor_id=0x0622,
        product_id_unloaded=0x0470,
        product_id_loaded=0x2C01,
        sample_rate_hz=1.0e6,
        sample_rate_u_hz=10.0,  # with 100 only half a second can be proved whole
    )
    return Daq3500(settings, backend=SimulatedDaq3500(source))


def _usb2637(divisor: int) -> Callable[[Any], Digitizer]:
    rate_hz = 64.0e6 / (divisor + 1)
    settings = Usb2637Settings(
        sample_rate_hz=rate_hz, sample_rate_u_hz=1e-5 * rate_hz, pacer_divisor=divisor
    )
    return lambda source: Usb2637(settings, backend=SimulatedUsb2637(source))


def _pulses(make: Callable[[Any], Digitizer]) -> Callable[[dict[str, Any]], Case]:
    def made(_: dict[str, Any]) -> Case:
        source = PulseSource()
        return Case(make(source), lambda: source.fire() and None)

    return made


def _world(
    make: Callable[[Any], Digitizer], clock_speed: float = 1.0
) -> Callable[[dict[str, Any]], Case]:
    def made(_: dict[str, Any]) -> Case:
        world = World(WorldSettings(clock_speed=clock_speed))
        sphere, surface = next(iter(world.settings.spheres)), next(iter(world.settings.surfaces))

        def hit() -> None:
            world.set_vacuum(True)
            world.load(sphere, surface, 0.047)
            world.set_vacuum(False)

        return Case(make(world), hit)

    return made


def _real(config: dict[str, Any]) -> Case:
    values = dict(config["digitizer"])
    timeout_s = float(values.pop("impact_timeout_s", 30.0))
    digitizer = DRIVERS[values.pop("driver")](values)
    return Case(digitizer, lambda: print("\n>>> Tap the load cell now. <<<"), timeout_s)


CASES = [
    pytest.param(_pulses(_daq3500), id="daq3500-pulses"),
    pytest.param(_world(_daq3500), id="daq3500-world"),
    pytest.param(_world(_daq3500, 20.0), id="daq3500-world-accelerated"),
    pytest.param(_pulses(_usb2637(63)), id="usb2637-pulses"),
    pytest.param(_world(_usb2637(63)), id="usb2637-world"),
    pytest.param(_world(_usb2637(127)), id="usb2637-world-500-kHz"),
    pytest.param(_real, id="real", marks=pytest.mark.hardware),
]


@pytest.fixture(params=CASES)
def case(request):
    """Return a ready digitizer of each kind, closed afterwards."""
    real = request.param is _real
    config = request.getfixturevalue("hardware_config") if real else {}
    made = request.param(config)
    made.digitizer.ensure_ready()
    yield made
    made.digitizer.close()


def test_it_is_a_digitizer_that_says_who_it_is(case):
    """Every word of the identity is there before the first record."""
    assert isinstance(case.digitizer, Digitizer)
    identity = case.digitizer.identity
    assert all((identity.model, identity.serial_number, identity.firmware_version))


def test_ready_may_be_asked_again(case):
    """Asking twice changes nothing."""
    before = case.digitizer.identity
    case.digitizer.ensure_ready()
    assert case.digitizer.identity == before


def test_the_baseline_is_finite_and_as_long_as_asked(case):
    """In volts, and alive: a constant input is a broken one."""
    volts = case.digitizer.sample_baseline(10_000)
    assert volts.dtype == np.float64
    assert volts.shape == (10_000,)
    assert np.all(np.isfinite(volts))
    assert volts.std() > 0


def test_a_hit_is_recorded_whole(case):
    """The level is reached at the trigger, and not before it."""
    case.digitizer.arm(TRIGGER)
    case.hit()
    case.digitizer.wait_trigger(case.hit_timeout_s, threading.Event())
    record = case.digitizer.wait_record(case.hit_timeout_s, threading.Event())
    assert record.codes.dtype == np.int16
    assert record.codes.shape == (TRIGGER.record_samples,)
    assert record.trigger_index == TRIGGER.pre_trigger_samples
    assert record.sample_rate_hz > 0
    assert record.sample_rate_u_hz >= 0
    assert record.status_words
    volts = record.codes * record.volts_per_code + record.offset_v
    assert np.all(np.abs(volts) <= 1.11 * record.range_v)
    above = volts - np.median(volts[: TRIGGER.pre_trigger_samples])
    resolution_v = 1.5 * record.volts_per_code
    assert above[record.trigger_index] >= TRIGGER.level_v - resolution_v
    assert above[record.trigger_index - 1] < TRIGGER.level_v + resolution_v


def test_without_a_hit_the_wait_ends(case):
    """A time-out, and the digitizer is ready for the next try."""
    case.digitizer.arm(TRIGGER)
    with pytest.raises(TriggerTimeoutError):
        case.digitizer.wait_record(0.1, threading.Event())
    case.digitizer.sample_baseline(1000)


def test_an_abort_ends_the_wait(case):
    """From another thread, and the digitizer is ready for the next try."""
    abort = threading.Event()
    case.digitizer.arm(TRIGGER)
    threading.Timer(0.05, abort.set).start()
    with pytest.raises(AbortedError):
        case.digitizer.wait_trigger(60.0, abort)
    case.digitizer.sample_baseline(1000)


def test_a_stop_from_another_thread_ends_the_wait(case):
    """Nobody waits for a record that cannot come."""
    case.digitizer.arm(TRIGGER)
    threading.Timer(0.05, case.digitizer.ensure_stopped).start()
    with pytest.raises(AbortedError):
        case.digitizer.wait_record(60.0, threading.Event())


def test_stop_and_close_are_safe_at_any_time(case):
    """Idle, armed, twice, closed."""
    case.digitizer.ensure_stopped()
    case.digitizer.arm(TRIGGER)
    case.digitizer.ensure_stopped()
    case.digitizer.ensure_stopped()
    case.digitizer.close()
    case.digitizer.ensure_stopped()
    case.digitizer.close()
    with pytest.raises(DriverError):
        case.digitizer.arm(TRIGGER)


def test_a_closed_digitizer_opens_again(case):
    """Closing gives the board back whole."""
    case.digitizer.close()
    case.digitizer.ensure_ready()
    case.digitizer.sample_baseline(1000)
