"""Tests of the way from plugging in to a tested board."""

from __future__ import annotations

import hashlib

import pytest

from drivers.errors import (
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    FirmwareError,
    SelfTestError,
)
from drivers.usb2637.device import Usb2637
from drivers.usb2637.settings import Usb2637Settings

from .conftest import RATE


def test_a_loaded_board_says_who_it_is(make_bench):
    """Model, serial number, versions, and that nobody tried it."""
    bench = make_bench(serial_number="0A1B2C3D")
    bench.digitizer.ensure_ready()
    identity = bench.digitizer.identity
    assert (identity.model, identity.serial_number) == ("MCC USB-2637", "0A1B2C3D")
    assert identity.firmware_version == "1.00, FPGA 1.03"
    assert identity.fpga_sha256 is None
    assert identity.note == "untested on a USB-2637"


def test_an_unloaded_board_gets_its_image(make_bench, tmp_path):
    """Whole, in blocks that the board takes, and its hash is kept."""
    image = bytes(index % 251 for index in range(1000))
    (tmp_path / "USB_26xx.rbf").write_bytes(image)
    bench = make_bench(settings={"fpga_file": tmp_path / "USB_26xx.rbf"}, loaded=False)
    bench.digitizer.ensure_ready()
    assert bench.board.image == image
    assert bench.digitizer.identity.fpga_sha256 == hashlib.sha256(image).hexdigest()
    bench.digitizer.sample_baseline(1000)


def test_an_unloaded_board_without_a_file_says_what_to_set(make_bench):
    """The image is the maker's."""
    with pytest.raises(FirmwareError, match="fpga_file is not set"):
        make_bench(loaded=False).digitizer.ensure_ready()


def test_an_image_that_the_board_does_not_accept_is_told(make_bench, tmp_path):
    """A file of another board leaves it unconfigured."""
    (tmp_path / "short.rbf").write_bytes(bytes(500))
    bench = make_bench(settings={"fpga_file": tmp_path / "short.rbf"}, loaded=False)
    with pytest.raises(FirmwareError, match=r"did not accept.*USB_26xx\.rbf"):
        bench.digitizer.ensure_ready()


def test_a_list_that_reads_back_wrong_refuses_the_board(make_bench, monkeypatch):
    """It may speak another protocol."""
    bench = make_bench()
    answer = bench.board._answer

    def stuck(request, *rest):
        return bytes(64) if request == 0x14 else answer(request, *rest)

    monkeypatch.setattr(bench.board, "_answer", stuck)
    with pytest.raises(SelfTestError, match="read back 00 00 00 00"):
        bench.digitizer.ensure_ready()


def test_a_board_that_is_not_there_says_what_to_do(make_bench):
    """The message has the ids, and the serial number if one was asked for."""
    bench = make_bench(settings={"serial_number": "other"})
    with pytest.raises(DeviceNotFoundError, match="09db:0119 with serial number other"):
        bench.digitizer.ensure_ready()


def test_a_board_in_use_is_refused(make_bench):
    """Two programs would read each other's samples."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    second = Usb2637(Usb2637Settings(**RATE), backend=bench.board)
    with pytest.raises(DeviceBusyError):
        second.ensure_ready()


def test_a_scan_that_another_program_left_on_is_ended(make_bench):
    """The board would refuse the scan list meanwhile."""
    bench = make_bench()
    bench.board._obey(0x12, 0, 0, bytes.fromhex("00000000 00000000 3f000000 ff 00"))
    assert bench.board.converter.running
    bench.digitizer.ensure_ready()
    assert not bench.board.converter.running


def test_a_board_that_was_unplugged_opens_again(make_bench):
    """As on every digitizer."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    bench.source.faults.usb_unplugged = True
    with pytest.raises(DeviceLostError):
        bench.digitizer.sample_baseline(1000)
    bench.source.faults.usb_unplugged = False
    bench.digitizer.ensure_ready()
    bench.digitizer.sample_baseline(1000)
