"""Starts, watches and stops a scan without end of one channel."""

from __future__ import annotations

import array
import time

from drivers.digitizer import Record
from drivers.errors import DriverError
from drivers.stream_status import check_status
from drivers.usb2637.link import Usb2637Link
from drivers.usb2637.protocol import Request, Status, scan_list, scan_start
from drivers.usb2637.settings import Usb2637Settings


def check_words(words: tuple[int, ...], record: Record | None = None) -> None:
    """Refuse samples whose last status word tells of an overrun."""
    check_status(words, record, overruns=Status.SCAN_OVERRUN, faults=Status(0))


def stop_scan(link: Usb2637Link) -> None:
    """Stop the scan, if any, and empty the board's FIFO and the endpoint."""
    link.write(Request.SCAN_STOP)
    link.write(Request.CLEAR_FIFO)
    link.drain()


class Usb2637Converter:
    """The converter as a `drivers.usb_stream.StreamingBoard`."""

    def __init__(self, link: Usb2637Link, settings: Usb2637Settings) -> None:
        self._link = link
        self._settings = settings
        self.pacer_on_s: tuple[float, float] | None = None

    def start_acquiring(self) -> int:
        """Start the scan and return the status word read just before it."""
        link = self._link
        stop_scan(link)
        link.write(Request.SCAN_LIST, scan_list([self._settings.channel]))  # index: last entry
        link.clear_halt()  # as the maker's library does before every scan
        status = link.status()
        before_s = time.monotonic()
        link.write(Request.SCAN_START, scan_start(self._settings.pacer_divisor))
        self.pacer_on_s = (before_s, time.monotonic())
        return status

    def acquisition_status(self) -> int:
        """Return the status word, see `drivers.usb2637.protocol.Status`."""
        return self._link.status()

    def stop_acquiring(self) -> None:
        """Stop the scan and read its remaining data; DriverError after two failures."""
        try:
            stop_scan(self._link)
        except DriverError:
            # One bad transfer must not leave the converter running.
            stop_scan(self._link)


class ScanSource:
    """The scan's samples as a `drivers.usb_stream.BulkSource`.

    A board that overran falls silent: whether it did is asked when no sample comes, so that an
    overrun is not taken for a board that hangs.
    """

    def __init__(self, link: Usb2637Link) -> None:
        self._link = link
        self._samples = link.samples()

    def queue(self) -> None:
        """Prepare for data."""
        self._samples.queue()

    def read_into(self, buffer: array.array[int]) -> int:
        """Fill `buffer` and return the number of bytes, 0 after a time-out.

        An OverrunError says why none came.
        """
        received = self._samples.read_into(buffer)
        if received == 0:
            check_words((0, self._link.status()))
        return received

    def cancel(self) -> None:
        """Give up what is queued."""
        self._samples.cancel()
