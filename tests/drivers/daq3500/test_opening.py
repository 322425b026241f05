"""Tests of finding, testing and identifying the board."""

from __future__ import annotations

import pytest
import usb.backend.libusb1

from drivers.daq3500.device import Daq3500
from drivers.errors import (
    ConfigurationError,
    DeviceBusyError,
    DeviceNotFoundError,
    FirmwareError,
    SelfTestError,
)
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb_device import SimulatedDaq3500


class TwoBoards:
    """A bus with two boards."""

    def __init__(self, *boards):
        self._boards = boards

    def enumerate_devices(self):
        """Return both."""
        for board in self._boards:
            for device in board.enumerate_devices():
                device.board = board
                yield device

    def open_device(self, dev):
        """Open one."""
        handle = dev.board.open_device(dev)
        handle.board = dev.board
        return handle

    def __getattr__(self, name):
        def call(first, *args):
            return getattr(first.board, name)(first, *args)

        return call


def _two(first="A", second="B"):
    return TwoBoards(
        SimulatedDaq3500(PulseSource(), serial_number=first),
        SimulatedDaq3500(PulseSource(), serial_number=second),
    )


def test_the_note_says_that_it_is_untested(bench):
    """Wherever a user sees the board, they see this."""
    identity = bench.digitizer.identity
    assert identity.note == "untested on a 3500"
    assert identity.model == "Omega OMB-DAQ-3500"
    assert identity.serial_number == "SIM-0001"
    assert identity.firmware_version == "1.02"


def test_the_note_says_why_a_board_is_uncalibrated(make_bench):
    """A rejected table is visible before the first record."""
    bench = make_bench(eeprom=b"\xff" * 808)
    bench.digitizer.ensure_ready()
    assert "uncalibrated" in bench.digitizer.identity.note
    assert "header reads ff ff ff ff" in bench.digitizer.identity.note


def test_an_empty_bus_names_both_ids(make_bench):
    """The person can compare them with lsusb."""
    bench = make_bench()
    bench.source.faults.usb_unplugged = True
    with pytest.raises(DeviceNotFoundError, match=r"0622:2c01 .* 0622:0470"):
        bench.digitizer.ensure_ready()


def test_two_boards_need_a_serial_number(make_settings):
    """Nobody guesses which one hangs on the rig."""
    with pytest.raises(ConfigurationError, match="2 digitizers"):
        Daq3500(make_settings(), backend=_two()).ensure_ready()


def test_the_serial_number_chooses(make_settings):
    """The one that was asked for answers."""
    digitizer = Daq3500(make_settings(serial_number="B"), backend=_two())
    digitizer.ensure_ready()
    assert digitizer.identity.serial_number == "B"
    digitizer.close()


def test_a_serial_number_nobody_has_is_told(make_settings):
    """The message repeats it."""
    with pytest.raises(DeviceNotFoundError, match="serial number C"):
        Daq3500(make_settings(serial_number="C"), backend=_two()).ensure_ready()


def test_a_board_in_use_is_busy(make_bench, make_settings):
    """Two programs never share one board, and the second may have it afterwards."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    second = Daq3500(make_settings(), backend=bench.board)
    with pytest.raises(DeviceBusyError):
        second.ensure_ready()
    bench.digitizer.close()
    second.ensure_ready()
    second.close()


@pytest.mark.parametrize("mark", [0xFE, 0x08, 0x80])
def test_a_pattern_that_reads_back_wrong_refuses_the_board(make_bench, monkeypatch, mark):
    """A board that speaks another protocol must not measure."""
    bench = make_bench()
    fpga = bench.board._fpga
    genuine = fpga.read_register

    def stuck(register):
        value = genuine(register)
        return value ^ 0x0100 if register == 0x5D and value == mark else value

    monkeypatch.setattr(fpga, "read_register", stuck)
    with pytest.raises(SelfTestError, match=f"wrote 0x00{mark:02x} and read back 0x01{mark:02x}"):
        bench.digitizer.ensure_ready()


def test_an_old_firmware_is_refused(make_bench, monkeypatch):
    """At least 0x0100 is needed."""
    monkeypatch.setattr("drivers.simulated.usb_device._FIRMWARE_VERSION", 0x00FF)
    with pytest.raises(FirmwareError, match="version 0x00ff"):
        make_bench().digitizer.ensure_ready()


def test_a_machine_without_libusb_says_what_to_install(make_settings, monkeypatch):
    """One sentence, not a traceback."""
    monkeypatch.setattr(usb.backend.libusb1, "get_backend", lambda: None)
    with pytest.raises(ConfigurationError, match="libusb"):
        Daq3500(make_settings()).ensure_ready()


def test_another_product_is_not_mistaken_for_the_board(make_settings):
    """A loaded id without the sample endpoint is another board."""
    board = SimulatedDaq3500(PulseSource(), loaded=False)
    settings = make_settings(product_id_loaded=0x0470, product_id_unloaded=0x0001)
    with pytest.raises(DeviceNotFoundError, match="no bulk endpoint 0x82"):
        Daq3500(settings, backend=board).ensure_ready()
