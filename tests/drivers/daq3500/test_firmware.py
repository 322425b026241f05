"""Tests of the image formats and of loading them."""

from __future__ import annotations

import hashlib

import pytest

from drivers.board_image import Image
from drivers.daq3500.firmware import RamRecord, parse_ram_records
from drivers.errors import FirmwareError


def _hex_line(address, data, kind=0):
    row = bytes((len(data), address >> 8, address & 0xFF, kind)) + data
    return ":" + (row + bytes(((-sum(row)) & 0xFF,))).hex().upper()


HEX = "\r\n".join(
    (_hex_line(0x0000, b"\x02\x01\x23"), _hex_line(0x0123, bytes(range(16))), _hex_line(0, b"", 1))
).encode()
IIC = (
    bytes.fromhex("c222067004010000")
    + bytes.fromhex("0003 0000 020123".replace(" ", ""))
    + bytes.fromhex("0010 0123".replace(" ", ""))
    + bytes(range(16))
    + bytes.fromhex("8001e60000")
)
RECORDS = [RamRecord(0x0000, b"\x02\x01\x23"), RamRecord(0x0123, bytes(range(16)))]


@pytest.mark.parametrize("content", [HEX, IIC], ids=["intel-hex", "cypress-iic"])
def test_both_record_formats_say_the_same(content):
    """One firmware, two files, the same bytes at the same addresses."""
    assert parse_ram_records(Image("f", content)) == RECORDS


def test_anything_else_is_an_image_of_the_ram():
    """A raw image begins at address 0."""
    assert parse_ram_records(Image("f", b"\x02\x01")) == [RamRecord(0, b"\x02\x01")]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (HEX.replace(b":03", b":04", 1), "line 1: not a valid"),
        (HEX.replace(b"020123", b"020124", 1), "line 1: not a valid"),
        (HEX.rsplit(b":", 1)[0], "without an end record"),
        (_hex_line(0, b"\x00\x01", kind=4).encode(), "record type 04"),
        (b":zz", "line 1: not a valid"),
        (IIC[:-8], "without its last record"),
        (IIC[:20], "without its last record"),
        (_hex_line(0x3FFF, b"\x00\x00").encode() + b"\n" + _hex_line(0, b"", 1).encode(), "0x3fff"),
        (bytes(0x4001), "outside the chip's RAM"),
    ],
)
def test_a_damaged_image_never_reaches_the_board(content, message):
    """Checksums, ends and addresses are checked before the first byte is sent."""
    with pytest.raises(FirmwareError, match=message):
        parse_ram_records(Image("f", content))


@pytest.fixture
def files(tmp_path):
    """Return user-supplied images."""
    firmware, fpga = tmp_path / "firmware.hex", tmp_path / "fpga.bit"
    firmware.write_bytes(HEX)
    fpga.write_bytes(bytes(range(251)) * 20)
    return {"firmware_file": firmware, "fpga_file": fpga}


def test_an_unloaded_board_is_loaded_and_its_hashes_recorded(make_bench, files):
    """After its firmware the board comes back under another id and takes the FPGA image."""
    bench = make_bench(settings=files, loaded=False)
    bench.digitizer.ensure_ready()
    identity = bench.digitizer.identity
    assert identity.firmware_sha256 == hashlib.sha256(HEX).hexdigest()
    assert identity.fpga_sha256 == bench.board.fpga_sha256
    assert identity.fpga_sha256 == hashlib.sha256(bytes(range(251)) * 20).hexdigest()
    expected = {record.address + i: b for record in RECORDS for i, b in enumerate(record.data)}
    assert bench.board.ram == expected


def test_a_loaded_board_is_left_alone(bench):
    """No image is needed, and none is claimed to have been loaded."""
    assert bench.digitizer.identity.firmware_sha256 is None
    assert bench.digitizer.identity.fpga_sha256 is None
    assert bench.board.ram == {}


@pytest.mark.parametrize("missing", ["firmware_file", "fpga_file"])
def test_a_missing_image_is_asked_for_before_anything_is_loaded(make_bench, files, missing):
    """Half a firmware helps nobody."""
    bench = make_bench(settings=files | {missing: None}, loaded=False)
    with pytest.raises(FirmwareError, match=f"{missing} is not set"):
        bench.digitizer.ensure_ready()
    assert bench.board.ram == {}


def test_an_unreadable_image_names_the_file(make_bench, files, tmp_path):
    """The setting and the path are in the message."""
    bench = make_bench(settings=files | {"fpga_file": tmp_path / "nowhere"}, loaded=False)
    with pytest.raises(FirmwareError, match=r"nowhere cannot be read .* fpga_file"):
        bench.digitizer.ensure_ready()


def test_a_board_that_does_not_come_back_is_told(make_bench, files, monkeypatch):
    """A wrong firmware leaves the bus for good."""
    monkeypatch.setattr("drivers.daq3500.opening.REENUMERATION_LIMIT_S", 0.2)
    bench = make_bench(settings=files, loaded=False, reenumeration_s=1e6)
    with pytest.raises(FirmwareError, match="did not come back as 0622:2c01"):
        bench.digitizer.ensure_ready()
