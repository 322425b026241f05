"""The journal: what was told survives whatever becomes of the index beside it."""

from __future__ import annotations

import os
import shutil
import sqlite3
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from impactd.storage import journal, schema
from impactd.storage.archive import Archive, ArchiveError, DropRequest, Problem, StorageFullError
from impactd.storage.index import Index
from impactd.storage.journal import Journal, entries

REQUEST = DropRequest("acetal", "aluminium", 0.03, "ab")
INDEX = "index.sqlite"
JOURNAL = "journal.jsonl"


def _open(folder: Path) -> Archive:
    return Archive.open(folder, reserve_bytes=0)


def _problems(archive: Archive) -> list[str]:
    return [f"{found.subject}: {found.problem}" for found in archive.verify() if found.problem]


def _remove_index(folder: Path) -> None:
    for path in folder.glob(f"{INDEX}*"):
        path.unlink()


@pytest.fixture
def full(archive: Archive, stored: Callable[..., int]) -> Path:
    """Return the folder of a closed archive with something that only the journal keeps."""
    stored()
    aborted, _ = archive.begin_drop(REQUEST, owner="anna", idempotency_key="aborted")
    archive.set_drop_state(aborted.number, "aborted", Problem("x", "x", 500, "x", "x"))
    archive.begin_drop(REQUEST, owner="anna", idempotency_key="interrupted")
    archive.interrupt_unfinished()
    archive.set_rebound_height(1, 0.02, 0.001)
    archive.fits.add(1, "kv", None, {"modulus_Pa": 1e9 / 3})
    archive.tokens.create("anna")
    archive.alarms.raise_alarm("rig.fault", "The cable is out.", "Plug it in.")
    archive.close()
    return archive.directory


def _all_there(archive: Archive) -> None:
    assert archive.drop(1).rebound_height_m == 0.02
    assert archive.fits.for_shot(1)[0].result == {"modulus_Pa": 1e9 / 3}
    assert archive.tokens.list()[0].name == "anna"
    assert archive.alarms.open()[0].sentence == "The cable is out."
    for number, key in ((2, "aborted"), (3, "interrupted")):
        again, created = archive.begin_drop(REQUEST, owner="anna", idempotency_key=key)
        assert (again.number, again.state, created) == (number, key, False)
    assert _problems(archive) == []


def test_a_deleted_index_comes_back_from_the_journal(full: Path) -> None:
    """Nothing is lost: the same keys drop nothing, and a start before the rebuild is refused."""
    _remove_index(full)
    (full / "last-number").unlink()
    with pytest.raises(ArchiveError, match="impactd reindex"):
        _open(full)

    report = Archive.reindex(full)

    assert (report.damaged, report.lost) == ((), ())
    with _open(full) as archive:
        _all_there(archive)


def test_what_the_index_lost_with_the_power_is_replayed(full: Path) -> None:
    """An index behind its journal is brought up to it when it is opened."""
    shutil.copy(full / INDEX, full / "earlier")
    with _open(full) as archive:
        number = archive.begin_drop(REQUEST, owner="bob", idempotency_key="later")[0].number
        archive.set_rebound_height(1, 0.015, 0.001)
    shutil.move(full / "earlier", full / INDEX)

    with _open(full) as archive:
        assert archive.begin_drop(REQUEST, owner="bob", idempotency_key="later")[0].number == number
        assert archive.drop(1).rebound_height_m == 0.015
        assert _problems(archive) == []


def test_a_line_torn_at_any_byte_is_cut(full: Path, tmp_path: Path) -> None:
    """Its transaction was never acknowledged; the next one is written in its place."""
    before = (full / JOURNAL).stat().st_size
    shutil.copy(full / INDEX, full / "earlier")
    with _open(full) as archive:
        archive.events.append("x", {})
    shutil.move(full / "earlier", full / INDEX)
    whole = (full / JOURNAL).read_bytes()
    here = tmp_path / "torn"
    for size in range(before, len(whole)):
        shutil.rmtree(here, ignore_errors=True)
        shutil.copytree(full, here)
        (here / JOURNAL).write_bytes(whole[:size])
        with closing(Index(here / INDEX)) as index:
            assert index.number("SELECT count(*) FROM events") == 0, size
            index.write("INSERT INTO events (utc, kind, data) VALUES ('', 'y', '{}')")
        kinds = [row["kind"] for row in _rows(here, "SELECT kind FROM events")]
        assert kinds == ["y"]
        assert all(entry.body for entry in entries(here / JOURNAL))


def _rows(folder: Path, sql: str) -> list[sqlite3.Row]:
    with closing(sqlite3.connect(folder / INDEX)) as connection:
        connection.row_factory = sqlite3.Row
        return connection.execute(sql).fetchall()


