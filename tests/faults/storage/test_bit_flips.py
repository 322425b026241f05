"""One flipped bit, anywhere in the archive."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.digitizer import Record
from impactd.storage import checksums, schema
from impactd.storage.archive import Archive, ArchiveError, DropRequest, Problem, ShotMetadata
from impactd.storage.checksums import COLUMNS
from impactd.storage.index import Index
from impactd.storage.jobs import DIAGNOSE

from .daemon_here import daemon_here
from .daemon_process import ENDED, until

REQUEST = DropRequest("acetal", "aluminium", 0.047, "ab")


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """Return the folder of a closed archive with something in every table and folder."""
    folder = tmp_path / "sound"
    with Archive.open(folder, reserve_bytes=0) as archive:
        rng = np.random.default_rng(5)
        archive.calibrations.begin("slot", [{"sphere": "acetal"}], "timer")
        for number in range(1, 6):
            archive.begin_drop(REQUEST, owner="ab", idempotency_key=f"k{number}")
            codes = rng.normal(0, 50, 4000).astype(np.int16)
            record = Record(codes, 3e-4, 0.0, True, 1e6, 1.0, 10.0, 1000, 0, 0)
            metadata = ShotMetadata("2026-03-01T12:00:00.000000Z", 0, 9.81, operator="ab")
            archive.store_shot(number, record, metadata)
            archive.fits.add(number, "kv", None, {"modulus_Pa": 1e9 / 3})
            archive.events.append("drop.stored", {"number": number})
        failed, _ = archive.begin_drop(REQUEST, owner="ab")
        archive.set_drop_state(failed.number, "failed", Problem("x", "x", 500, "x", "x"))
        archive.calibrations.finish(1, {"gain": 2.0}, "2027-01-01T00:00:00.000000Z")
        job = archive.jobs.enqueue(DIAGNOSE, {"shots": [1]}, "1 shot")
        named = archive.models.add({"name": "kv+echo", "base": "kv", "effects": []}, {})
        archive.diagnoses.publish(archive.jobs.finish(job.id, {"report_html": "<p>"}), named)
        archive.models.set_active("kv+echo", 1)
        archive.tokens.create("anna")
    return folder


@pytest.mark.parametrize(
    "flips",
    [
        60,
        pytest.param(400, marks=pytest.mark.slow),
        pytest.param(1000, marks=[pytest.mark.slow, pytest.mark.soak]),
    ],
)
@pytest.mark.timeout(900)
def test_no_flipped_bit_goes_unseen(sound: Path, tmp_path: Path, flips: int) -> None:
    """Each is named by verify with its file, or lies where nothing is kept; nothing crashes."""
    with Archive.open(sound, reserve_bytes=0) as archive:
        assert [found for found in archive.verify() if found.problem] == []
        truth = _all_of(archive)
    rng = random.Random(22)
    files = [path for path in sorted(sound.rglob("*")) if path.is_file() and path.name != "lock"]
    index = sound / "index.sqlite"
    caught, unused = {"index": 0, "file": 0}, 0
    for turn in range(flips):
        file = index if turn % 2 else rng.choice([path for path in files if path != index])
        folder = tmp_path / "flipped"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(sound, folder)
        target = folder / file.relative_to(sound)
        content = bytearray(target.read_bytes())
        # Three quarters of a small index are zeros that nobody reads; flip what says something.
        used = [place for place, byte in enumerate(content) if byte or file != index]
        at, bit = rng.choice(used), rng.randrange(8)
        content[at] ^= 1 << bit
        target.write_bytes(content)
        told = _told(folder)
        if told:
            name = target.stem.lstrip("0") if target.suffix in (".h5", ".json") else target.name
            assert name in told, f"{target} byte {at} bit {bit}: {told}"
            caught["index" if file == index else "file"] += 1
            continue
        with Archive.open(folder, reserve_bytes=0) as archive:
            assert _all_of(archive) == truth, f"{target} byte {at} bit {bit} went unseen"
        assert file == index, f"{target} byte {at} bit {bit} went unseen"
        unused += 1
    print(
        f"{flips} bit flips: {caught['file']} of {(flips + 1) // 2} in files and "
        f"{caught['index']} in the index named by verify, {unused} in bytes of the index that hold "
        "nothing (every value unchanged), 0 unseen"
    )


def _told(folder: Path) -> str:
    """Return all that is said about an archive; only the archive's own errors may be raised."""
    try:
        with Archive.open(folder, reserve_bytes=0) as archive:
            told = "; ".join(
                f"{one.subject}: {one.problem}" for one in archive.verify() if one.problem
            )
            if told:
                _read_as_far_as_possible(archive)
    except ArchiveError as error:
        told = str(error)
    return told


