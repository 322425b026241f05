"""The Personal Daq/3000 protocol as a digitizer. Untested on a 3500."""

from __future__ import annotations

from typing import Any

from drivers.daq3500.link import Daq3500Link
from drivers.daq3500.opening import open_board
from drivers.daq3500.registers import ERRORS, OVERRUNS
from drivers.daq3500.sequences import Daq3500Converter
from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import Record
from drivers.opened_board import OpenedBoard
from drivers.stream_status import check_status
from drivers.streaming_digitizer import StreamingDigitizer
from drivers.usb_stream import BulkSource, StreamingBoard


class Daq3500(StreamingDigitizer[Daq3500Settings, Daq3500Link]):
    """A `drivers.digitizer.Digitizer` on the Personal Daq/3000 protocol."""

    def _open(self, backend: Any, *, clear_halt: bool) -> OpenedBoard[Daq3500Link]:
        return open_board(self._settings, backend, clear_halt=clear_halt)

    def _parts(self, link: Daq3500Link) -> tuple[BulkSource, StreamingBoard]:
        return link.samples(), Daq3500Converter(link, self._settings)

    def _check_status(self, words: tuple[int, ...], record: Record | None) -> None:
        check_status(words, record, overruns=OVERRUNS, faults=ERRORS)
