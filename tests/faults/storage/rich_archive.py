"""An archive with something of everything that a lost index could forget."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from drivers.digitizer import Record
from impactd.storage.archive import Archive, ArchiveError, DropRequest, Problem, ShotMetadata
from impactd.storage.journal_rows import TABLES

REQUEST = DropRequest("acetal", "aluminium", 0.047, "ab")
SHOTS = 5


def make(folder: Path) -> None:
    """Fill a folder: stored, aborted and interrupted drops, rebounds, fits, jobs and tokens."""
    with Archive.open(folder, reserve_bytes=0) as archive:
        archive.tokens.create("anna")
        archive.calibrations.begin("slot", [{"sphere": "acetal"}], "timer")
        for number in range(1, SHOTS + 1):
            archive.begin_drop(REQUEST, owner="ab", idempotency_key=f"stored-{number}")
            codes = np.random.default_rng(number).normal(0, 50, 4000).astype(np.int16)
            record = Record(codes, 3e-4, 0.0, True, 1e6, 1.0, 10.0, 1000, 0, 0)
            metadata = ShotMetadata("2026-03-01T12:00:00.000000Z", 0, 9.81, operator="ab")
            archive.store_shot(number, record, metadata)
            archive.set_rebound_height(number, 0.02 + number / 1000, 0.001)
            archive.fits.add(number, "kv", None, {"modulus_Pa": 1e9 / number})
            archive.events.append("drop.stored", {"number": number})
            archive.jobs.enqueue("fit_shot", {"shot": number}, f"shot {number}", key=f"j{number}")
        for _ in range(3):
            drop, _ = archive.begin_drop(REQUEST, owner="ab", idempotency_key=f"aborted-{_}")
            archive.set_drop_state(drop.number, "aborted", Problem("x", "x", 500, "x", "x"))
        archive.begin_drop(REQUEST, owner="ab", idempotency_key="interrupted")
        archive.interrupt_unfinished()
        archive.calibrations.finish(1, {"gain": 2.0}, "2027-01-01T00:00:00.000000Z")
        archive.alarms.raise_alarm("rig.fault", "The cable is out.", "Plug it in.")
        archive.models.set_active("kv")


def rows(folder: Path) -> dict[str, list[tuple[Any, ...]]]:
    """Return all rows of the index of a closed archive."""
    with closing(sqlite3.connect(folder / "index.sqlite")) as connection:
        found = {}
        for table in TABLES:
            found[table] = sorted(connection.execute(f"SELECT * FROM {table}"), key=repr)
        return found


def check(folder: Path, truth: dict[str, list[tuple[Any, ...]]]) -> bool:
    """Whole, or refused with what to do; whole after a rebuild. Return whether it was whole."""
    refused = ""
    try:
        _check_whole(folder, truth)
    except ArchiveError as error:
        refused = str(error)
    assert not refused or "impactd reindex" in refused
    report = Archive.reindex(folder)
    assert (report.damaged, report.lost) == ((), ())
    _check_whole(folder, truth)
    return not refused


def _check_whole(folder: Path, truth: dict[str, list[tuple[Any, ...]]]) -> None:
    with Archive.open(folder, reserve_bytes=0) as archive:
        problems = [one.problem for one in archive.verify() if one.problem]
        assert [one for one in problems if "left by a writer" not in one] == []
        for drop in archive.drops():
            again, created = archive.begin_drop(
                drop.request, owner="ab", idempotency_key=drop.idempotency_key
            )
            assert (again.number, created) == (drop.number, False)
    assert rows(folder) == truth
    assert not list(folder.glob("*.building"))
