"""Stores shots as the daemon does, one thread, and says ``told N`` for each that is acknowledged.

Run as a script: archive, number of shots. Trouble is said too, never raised: ``kept N`` for a shot
that stays in memory for another try, ``alarm`` when nothing more can be done.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from drivers.digitizer import Record
from impactd.storage.archive import Archive, ArchiveError, DropRequest, ShotMetadata

TRIES = 3


def main() -> None:
    """Store the shots."""
    folder, shots = Path(sys.argv[1]), int(sys.argv[2])
    try:
        with Archive.open(folder, reserve_bytes=0) as archive:
            for _ in range(shots):
                _store(archive)
    except ArchiveError as error:
        _say(f"alarm {error}")


def _store(archive: Archive) -> None:
    number = archive.begin_drop(DropRequest("acetal", "aluminium", 0.03, "ab"), owner="ab")[
        0
    ].number
    archive.set_drop_state(number, "armed")
    codes = np.random.default_rng(number).normal(0, 50, 4000).astype(np.int16)
    record = Record(codes, 3e-4, 0.0, True, 1e6, 1.0, 10.0, 1000, 0, 0)
    metadata = ShotMetadata("2026-03-01T12:00:00.000000Z", 0, 9.81, operator="ab")
    for _ in range(TRIES):
        try:
            archive.store_shot(number, record, metadata)
        except ArchiveError as error:
            _say(f"kept {number} {error}")
        else:
            _say(f"told {number}")
            return
    _say(f"alarm shot {number} stays in memory")


def _say(text: str) -> None:
    os.write(1, text.encode() + b"\n")


if __name__ == "__main__":
    main()
