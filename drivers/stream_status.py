"""The check of a run's status words, which decides whether its samples are accepted."""

from __future__ import annotations

from enum import IntFlag

from drivers.digitizer import Record
from drivers.errors import OverrunError, RecordError


def check_status(
    words: tuple[int, ...], record: Record | None = None, *, overruns: IntFlag, faults: IntFlag
) -> None:
    """Refuse samples whose last status word tells of a fault.

    ``words`` are the status at start and end of the run; ``overruns`` and ``faults`` are the bits
    that tell of lost samples and of anything else that spoils them. An OverrunError says that
    samples were lost, a RecordError that the converter reports another fault or that its status was
    never read; either carries the record as evidence.
    """
    if len(words) < 2:
        raise RecordError("The run ended without its closing status word.", record=record)
    status = words[-1]
    if status & overruns:
        raise OverrunError(
            f"Samples were lost: the acquisition status is {status:#06x} "
            f"({_names(status & overruns, overruns)}).",
            why="The host read too late, or the bus was busy.",
            remedy="Repeat the drop. If it happens again, move other devices off this USB bus.",
            record=record,
        )
    if status & faults:
        raise RecordError(
            f"The converter reports a fault: status {status:#06x} "
            f"({_names(status & faults, faults)}).",
            why="The board did not convert as told.",
            remedy="Switch the digitizer's power off and on.",
            record=record,
        )


def _names(status: int, bits: IntFlag) -> str:
    found = [bit for bit in type(bits) if bit & status]
    return ", ".join(str(bit.name).lower().replace("_", " ") for bit in found)
