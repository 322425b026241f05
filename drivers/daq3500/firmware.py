"""Loading the user's images into an unloaded board.

The images are proprietary and never part of this project. Formats of the FX2 image, told apart
by their first byte:

- Intel HEX (``:``): record types 00 and 01, checksums verified;
- Cypress IIC (``0xC2``): eight header bytes, then records of big-endian length and address, the
  last one with the length's top bit set;
- anything else: a raw image of the RAM from address 0.

The FPGA image is sent as it is. Whether a 3500 takes either is NOT KNOWN: untested on a 3500.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.board_image import Image
from drivers.daq3500.link import Daq3500Link
from drivers.daq3500.registers import Request
from drivers.errors import FirmwareError

_CPUCS = 0xE600
_RAM_BYTES = 0x4000
_SCRATCH = range(0xE000, 0xE200)
_FX2_CHUNK_BYTES = 512
_FPGA_BLOCK_BYTES = 2048
_IIC_MARK = 0xC2
_IIC_HEADER_BYTES = 8
_IIC_LAST = 0x8000


@dataclass(frozen=True)
class RamRecord:
    """Bytes for one place in the FX2's RAM."""

    address: int
    data: bytes


def parse_ram_records(image: Image) -> list[RamRecord]:
    """Return the bytes of an FX2 image and their addresses, in the order of the file.

    A FirmwareError says that the file is damaged or addresses memory the chip's loader cannot
    write.
    """
    first = image.content[0]
    if first == ord(":"):
        records = _parse_intel_hex(image)
    elif first == _IIC_MARK:
        records = _parse_iic(image)
    else:
        records = [RamRecord(0, image.content)]
    for record in records:
        end = record.address + len(record.data)
        in_scratch = record.address in _SCRATCH and end <= _SCRATCH.stop
        if end > _RAM_BYTES and not in_scratch:
            raise FirmwareError(
                f"{image.name} wants bytes at {record.address:#06x} to {end:#06x}, outside the "
                f"chip's RAM (below {_RAM_BYTES:#06x}).",
                why="The file is no FX2 RAM image.",
            )
    return records


def _parse_intel_hex(image: Image) -> list[RamRecord]:
    records: list[RamRecord] = []
    lines = image.content.decode("ascii", errors="replace").split()
    for number, line in enumerate(lines, start=1):
        try:
            row = bytes.fromhex(line[1:]) if line.startswith(":") else b""
        except ValueError:
            row = b""
        if len(row) < 5 or len(row) != row[0] + 5 or sum(row) & 0xFF:
            raise FirmwareError(f"{image.name}, line {number}: not a valid Intel HEX record.")
        kind = row[3]
        if kind == 1:
            return records
        if kind != 0:
            raise FirmwareError(
                f"{image.name}, line {number}: record type {kind:02x} has no place in 64 KiB."
            )
        records.append(RamRecord(int.from_bytes(row[1:3], "big"), row[4:-1]))
    raise FirmwareError(f"{image.name} ends without an end record.", why="It was cut short.")


def _parse_iic(image: Image) -> list[RamRecord]:
    records: list[RamRecord] = []
    content, at = image.content, _IIC_HEADER_BYTES
    while at + 4 <= len(content):
        length = int.from_bytes(content[at : at + 2], "big")
        address = int.from_bytes(content[at + 2 : at + 4], "big")
        if length & _IIC_LAST:
            return records  # it releases the CPU, which `load_fx2` does by itself
        data = content[at + 4 : at + 4 + length]
        if len(data) != length:
            break
        records.append(RamRecord(address, data))
        at += 4 + length
    raise FirmwareError(f"{image.name} ends without its last record.", why="It was cut short.")


def load_fx2(link: Daq3500Link, image: Image) -> None:
    """Load the USB chip's RAM and start it; it then leaves the bus and comes back.

    A FirmwareError says that the file is damaged.
    """
    records = parse_ram_records(image)
    link.write(Request.FX2_RAM, b"\x01", value=_CPUCS)
    for record in records:
        for at in range(0, len(record.data), _FX2_CHUNK_BYTES):
            chunk = record.data[at : at + _FX2_CHUNK_BYTES]
            link.write(Request.FX2_RAM, chunk, value=record.address + at)
    link.write(Request.FX2_RAM, b"\x00", value=_CPUCS)


def fpga_loaded(link: Daq3500Link) -> bool:
    """Return whether the board says that its FPGA is configured."""
    return link.read(Request.FPGA, 1) == b"\x01"


def load_fpga(link: Daq3500Link, image: Image) -> None:
    """Load the FPGA with its bit stream; FirmwareError if the board does not accept it."""
    link.write(Request.FPGA)
    for at in range(0, len(image.content), _FPGA_BLOCK_BYTES):
        link.write(Request.FPGA_BLOCK, image.content[at : at + _FPGA_BLOCK_BYTES])
    if not fpga_loaded(link):
        raise FirmwareError(
            f"The board did not accept the FPGA image {image.name} "
            f"({len(image.content)} bytes, SHA-256 {image.sha256[:12]}...).",
            why="The image belongs to another board, or the 12 V supply came after USB.",
            remedy="Check fpga_file; connect 12 V first, then USB.",
        )