def test_every_flipped_byte_of_the_journal_is_named(full: Path) -> None:
    """By verify, or already at the start where the first line is hit."""
    content = (full / JOURNAL).read_bytes()
    for at in range(0, len(content), 37):
        flipped = bytearray(content)
        flipped[at] ^= 1 << at % 8
        (full / JOURNAL).write_bytes(flipped)
        try:
            with _open(full) as archive:
                told = "; ".join(_problems(archive))
        except ArchiveError as error:
            told = str(error)
        assert JOURNAL in told, at
        (full / JOURNAL).write_bytes(content)


def test_a_damaged_line_is_made_good_by_the_old_index(full: Path) -> None:
    """While the index has its rows nothing is lost; without it the transaction is named."""
    content = (full / JOURNAL).read_bytes()
    lines = content.splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if b'"tokens"' in line)
    lines[at] = lines[at].replace(b'"anna"', b'"Anna"')
    (full / JOURNAL).write_bytes(b"".join(lines))

    for copy in (full, shutil.copytree(full, full.parent / "without")):
        if copy != full:
            _remove_index(copy)
        report = Archive.reindex(copy)
        assert report.damaged == (f"Line {at + 1} of the journal is not what was written.",)
        with _open(copy) as archive:
            if copy == full:
                assert report.lost == ()
                _all_there(archive)
            else:
                assert report.lost == (f"Transactions {at} to {at} of the journal.",)
                assert archive.tokens.list() == []
                assert archive.drop(1).rebound_height_m == 0.02


@pytest.mark.parametrize("gone", ["journal", "index of another", "older journal"])
def test_index_and_journal_that_do_not_belong_together_are_refused(full: Path, gone: str) -> None:
    """The sentence says what to do, and after that nothing is missing."""
    shorter = (full / JOURNAL).read_bytes().splitlines(keepends=True)[:-1]
    if gone == "journal":
        (full / JOURNAL).unlink()
    elif gone == "index of another":
        other = full.parent / "other"
        _open(other).close()
        shutil.copy(other / INDEX, full / INDEX)
    else:
        (full / JOURNAL).write_bytes(b"".join(shorter))

    with pytest.raises(ArchiveError, match=r"do not belong together.*impactd reindex"):
        _open(full)
    report = Archive.reindex(full)
    assert report.lost == ()
    with _open(full) as archive:
        _all_there(archive)


