"""Checks of the status words that decide whether a record is accepted."""

from __future__ import annotations

from drivers.daq3500.registers import ERRORS, OVERRUNS, AcqStatus
from drivers.digitizer import Record
from drivers.errors import OverrunError, RecordError


def check_status(words: tuple[int, ...], record: Record | None = None) -> None:
    """Refuse samples whose last status word tells of a fault.

    ``words`` are the status at start and end of the run. An OverrunError says that samples were
    lost, a RecordError that the converter reports another fault or that its status was never read;
    either carries the record as evidence.
    """
    if len(words) < 2:
        raise RecordError("The run ended without its closing status word.", record=record)
    status = AcqStatus(words[-1])
    if status & OVERRUNS:
        raise OverrunError(
            f"Samples were lost: the acquisition status is {status:#06x} ({_names(status)}).",
            why="The host read too late, or the bus was busy.",
            remedy="Repeat the drop. If it happens again, move other devices off this USB bus.",
            record=record,
        )
    if status & ERRORS:
        raise RecordError(
            f"The converter reports a fault: status {status:#06x} ({_names(status)}).",
            why="The board did not convert as told.",
            remedy="Switch the digitizer's 12 V supply off and on.",
            record=record,
        )


def _names(status: AcqStatus) -> str:
    faults = status & ERRORS
    return ", ".join(str(bit.name).lower().replace("_", " ") for bit in AcqStatus if bit & faults)
