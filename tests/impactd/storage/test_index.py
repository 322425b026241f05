"""The SQLite file: who waits for whom."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from impactd.storage.archive import ArchiveError
from impactd.storage.index import Index

ADD = "INSERT INTO active_models (name, since_utc) VALUES (?, 'now')"
NAMES = "SELECT name FROM active_models ORDER BY id"


def _names(index: Index) -> list[str]:
    return [row["name"] for row in index.rows(NAMES)]


def _write_and_fail(index: Index) -> None:
    index.write(ADD, ("kv",))
    index.write("INSERT INTO nowhere VALUES (1)")


def test_nobody_who_reads_waits_for_one_who_writes(tmp_path: Path) -> None:
    """A status must not wait for the disk; it sees what was durable when it asked."""
    index = Index(tmp_path / "index.sqlite")
    index.write(ADD, ("hsd",))
    seen: list[list[str]] = []
    with index.transaction():
        index.write(ADD, ("kv",))
        reader = threading.Thread(target=lambda: seen.append(_names(index)), daemon=True)
        reader.start()
        reader.join(timeout=10.0)
        assert seen == [["hsd"]]
        assert _names(index) == ["hsd", "kv"], "a transaction reads what it wrote"
    assert _names(index) == ["hsd", "kv"]
    index.close()


def test_a_transaction_that_failed_leaves_nothing_to_read(tmp_path: Path) -> None:
    """Neither for others nor for the thread that began it."""
    index = Index(tmp_path / "index.sqlite")
    with pytest.raises(ArchiveError, match="does not answer"), index.transaction():
        _write_and_fail(index)
    assert _names(index) == []
    with pytest.raises(ArchiveError, match="readonly"):
        index.rows("DELETE FROM row_digests RETURNING row")
    index.close()