def test_an_archive_without_journal_gets_one(full: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its index held is in the journal after the first start."""
    _make_old(full, monkeypatch)
    assert not (full / JOURNAL).exists()

    with _open(full) as archive:
        _all_there(archive)
    _remove_index(full)
    assert Archive.reindex(full).lost == ()
    with _open(full) as archive:
        _all_there(archive)


def _make_old(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bring an archive back to the version before the journal."""
    with monkeypatch.context() as older:
        before = schema.MIGRATIONS.index(schema.journal_rows.migration())
        older.setattr(schema, "MIGRATIONS", schema.MIGRATIONS[:before])
        older.setattr(Index, "_check_form", lambda _: None)
        with closing(Index(folder / "old", scratch=True)) as index, index.raw() as connection:
            connection.execute("PRAGMA foreign_keys=OFF")
            connection.execute("ATTACH ? AS present", (str(folder / INDEX),))
            for table in schema.journal_rows.TABLES:
                if table == "comparisons":  # came after the journal
                    continue
                connection.execute(f"DELETE FROM main.{table}")
                names = ", ".join(schema.checksums.first_columns(table))
                connection.execute(f"INSERT INTO main.{table} SELECT {names} FROM present.{table}")
    (folder / "old").rename(folder / INDEX)
    (folder / JOURNAL).unlink()


@pytest.mark.parametrize("step", ["before the commit", "before the name"])
def test_an_archive_that_gets_its_journal_may_be_killed(
    full: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    """The next start finishes what was begun."""
    _make_old(full, monkeypatch)
    script = (
        "import os, sys, pathlib; from impactd.storage import index, journaling\n"
        "from impactd.storage.archive import Archive\n"
        "stop = lambda *_: os._exit(9)\n"
        "if sys.argv[2] == 'before the commit': index.Index._commit = stop\n"
        "else: journaling.Journaling.finish_first = stop\n"
        "Archive.open(pathlib.Path(sys.argv[1]), reserve_bytes=0)\n"
    )
    died = subprocess.run([sys.executable, "-c", script, full, step], check=False)
    assert died.returncode == 9

    with _open(full) as archive:
        _all_there(archive)
    assert sorted(path.name for path in full.glob(f"{JOURNAL}*")) == [JOURNAL]


def test_a_commit_that_fails_leaves_no_line(archive: Archive) -> None:
    """A transaction whose client was told of an error is not found after a restart."""
    archive.events.append("told", {})
    before = (archive.directory / JOURNAL).read_bytes()

    def add_a_fit_of_no_shot() -> None:
        """Checked at the commit, behind the line of the journal."""
        with archive.transaction(), archive._index.raw() as connection:
            connection.execute("PRAGMA defer_foreign_keys=ON")
            archive.fits.add(99, "kv", None, {})

    with pytest.raises(ArchiveError, match="refused a row"):
        add_a_fit_of_no_shot()
    assert (archive.directory / JOURNAL).read_bytes() == before
    archive.events.append("later", {})
    archive.close()
    with _open(archive.directory) as again:
        assert [event.kind for event in again.events.since(0)] == ["told", "later"]
        assert _problems(again) == []


def test_a_statement_that_fails_is_not_journaled(archive: Archive) -> None:
    """Its transaction may go on without it."""
    with archive.transaction():
        with pytest.raises(ArchiveError):
            archive.fits.add(99, "kv", None, {})
        archive.events.append("x", {})
    assert _problems(archive) == []


def test_a_full_disk_in_the_journal_leaves_index_and_journal_as_they_were(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error says so, the half line is cut, and later transactions go on."""
    written = journal.os.pwrite

    def half(file: int, content: bytes, at: int) -> int:
        """Write half of it, then find no room."""
        if len(content) < 100:
            raise OSError(28, "No space left on device")
        return written(file, content[: len(content) - 50], at)

    with monkeypatch.context() as full:
        full.setattr(journal.os, "pwrite", half)
        with pytest.raises(StorageFullError):
            archive.events.append("x", {"text": "x" * 200})
    archive.events.append("y", {})
    assert [event.kind for event in archive.events.since(0)] == ["y"]
    assert _problems(archive) == []


def test_a_journal_that_is_taken_away_is_noticed(archive: Archive) -> None:
    """Writing on into a deleted file would promise what nobody finds again."""
    path = archive.directory / JOURNAL
    path.rename(path.with_name("away"))
    with pytest.raises(ArchiveError, match="impactd reindex"):
        archive.events.append("x", {})
    path.with_name("away").rename(path)
    archive.events.append("y", {})
    assert [event.kind for event in archive.events.since(0)] == ["y"]


def test_two_processes_make_one_archive(tmp_path: Path) -> None:
    """Opened for the first time by both at once, it has one journal that both write to."""
    script = (
        "import sys, pathlib; from impactd.storage.archive import Archive\n"
        "for i in range(20):\n"
        "    print(flush=True); sys.stdin.readline()\n"
        "    with Archive.open(pathlib.Path(sys.argv[1]) / str(i), reserve_bytes=0) as archive:\n"
        "        archive.events.append('x', {})\n"
    )
    command = [sys.executable, "-c", script, tmp_path]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as one, subprocess.Popen(command, **pipes) as two:
        for _ in range(20):
            for process in (one, two):
                assert process.stdout.readline()
            for process in (one, two):
                process.stdin.write("\n")
                process.stdin.flush()
        assert (one.wait(120), two.wait(120)) == (0, 0)
    for i in range(20):
        with _open(tmp_path / str(i)) as archive:
            assert len(archive.events.since(0)) == 2
            assert _problems(archive) == []


def test_two_processes_write_one_journal(archive: Archive) -> None:
    """Each line is a transaction of the one or the other, none is overwritten."""
    script = (
        "import sys, pathlib; from impactd.storage.archive import Archive\n"
        "with Archive.open(pathlib.Path(sys.argv[1]), reserve_bytes=0) as archive:\n"
        "    for i in range(40): archive.events.append('other', {'i': i})\n"
    )
    with subprocess.Popen([sys.executable, "-c", script, archive.directory]) as other:
        for i in range(40):
            archive.events.append("own", {"i": i})
        assert other.wait(timeout=120) == 0
    assert _problems(archive) == []
    archive.close()
    _remove_index(archive.directory)
    assert Archive.reindex(archive.directory).lost == ()
    with _open(archive.directory) as again:
        kinds = [event.kind for event in again.events.since(0)]
        assert (kinds.count("own"), kinds.count("other")) == (40, 40)


def test_a_process_killed_between_line_and_commit(archive: Archive) -> None:
    """A writer beside it overwrites the line; nobody was told of it."""
    script = (
        "import os, sys, pathlib; from impactd.storage.archive import Archive\n"
        "from impactd.storage.journaling import Journaling\n"
        "archive = Archive.open(pathlib.Path(sys.argv[1]), reserve_bytes=0)\n"
        "write = Journaling.write\n"
        "Journaling.write = lambda self: (write(self), os._exit(9))\n"
        "archive.events.append('never told', {})\n"
    )
    before = (archive.directory / JOURNAL).stat().st_size
    died = subprocess.run([sys.executable, "-c", script, archive.directory], check=False)
    assert died.returncode == 9
    assert (archive.directory / JOURNAL).stat().st_size > before

    archive.events.append("told", {})
    assert [event.kind for event in archive.events.since(0)] == ["told"]
    assert _problems(archive) == []


def test_deleted_rows_are_one_line_and_one_range(archive: Archive) -> None:
    """Old events are taken out by the thousand."""
    with archive.transaction():
        for i in range(50):
            archive.events.append("x", {"i": i})
    archive._index.write("DELETE FROM events WHERE id <= 40")
    *_, last = entries(archive.directory / JOURNAL)
    assert last.body is not None
    assert last.body["rows"] == [["events", [1], [40]]]
    archive.close()
    _remove_index(archive.directory)
    Archive.reindex(archive.directory)
    with _open(archive.directory) as again:
        assert len(again.events.since(0)) == 10


def test_nobody_else_reads_index_and_journal(tmp_path: Path) -> None:
    """They hold names and hashes of tokens; an archive that was open to all is closed."""
    old = os.umask(0)
    try:
        with _open(tmp_path / "a"):
            pass
        for path in (tmp_path / "a").glob("index.sqlite*"):
            path.chmod(0o644)
        with _open(tmp_path / "a") as archive:
            archive.events.append("x", {})
            files = [path for path in (tmp_path / "a").iterdir() if path.is_file()]
            assert {path.name for path in files} >= {INDEX, f"{INDEX}-wal", JOURNAL}
            for path in files:
                assert not stat.S_IMODE(path.stat().st_mode) & ~0o640, path
    finally:
        os.umask(old)


def test_a_stalled_index_is_given_up_in_time(archive: Archive) -> None:
    """Who cannot wait says how long; another process or another thread holds the lock."""
    with closing(sqlite3.connect(archive.directory / INDEX, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(ArchiveError, match="locked"), archive._index.transaction(0.05):
            pass
        other.execute("ROLLBACK")
    holding, done = threading.Event(), threading.Event()

    def hold() -> None:
        """Keep the lock until the test is done."""
        with archive.transaction():
            holding.set()
            done.wait(60)

    thread = threading.Thread(target=hold)
    thread.start()
    holding.wait(60)
    try:
        with (
            pytest.raises(ArchiveError, match="another thread"),
            archive._index.transaction(0.05),
        ):
            pass
    finally:
        done.set()
        thread.join()
    with archive.transaction():
        archive.events.append("x", {})


def test_a_long_query_keeps_nobody_from_being_let_in(archive: Archive) -> None:
    """Tokens are looked up on a connection of their own."""
    _, secret = archive.tokens.create("anna")
    found = []
    with archive._index._reading:  # as a long query holds it
        looking = threading.Thread(target=lambda: found.append(archive.tokens.check(secret)))
        looking.start()
        looking.join(timeout=60)
        assert found
    assert found[0].name == "anna"


def test_a_journal_of_a_newer_program_is_refused(full: Path) -> None:
    """What it cannot understand it does not throw away."""
    _remove_index(full)
    *_, last = entries(full / JOURNAL)
    assert last.body is not None
    body = {"n": last.body["n"] + 1, "utc": "", "rows": [["wishes", {"id": 1}]]}
    with (full / JOURNAL).open("ab") as file:
        file.write(journal.line_of(body))
    before = sorted(path.name for path in full.iterdir())
    with pytest.raises(ArchiveError, match="newer"):
        Archive.reindex(full)
    assert sorted(path.name for path in full.iterdir()) == before


def test_an_append_cuts_what_was_never_acknowledged(tmp_path: Path) -> None:
    """Bytes behind the last committed line are overwritten, whatever they are."""
    path = tmp_path / JOURNAL
    at = journal.write_whole(path, [[["sequence", {"name": "drop", "last": 1}]]])
    with path.open("ab") as file:
        file.write(b"half a line of a writer that was killed" * 10)
    file_ = Journal(path)
    end = file_.append(at, [["sequence", {"name": "drop", "last": 2}]])
    file_.close()
    assert [entry.body and entry.body["n"] for entry in entries(path)] == [0, 1, 2]
    assert path.stat().st_size == end.size_bytes
