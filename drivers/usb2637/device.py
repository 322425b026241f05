"""The USB-2637 as a digitizer. Untested on a board."""

from __future__ import annotations

from typing import Any

from drivers.digitizer import Record
from drivers.opened_board import OpenedBoard
from drivers.streaming_digitizer import StreamingDigitizer
from drivers.usb2637.link import Usb2637Link
from drivers.usb2637.opening import open_board
from drivers.usb2637.scanning import ScanSource, Usb2637Converter, check_words
from drivers.usb2637.settings import Usb2637Settings
from drivers.usb_stream import BulkSource, StreamingBoard


class Usb2637(StreamingDigitizer[Usb2637Settings, Usb2637Link]):
    """A `drivers.digitizer.Digitizer` on the USB-2637."""

    def _open(self, backend: Any, *, clear_halt: bool) -> OpenedBoard[Usb2637Link]:
        return open_board(self._settings, backend)  # every start clears a stall

    def _parts(self, link: Usb2637Link) -> tuple[BulkSource, StreamingBoard]:
        return ScanSource(link), Usb2637Converter(link, self._settings)

    def _check_status(self, words: tuple[int, ...], record: Record | None) -> None:
        check_words(words, record)
