"""Opens the board: find it, load its FPGA, test it, read its calibration."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from drivers.board_image import Image, read_image
from drivers.digitizer import DigitizerIdentity
from drivers.errors import DeviceNotFoundError, DriverError, FirmwareError, SelfTestError
from drivers.opened_board import OpenedBoard
from drivers.usb2637.calibration import range_calibration, read_row
from drivers.usb2637.link import Usb2637Link
from drivers.usb2637.protocol import (
    CHANNELS,
    FPGA_BLOCK_BYTES,
    FPGA_UNLOCK,
    PRODUCT_ID,
    VENDOR_ID,
    Request,
    Status,
    scan_list,
)
from drivers.usb2637.scanning import stop_scan
from drivers.usb2637.settings import Usb2637Settings
from drivers.usb_finding import choose_board, find_boards, serial_number_of, usable_backend

MODEL = "MCC USB-2637"
NOTE = "untested on a USB-2637"


def open_board(settings: Usb2637Settings, backend: Any) -> OpenedBoard[Usb2637Link]:
    """Find the board, load what is missing, test it and read its calibration.

    After any DriverError the board is given back.
    """
    backend = usable_backend(backend)
    device = choose_board(find_boards(backend, VENDOR_ID, PRODUCT_ID), settings.serial_number)
    if device is None:
        chosen = f" with serial number {settings.serial_number}" if settings.serial_number else ""
        raise DeviceNotFoundError(
            f"No digitizer {VENDOR_ID:04x}:{PRODUCT_ID:04x}{chosen} is on the bus.",
            why="It is unplugged, without power, or another model.",
            remedy="Connect its power supply first, then USB; compare the ids with lsusb.",
        )
    link = Usb2637Link(device)
    try:
        link.claim()
        fpga = _load_fpga_if_missing(link, settings)
        stop_scan(link)  # a scan that another program left on would refuse the list
        self_test(link)
        calibration = range_calibration(read_row(link))
        rejected = f"; uncalibrated: its table was rejected, {calibration.reason}"
        identity = DigitizerIdentity(
            model=MODEL,
            serial_number=serial_number_of(device) or "not stated",
            firmware_version=f"{_version(device.bcdDevice)}, FPGA {_version(_fpga_version(link))}",
            firmware_sha256=None,
            fpga_sha256=fpga.sha256 if fpga else None,
            note=NOTE if calibration.calibrated else NOTE + rejected,
        )
    except BaseException:
        with suppress(DriverError):  # the first error is the one to tell
            link.dispose()
        raise
    return OpenedBoard(link, identity, calibration)


def self_test(link: Usb2637Link) -> None:
    """Write a scan list of all channels, backwards, and read it back.

    A SelfTestError says that another one came back.
    """
    written = scan_list(list(reversed(range(CHANNELS))))
    link.write(Request.SCAN_LIST, written, index=CHANNELS - 1)
    answer = link.read(Request.SCAN_LIST, CHANNELS)
    if answer != written:
        raise SelfTestError(
            f"The self-test wrote {written[:4].hex(' ')} ... and read back "
            f"{answer[:4].hex(' ')} ....",
            why="The FPGA image does not belong to this board, or this board speaks another "
            "protocol.",
            remedy="Do not use it for measurements. Check fpga_file and driver.",
        )


def _load_fpga_if_missing(link: Usb2637Link, settings: Usb2637Settings) -> Image | None:
    if link.status() & Status.FPGA_CONFIGURED:
        return None
    image = read_image(settings.fpga_file, "fpga_file")
    link.write(Request.FPGA_CONFIG, FPGA_UNLOCK)
    if not link.status() & Status.FPGA_CONFIG_MODE:
        raise FirmwareError(
            "The board does not take an FPGA image.",
            why="Its status does not say that it awaits one.",
            remedy="Switch the digitizer's power off and on.",
        )
    for start in range(0, len(image.content), FPGA_BLOCK_BYTES):
        link.write(Request.FPGA_DATA, image.content[start : start + FPGA_BLOCK_BYTES])
    if not link.status() & Status.FPGA_CONFIGURED:
        raise FirmwareError(
            f"The board did not accept the FPGA image {image.name}.",
            why="The file belongs to another board, or is damaged.",
            remedy="Set fpga_file to USB_26xx.rbf of the maker's uldaq, then switch the "
            "digitizer's power off and on.",
        )
    return image


def _fpga_version(link: Usb2637Link) -> int:
    return int.from_bytes(link.read(Request.FPGA_VERSION, 2), "little")


def _version(raw: int) -> str:
    return f"{raw >> 8:x}.{raw & 0xFF:02x}"
