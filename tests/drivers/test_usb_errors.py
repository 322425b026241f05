"""Tests that no foreign error gets through."""

from __future__ import annotations

import contextlib
import threading

import pytest
import usb.backend.libusb1
import usb.core

from drivers.digitizer import TriggerSettings
from drivers.errors import (
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    ProtocolError,
)
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb2637_device import SimulatedUsb2637
from drivers.usb2637.device import Usb2637
from drivers.usb2637.settings import Usb2637Settings
from drivers.usb_errors import translate, translated

CODES = {
    name: value
    for name, value in vars(usb.backend.libusb1).items()
    if name.startswith("LIBUSB_ERROR_")
}
EXPECTED = {
    "LIBUSB_ERROR_IO": DeviceLostError,
    "LIBUSB_ERROR_INVALID_PARAM": ConfigurationError,
    "LIBUSB_ERROR_ACCESS": ConfigurationError,
    "LIBUSB_ERROR_NO_DEVICE": DeviceLostError,
    "LIBUSB_ERROR_NOT_FOUND": DeviceNotFoundError,
    "LIBUSB_ERROR_BUSY": DeviceBusyError,
    "LIBUSB_ERROR_TIMEOUT": DeviceTimeoutError,
    "LIBUSB_ERROR_OVERFLOW": ProtocolError,
    "LIBUSB_ERROR_PIPE": ProtocolError,
    "LIBUSB_ERROR_INTERRUPTED": DeviceTimeoutError,
    "LIBUSB_ERROR_NO_MEM": ConfigurationError,
    "LIBUSB_ERROR_NOT_SUPPORTED": ConfigurationError,
    "LIBUSB_ERROR_OTHER": ProtocolError,
}


@pytest.mark.parametrize("name", sorted(CODES))
def test_every_code_of_libusb_has_its_own_meaning(name):
    """The list is libusb's own, so a new code in it fails here."""
    error = translate(usb.core.USBError("words", CODES[name], None), "testing")
    assert type(error) is EXPECTED[name]
    assert "while testing" in error.what
    assert error.why
    assert error.remedy


@pytest.mark.parametrize("code", [None, -1234])
def test_a_code_nobody_knows_is_still_ours(code):
    """An unknown code becomes a protocol error that names it."""
    error = translate(usb.core.USBError("words", code, None), "testing")
    assert type(error) is ProtocolError
    assert str(code) in error.what


def test_a_missing_libusb_says_what_to_install():
    """The person at the rig reads a command, not a traceback."""
    with pytest.raises(ConfigurationError, match="apt install"), translated("testing"):
        raise usb.core.NoBackendError("No backend available")


class _Failing:
    """A backend whose n-th call fails."""

    def __init__(self, inner, at, error):
        self._inner = inner
        self._at = at
        self._error = error
        self.calls = 0

    def __getattr__(self, name):
        method = getattr(self._inner, name)
        if not callable(method) or name.startswith("_"):
            return method

        def call(*args):
            self.calls += 1
            if self.calls == self._at:
                raise self._error
            return method(*args)

        return call


def _story(digitizer, source):
    digitizer.ensure_ready()
    digitizer.sample_baseline(2000)
    digitizer.arm(
        TriggerSettings(
            level_v=0.5, hysteresis_v=0.2, pre_trigger_samples=1000, record_samples=4000
        )
    )
    source.fire()
    digitizer.wait_record(5.0, threading.Event())
    digitizer.close()


@pytest.mark.parametrize(("code", "errno"), [(-4, 19), (-9, 32), (None, None)])
def test_whatever_call_fails_the_error_is_ours_and_the_board_is_stopped(make_bench, code, errno):
    """Each backend call of a whole record fails once; nothing foreign comes out."""
    counted = []
    bench = make_bench(
        wrap=lambda board: counted.append(_Failing(board, 0, None)) or counted[0],
    )
    _story(bench.digitizer, bench.source)
    total = counted[0].calls
    assert total > 100
    # Every call while the board is opened; of the repetitive rest, every fifth.
    for at in [*range(1, 120), *range(120, total, 5)]:
        error = usb.core.USBError("injected", code, errno)
        bench = make_bench(wrap=lambda board, at=at, error=error: _Failing(board, at, error))
        with contextlib.suppress(DriverError):
            _story(bench.digitizer, bench.source)
        bench.digitizer.close()
        assert not bench.board.converter.running


def test_whatever_call_fails_on_a_usb_2637_the_board_is_stopped():
    """As above, for every second call."""

    def run(at):
        source = PulseSource()
        board = SimulatedUsb2637(source)
        backend = _Failing(board, at, usb.core.USBError("injected", -9, 32))
        settings = Usb2637Settings(sample_rate_hz=1.0e6, sample_rate_u_hz=10.0)
        digitizer = Usb2637(settings, backend=backend)
        try:
            _story(digitizer, source)
        finally:
            digitizer.close()
            assert not board.converter.running
        return backend.calls

    for at in range(1, run(0), 2):
        with contextlib.suppress(DriverError):
            run(at)
