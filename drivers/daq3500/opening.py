"""Opens the board: find it, load its firmware, test it."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

from drivers.board_image import Image, read_image
from drivers.daq3500.calibration import range_calibration, read_table
from drivers.daq3500.firmware import fpga_loaded, load_fpga, load_fx2
from drivers.daq3500.link import Daq3500Link
from drivers.daq3500.registers import (
    DIGITAL_MARKS,
    MINIMUM_FIRMWARE_VERSION,
    UTILITY_OPEN,
    Register,
    Request,
)
from drivers.daq3500.sequences import reset
from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import DigitizerIdentity
from drivers.errors import (
    ConfigurationError,
    DeviceNotFoundError,
    DriverError,
    FirmwareError,
    SelfTestError,
)
from drivers.opened_board import OpenedBoard, RangeCalibration
from drivers.usb_finding import choose_board, find_boards, serial_number_of, usable_backend

MODEL = "Omega OMB-DAQ-3500"
NOTE = "untested on a 3500"
REENUMERATION_LIMIT_S = 10.0
_POLL_S = 0.05


def open_board(
    settings: Daq3500Settings, backend: Any, *, clear_halt: bool = False
) -> OpenedBoard[Daq3500Link]:
    """Find the board, load what is missing, test it and read its calibration.

    After any DriverError the board is given back. ``clear_halt`` says that the last run broke, so
    that the endpoint may be stalled.
    """
    backend = usable_backend(backend)
    firmware = _load_firmware_if_missing(settings, backend)
    link = Daq3500Link(_await_loaded(settings, backend, just_loaded=firmware is not None))
    try:
        link.claim()
        if clear_halt:
            link.clear_halt()
        version = _firmware_version(link)
        fpga = _load_fpga_if_missing(link, settings)
        self_test(link)
        reset(link)
        calibration = range_calibration(read_table(link), settings.range_v)
        identity = DigitizerIdentity(
            model=MODEL,
            serial_number=serial_number_of(link.device) or "not stated",
            firmware_version=f"{version >> 8:x}.{version & 0xFF:02x}",
            firmware_sha256=firmware.sha256 if firmware else None,
            fpga_sha256=fpga.sha256 if fpga else None,
            note=_note(calibration),
        )
    except BaseException:
        with suppress(DriverError):  # the first error is the one to tell
            link.dispose()
        raise
    return OpenedBoard(link, identity, calibration)


def self_test(link: Daq3500Link) -> None:
    """Write patterns to the mark register and read them back.

    A SelfTestError has the pattern that came back wrong.
    """
    for mark in DIGITAL_MARKS:
        link.write_register(Register.DIGITAL_MARK, mark)
        answer = link.read_register(Register.DIGITAL_MARK)
        if answer != mark:
            raise SelfTestError(
                f"The self-test wrote {mark:#06x} and read back {answer:#06x}.",
                why="The FPGA image does not belong to this board, or this board speaks "
                "another protocol.",
                remedy="Do not use it for measurements. Check fpga_file and the product ids.",
            )
    link.write_register(Register.UTILITY, UTILITY_OPEN)
    link.read_register(Register.UTILITY)


def _note(calibration: RangeCalibration) -> str:
    if calibration.calibrated:
        return NOTE
    return f"{NOTE}; uncalibrated: the table in the board was rejected, {calibration.reason}"


def _choose(settings: Daq3500Settings, backend: Any) -> Any:
    loaded = find_boards(backend, settings.vendor_id, settings.product_id_loaded)
    return choose_board(loaded, settings.serial_number)


def _load_firmware_if_missing(settings: Daq3500Settings, backend: Any) -> Image | None:
    if _choose(settings, backend) is not None:
        return None
    unloaded = find_boards(backend, settings.vendor_id, settings.product_id_unloaded)
    if not unloaded:
        raise _not_found(settings)
    if len(unloaded) > 1:
        raise ConfigurationError(
            f"{len(unloaded)} digitizers wait for their firmware and look the same.",
            remedy="Connect one at a time until each is loaded.",
        )
    image = read_image(settings.firmware_file, "firmware_file")
    # Ask for both files now: a board with half its firmware helps nobody.
    read_image(settings.fpga_file, "fpga_file")
    link = Daq3500Link(unloaded[0])
    try:
        load_fx2(link, image)
    finally:
        with suppress(DriverError):  # it has left the bus by now
            link.dispose()
    return image


def _await_loaded(settings: Daq3500Settings, backend: Any, *, just_loaded: bool) -> Any:
    deadline_s = time.monotonic() + (REENUMERATION_LIMIT_S if just_loaded else 0.0)
    while True:
        device = _choose(settings, backend)
        if device is not None:
            return device
        if time.monotonic() >= deadline_s:
            break
        time.sleep(_POLL_S)
    if not just_loaded:
        raise _not_found(settings)
    raise FirmwareError(
        f"The board did not come back as {settings.vendor_id:04x}:"
        f"{settings.product_id_loaded:04x} within {REENUMERATION_LIMIT_S:.0f} s of its firmware.",
        why="The firmware belongs to another board, or product_id_loaded is wrong.",
        remedy="Look with lsusb which ids it has now.",
    )


def _not_found(settings: Daq3500Settings) -> DeviceNotFoundError:
    chosen = f" with serial number {settings.serial_number}" if settings.serial_number else ""
    return DeviceNotFoundError(
        f"No digitizer {settings.vendor_id:04x}:{settings.product_id_loaded:04x} (loaded) or "
        f"{settings.vendor_id:04x}:{settings.product_id_unloaded:04x} (unloaded){chosen} "
        "is on the bus.",
        why="It is unplugged, without 12 V, or has other ids.",
        remedy="Connect 12 V first, then USB; compare the ids with lsusb.",
    )


def _firmware_version(link: Daq3500Link) -> int:
    version = int.from_bytes(link.read(Request.FIRMWARE_VERSION, 2), "little")
    if version < MINIMUM_FIRMWARE_VERSION:
        raise FirmwareError(
            f"The board's firmware states version {version:#06x}, at least "
            f"{MINIMUM_FIRMWARE_VERSION:#06x} is needed.",
            remedy="Use a newer firmware_file.",
        )
    return version


def _load_fpga_if_missing(link: Daq3500Link, settings: Daq3500Settings) -> Image | None:
    if fpga_loaded(link):
        return None
    image = read_image(settings.fpga_file, "fpga_file")
    load_fpga(link, image)
    return image
