"""Tests of the simulated board through plain pyusb, without the driver."""

from __future__ import annotations

import array
import math

import numpy as np
import pytest
import usb.core
import usb.util

from drivers.simulated.signal_sources import CountingSource, PulseSource
from drivers.simulated.usb_converter import PACKET_SAMPLES, SimulatedConverter
from drivers.simulated.usb_device import SimulatedDaq3500
from drivers.simulated.usb_eeprom import PERFECT


def _find(board, product):
    return usb.core.find(backend=board, idVendor=0x0622, idProduct=product)


def _write(device, register, value):
    device.ctrl_transfer(0x40, 0xB4, value, register, b"")


def _start(device, divisor=47):
    for register, value in (
        (0x00, 0x0004), (0x01, 0x0006), (0x01, 0x0000), (0x02, divisor), (0x03, 0), (0x05, 0),
        (0x00, 0x0003),
    ):  # fmt: skip
        _write(device, register, value)
    device.ctrl_transfer(0x40, 0xBB, 1, 2, b"")
    for register, value in ((0x58, 0x0011), (0x00, 0x0011), (0x00, 0x0031)):
        _write(device, register, value)


def _status(device):
    return int.from_bytes(device.ctrl_transfer(0xC0, 0xB4, 0, 0, 2), "little")


@pytest.fixture
def counting():
    """Return a board that counts as fast as it is read, and its device."""
    board = SimulatedDaq3500(CountingSource(math.inf), errors=PERFECT)
    device = _find(board, 0x2C01)
    yield board, device
    usb.util.dispose_resources(device)


def test_a_loaded_board_shows_its_four_endpoints():
    """As the public notes list them."""
    device = _find(SimulatedDaq3500(PulseSource()), 0x2C01)
    addresses = [endpoint.bEndpointAddress for endpoint in device[0][(0, 0)]]
    assert addresses == [0x01, 0x81, 0x82, 0x06]
    assert usb.util.get_string(device, device.iSerialNumber) == "SIM-0001"


def test_an_unloaded_board_knows_one_request():
    """The bare chip takes RAM, and stalls everything else."""
    board = SimulatedDaq3500(PulseSource(), loaded=False)
    assert _find(board, 0x2C01) is None
    device = _find(board, 0x0470)
    for kind, request in ((0xC0, 0xB0), (0x40, 0xB4), (0xC0, 0xB8)):
        with pytest.raises(usb.core.USBError) as caught:
            device.ctrl_transfer(kind, request, 0, 0, 2 if kind == 0xC0 else b"")
        assert (caught.value.backend_error_code, caught.value.errno) == (-9, 32)


def test_ram_is_written_in_reset_only():
    """A running chip does not let its memory be changed."""
    device = _find(SimulatedDaq3500(PulseSource(), loaded=False), 0x0470)
    with pytest.raises(usb.core.USBError, match="Pipe"):
        device.ctrl_transfer(0x40, 0xA0, 0x0000, 0, b"\x02")


def test_loading_makes_it_leave_the_bus_and_come_back():
    """The old handle is dead, the new device has another id and address and no FPGA yet."""
    board = SimulatedDaq3500(PulseSource(), loaded=False, reenumeration_s=0.0)
    old = _find(board, 0x0470)
    for address, data in ((0xE600, b"\x01"), (0x0000, b"\x02\x00\x03"), (0xE600, b"\x00")):
        old.ctrl_transfer(0x40, 0xA0, address, 0, data)
    with pytest.raises(usb.core.USBError) as caught:
        old.ctrl_transfer(0x40, 0xA0, 0xE600, 0, b"\x01")
    assert caught.value.backend_error_code == -4
    new = _find(board, 0x2C01)
    assert new.address != old.address
    assert bytes(new.ctrl_transfer(0xC0, 0xB2, 0, 0, 1)) == b"\x00"
    assert _status(new) == 0xFFFF


def test_an_fpga_block_after_the_last_one_stalls():
    """The last block is the one that is not full."""
    board = SimulatedDaq3500(PulseSource())
    device = _find(board, 0x2C01)
    device.ctrl_transfer(0x40, 0xB2, 0, 0, b"")
    device.ctrl_transfer(0x40, 0xB3, 0, 0, bytes(2048))
    device.ctrl_transfer(0x40, 0xB3, 0, 0, bytes(10))
    with pytest.raises(usb.core.USBError, match="Pipe"):
        device.ctrl_transfer(0x40, 0xB3, 0, 0, bytes(2048))


def test_samples_come_in_order(counting):
    """Sample n has code n."""
    _, device = counting
    _start(device)
    first = np.frombuffer(device.read(0x82, 4096), dtype="<u2")
    second = np.frombuffer(device.read(0x82, 512), dtype="<u2")
    np.testing.assert_array_equal(np.concatenate([first, second]), np.arange(2048 + 256))
    assert _status(device) & 0x000B == 0x000B