def _readers(archive: Archive) -> list[Callable[[], Any]]:
    return [
        archive.shots,
        archive.drops,
        archive.calibrations.list,
        archive.calibrations.current,
        archive.jobs.list,
        lambda: archive.events.since(0),
        archive.tokens.list,
        archive.models.all,
        archive.models.history,
        *(lambda n=n: archive.fits.for_shot(n) for n in range(1, 6)),
        *(lambda n=n: archive.read_shot(n).recording.samples.tolist() for n in range(1, 6)),
        *(lambda n=n: archive.read_shot(n).metadata for n in range(1, 6)),
    ]


def _all_of(archive: Archive) -> str:
    return repr([read() for read in _readers(archive)])


def _read_as_far_as_possible(archive: Archive) -> None:
    for read in _readers(archive):
        try:
            read()
        except ArchiveError:
            continue


def test_every_column_of_every_table_has_its_share_in_the_checksums(tmp_path: Path) -> None:
    """A column that is added without its checksum is found here."""
    index = Index(tmp_path / "index.sqlite")
    tables = index.rows(
        "SELECT name FROM sqlite_master WHERE type='table' AND name NOT LIKE 'sqlite_%'"
    )
    columns = {
        row["name"]: [one["name"] for one in index.rows(f"PRAGMA table_info({row['name']})")]
        for row in tables
    }
    index.close()
    assert columns.pop("row_digests") == ["kind", "row", "digest"]
    assert columns == {table: names.split() for table, names in COLUMNS.items()}


@pytest.mark.parametrize("journal", [True, False])
def test_a_changed_row_is_not_taken_over_by_a_rebuilt_index(sound: Path, journal: bool) -> None:
    """The journal gives it back as it was; without one it is named as lost."""
    content = (sound / "index.sqlite").read_bytes()
    assert content.count(b'"modulus_Pa"') == 5
    (sound / "index.sqlite").write_bytes(content.replace(b'"modulus_Pa"', b'"modulus_Po"', 1))
    if not journal:
        (sound / "journal.jsonl").unlink()
    report = Archive.reindex(sound)
    assert len(report.lost) == (0 if journal else 1)
    assert all("of fits" in one for one in report.lost)
    with Archive.open(sound, reserve_bytes=0) as archive:
        fits = sum(len(archive.fits.for_shot(number)) for number in range(1, 6))
        assert fits == (5 if journal else 4)
        assert [found for found in archive.verify() if found.problem] == []


def test_an_older_index_gets_its_checksums(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that were there before the checksums have them after the first start."""
    before = schema.MIGRATIONS[: schema.MIGRATIONS.index(checksums.migration())]
    with monkeypatch.context() as older:
        older.setattr(schema, "MIGRATIONS", before)
        older.setattr(Index, "_check_form", lambda _: None)  # it knows the present form only
        index = Index(tmp_path / "index.sqlite", scratch=True)  # it had no journal either
        index.write("INSERT INTO events (utc, kind, data) VALUES ('x', 'x', '{}')")
        index.close()
    index = Index(tmp_path / "index.sqlite")
    assert index.number("SELECT count(*) FROM row_digests WHERE kind='events'") == 1
    assert list(index.problems()) == []
    index.close()


def test_a_damaged_file_is_a_problem_and_never_a_crash(tmp_path: Path) -> None:
    """Over HTTP: 500 `damaged` with what to do for that shot, everything else goes on."""
    with daemon_here(tmp_path / "data") as here:
        number = here.drop("one").json()["number"]
        until(lambda: here.get(f"/v1/drops/{number}")["state"], ENDED.__contains__)
        path = here.daemon.archive.shot_path(number)
        content = path.read_bytes()
        rng = random.Random(23)
        for _ in range(20):
            flipped = bytearray(content)
            flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
            path.write_bytes(flipped)
            for what in (".h5", "/trace"):
                answer = here.client.get(f"/v1/shots/{number}{what}")
                assert answer.status_code == 500
                assert answer.json()["type"] == "urn:impactd:problem:damaged"
                assert answer.json()["remedy"]
        path.write_bytes(content)
        assert here.client.get(f"/v1/shots/{number}.h5").status_code == 200
        here.ready()


@pytest.mark.parametrize(
    ("written", "found"),
    [
        (b"CREATE TABLE events", b"CREATE TAB\xc5E events"),
        (b"secret_sha256 TEXT", b"secret_sha257 TEXT"),
    ],
)
def test_a_damaged_name_in_the_index_is_an_error_with_a_remedy(
    sound: Path, written: bytes, found: bytes
) -> None:
    """SQLite's own error may be no text; another column is an error only once it is asked for."""
    path = sound / "index.sqlite"
    content = path.read_bytes()
    assert written in content
    path.write_bytes(content.replace(written, found))
    with pytest.raises(ArchiveError, match="impactd reindex"):
        Archive.open(sound, reserve_bytes=0)
    report = Archive.reindex(sound)
    assert report.shots == 5
