"""Checks that an archive holds what was written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from impactd.storage.calibrations import CalibrationTable
from impactd.storage.diagnoses import DiagnosisStore
from impactd.storage.errors import ArchiveError
from impactd.storage.index import Index
from impactd.storage.journal_check import journal_problems
from impactd.storage.models import ModelTable
from impactd.storage.numbers import NumberSequence
from impactd.storage.shot_store import ShotStore
from impactd.storage.shots import ShotTable


@dataclass(frozen=True)
class VerifyFinding:
    """The finding about one part of the archive."""

    subject: str
    """``shot 17``, a file, ``index`` or ``journal``."""
    problem: str | None
    """``None`` when it is sound."""


def verify_archive(
    index: Index, store: ShotStore, diagnoses: DiagnosisStore
) -> Iterator[VerifyFinding]:
    """Check the index, its journal, every shot file and every diagnosis; nothing is changed.

    Yields
    ------
    VerifyFinding
        One for the index, one for its journal, one for each shot, one for each file that belongs
        to no shot, one for each diagnosis.
    """
    wrong = "; ".join(index.problems())
    yield VerifyFinding("index", f"{index.path}: {wrong}" if wrong else None)
    wrong = "; ".join(journal_problems(index.path, index.journal_path))
    yield VerifyFinding("journal", f"{index.journal_path}: {wrong}" if wrong else None)
    try:
        numbers = [int(row[0]) for row in index.rows("SELECT number FROM shots ORDER BY number")]
        yield from _shots(index, store, numbers)
        yield from _drops_without_shot(index)
    except ArchiveError as error:
        numbers = []
        yield VerifyFinding("index", str(error))
    known = {store.path(number) for number in numbers}
    for path in store.paths():
        if path not in known:
            yield VerifyFinding(str(path), store.why_unknown(path))
    for path in store.drafts():
        yield VerifyFinding(str(path), "left by a writer that was killed; it can be deleted.")
    for findings in (
        NumberSequence(index, store.directory).findings(),
        CalibrationTable(index, store.directory / "calibrations").findings(),
        ModelTable(index, store.directory).findings(),
        diagnoses.findings(),
    ):
        try:
            for subject, problem in findings:
                yield VerifyFinding(subject, problem)
        except ArchiveError as error:
            yield VerifyFinding("index", str(error))


def _shots(index: Index, store: ShotStore, numbers: list[int]) -> Iterator[VerifyFinding]:
    table = ShotTable(index)
    for number in numbers:
        try:
            store.read(table.get(number))
        except ArchiveError as error:
            yield VerifyFinding(f"shot {number}", str(error))
        else:
            yield VerifyFinding(f"shot {number}", None)


def _drops_without_shot(index: Index) -> Iterator[VerifyFinding]:
    for row in index.rows(
        "SELECT number FROM drops WHERE state IN ('stored', 'analysed') "
        "AND number NOT IN (SELECT number FROM shots)"
    ):
        yield VerifyFinding(f"drop {row[0]}", "is stored, and its shot is not in the index.")