@pytest.mark.parametrize("left_out", ["list", "endpoint", "dma", "start"])
def test_a_forgotten_step_of_the_start_gives_silence(counting, left_out):
    """The driver must send the whole sequence."""
    board, device = counting
    steps = {"list": (0x01, 0x0006), "dma": (0x58, 0x0011), "start": (0x00, 0x0011)}
    for name, (register, value) in steps.items():
        if name != left_out:
            _write(device, register, value)
            if name == "list":
                _write(device, 0x01, 0x0000)
    if left_out != "endpoint":
        device.ctrl_transfer(0x40, 0xBB, 1, 2, b"")
    _write(device, 0x00, 0x0031)
    with pytest.raises(usb.core.USBTimeoutError) as caught:
        device.read(0x82, 512, 5)
    assert (caught.value.backend_error_code, caught.value.errno) == (-7, 110)
    assert not board.converter.running


def test_a_read_in_real_time_returns_what_there_is_when_time_is_up():
    """Whole packets, like libusb; a time-out only at zero bytes."""
    source = CountingSource(1.0)
    device = _find(SimulatedDaq3500(source, errors=PERFECT), 0x2C01)
    _start(device, divisor=4799)  # 10 kHz
    buffer = array.array("B", bytes(512 * 100))
    count = device.read(0x82, buffer, 100)
    assert 0 < count < len(buffer)
    assert count % 512 == 0
    usb.util.dispose_resources(device)


def test_packets_survive_a_stop(counting):
    """A host that does not drain finds old samples at the head of its next run."""
    _, device = counting
    _start(device)
    device.read(0x82, 512)
    _write(device, 0x00, 0x0030)
    _write(device, 0x00, 0x0003)
    stale = np.frombuffer(device.read(0x82, 4096, 5), dtype="<u2")
    np.testing.assert_array_equal(stale, np.arange(256, 256 + 1024))
    with pytest.raises(usb.core.USBTimeoutError):
        device.read(0x82, 512, 5)


@pytest.mark.parametrize(
    ("fault", "jump", "status"),
    [
        ("overrun_at_sample", 256, 0x0004),
        ("drop_block_at_sample", 256, 0),
        ("double_block_at_sample", -256, 0),
    ],
)
def test_a_block_is_lost_or_doubled_where_it_was_asked_for(counting, fault, jump, status):
    """Once, and only the overrun says so."""
    board, device = counting
    setattr(board._source.faults, fault, 1000)
    _start(device)
    codes = np.frombuffer(device.read(0x82, 8192), dtype="<u2").astype(int)
    np.testing.assert_array_equal(codes[:1000], np.arange(1000))
    np.testing.assert_array_equal(codes[1000:], np.arange(1000, 4096) + jump)
    assert _status(device) & 0x0004 == status


@pytest.mark.parametrize("fault", ["overrun_at_sample", "drop_block_at_sample"])
def test_a_transfer_with_a_gap_comes_later_by_its_length(fault):
    """Nothing is handed out before it was converted, which is what shows a lost block."""

    class Halted(CountingSource):
        """A converter that has made 4096 samples so far."""

        def samples_due(self):
            return 4096

    source = Halted(1.0)
    setattr(source.faults, fault, 1000)
    converter = SimulatedConverter(source)
    converter.start(1e6, 10.0, board_gain=1.0, board_offset_v=0.0)
    out = np.zeros(4096, np.uint16)
    received = converter.read_into(out, 0.0, lambda: None)
    assert received == 4096 - PACKET_SAMPLES
    assert out[received - 1] == 4095


def test_a_fault_that_waits_sends_nothing_after_a_stop():
    """A drain finds the endpoint's packets, then nothing."""
    source = CountingSource(1.0)
    source.faults.double_block_at_sample = 300
    converter = SimulatedConverter(source)
    assert converter.read_into(np.zeros(512, np.uint16), 0.0, lambda: None) == 0


def test_a_stalled_endpoint_leaves_the_registers_alone(counting):
    """Only bulk transfers stall."""
    board, device = counting
    board._source.faults.stall_endpoint = True
    with pytest.raises(usb.core.USBError) as caught:
        device.read(0x82, 512, 5)
    assert (caught.value.backend_error_code, caught.value.errno) == (-9, 32)
    _status(device)


def test_an_unplugged_board_is_gone_and_comes_back_elsewhere(counting):
    """Old handles stay dead after it was plugged in again."""
    board, device = counting
    _status(device)
    board._source.faults.usb_unplugged = True
    with pytest.raises(usb.core.USBError) as caught:
        _status(device)
    assert (caught.value.backend_error_code, caught.value.errno) == (-4, 19)
    assert _find(board, 0x2C01) is None
    board._source.faults.usb_unplugged = False
    with pytest.raises(usb.core.USBError):
        _status(device)
    again = _find(board, 0x2C01)
    assert again.address != device.address
    _status(again)


def test_the_eeprom_answers_by_offset():
    """Three sections of one image."""
    board = SimulatedDaq3500(PulseSource(), eeprom=bytes(i % 251 for i in range(808)))
    device = _find(board, 0x2C01)
    whole = b"".join(
        bytes(device.ctrl_transfer(0xC0, 0xB8, offset, 0, size))
        for offset, size in ((0, 320), (0x140, 320), (0x280, 168))
    )
    assert whole == bytes(i % 251 for i in range(808))
