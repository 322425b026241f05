"""The archive as acquisition and API use it."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.digitizer import Record
from impactd.storage.archive import (
    Archive,
    ArchiveError,
    CorruptShotError,
    DropRequest,
    DropStateError,
    IdempotencyConflictError,
    NotFoundError,
    Problem,
    ShotMetadata,
    StorageFullError,
)

PROBLEM = Problem("overrun", "Samples lost", 500, "The board lost samples.", "Drop again.")


def test_a_drop_has_its_row_before_anything_moves(
    archive: Archive, request_body: DropRequest
) -> None:
    """A new drop is numbered 1, requested, owned, and has no shot."""
    drop, created = archive.begin_drop(request_body, owner="anna", idempotency_key="k")

    assert created
    assert (drop.number, drop.state, drop.owner, drop.shot) == (1, "requested", "anna", None)
    assert archive.drop(1) == drop


def test_the_folders_of_a_new_archive_are_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a power cut could take the archive itself, with the first shots in it."""
    synced: set[str] = set()
    really_sync = os.fsync

    def sync_and_note(descriptor: int) -> None:
        synced.add(os.readlink(f"/proc/self/fd/{descriptor}"))
        really_sync(descriptor)

    monkeypatch.setattr(os, "fsync", sync_and_note)
    Archive.open(tmp_path / "new", reserve_bytes=0).close()

    assert {str(tmp_path), str(tmp_path / "new")} <= synced


def test_fifty_posts_with_one_key_make_one_drop(
    archive: Archive, request_body: DropRequest
) -> None:
    """The same key with the same body gives the same drop, however many ask at once."""
    with ThreadPoolExecutor(50) as pool:
        answers = list(
            pool.map(
                lambda _: archive.begin_drop(request_body, owner="a", idempotency_key="k"),
                range(50),
            )
        )

    assert {drop.number for drop, _ in answers} == {1}
    assert sum(created for _, created in answers) == 1
    assert len(archive.drops()) == 1


def test_a_key_of_another_request_is_refused(archive: Archive, request_body: DropRequest) -> None:
    """A key that was used for something else names what it belongs to."""
    archive.begin_drop(request_body, owner="a", idempotency_key="k")

    with pytest.raises(IdempotencyConflictError, match="number 1") as caught:
        archive.begin_drop(replace(request_body, sphere="hdpe"), owner="a", idempotency_key="k")

    assert caught.value.number == 1


@pytest.mark.parametrize("final", ["stored", "analysed", "failed", "aborted", "interrupted"])
def test_a_drop_that_ended_stays_ended(
    archive: Archive, request_body: DropRequest, final: str
) -> None:
    """No final state leads back to an active one."""
    archive.begin_drop(request_body, owner="a")
    archive.set_drop_state(1, final, PROBLEM)

    with pytest.raises(DropStateError, match=f"is {final}"):
        archive.set_drop_state(1, "armed")

    assert archive.drop(1).problem == PROBLEM


def test_a_stored_shot_reads_back_to_the_last_bit(
    archive: Archive,
    request_body: DropRequest,
    record: Callable[..., Record],
    metadata: ShotMetadata,
) -> None:
    """Codes, scale, circumstances and drop come back as they were; the drop is stored."""
    archive.begin_drop(request_body, owner="anna", idempotency_key="k")
    original = record()

    shot = archive.store_shot(1, original, metadata)
    read = archive.read_shot(1)

    assert archive.drop(1).state == "stored"
    assert archive.drop(1).shot == shot.number == 1
    assert read.record.codes.dtype == np.int16
    assert np.array_equal(read.record.codes, original.codes)
    assert replace(read.record, codes=original.codes) == original
    assert read.drop is not None
    assert read.drop.idempotency_key == "k"
    assert metadata.sensor is not None
    assert read.metadata.sensor is not None
    assert np.array_equal(
        np.asarray(read.metadata.sensor.covariance), np.asarray(metadata.sensor.covariance)
    )
    same = replace(read.metadata.sensor, covariance=None)
    assert same == replace(metadata.sensor, covariance=None)
    assert replace(read.metadata, sensor=None) == replace(metadata, sensor=None)
    assert shot.peak == pytest.approx(8000 * 3.0517578125e-4, rel=0.01)


def test_an_ended_drop_gets_no_shot(
    archive: Archive,
    request_body: DropRequest,
    record: Callable[..., Record],
    metadata: ShotMetadata,
) -> None:
    """A record that comes after the abort is refused and leaves no file."""
    archive.begin_drop(request_body, owner="a")
    archive.set_drop_state(1, "aborted", PROBLEM)

    with pytest.raises(DropStateError):
        archive.store_shot(1, record(), metadata)

    assert not list((archive.directory / "shots").iterdir())


def test_a_failed_record_is_kept_as_evidence_only(
    archive: Archive,
    request_body: DropRequest,
    record: Callable[..., Record],
    metadata: ShotMetadata,
) -> None:
    """A partial record has a file that says what it is, and is no shot."""
    archive.begin_drop(request_body, owner="a")

    path = archive.keep_partial(1, record(), metadata, "overrun")

    assert path.is_file()
    assert archive.shots() == []
    with pytest.raises(NotFoundError):
        archive.read_shot(1)


def test_shots_are_found_by_pair_and_time_page_by_page(
    archive: Archive, stored: Callable[..., int], metadata: ShotMetadata
) -> None:
    """Filters and the ``before`` cursor select shots, newest first."""
    numbers = [stored(seed=seed) for seed in range(5)]

    assert [shot.number for shot in archive.shots(limit=2)] == numbers[:2:-1]
    assert [shot.number for shot in archive.shots(before=3)] == [2, 1]
    assert len(archive.shots(surface="polycarbonate", sphere="acetal")) == 5
    assert archive.shots(surface="aluminium") == []
    assert archive.shots(since="2026-03-01T12:00:00.000001Z") == []
    assert len(archive.shots(since=metadata.started_utc, until="2026-03-02")) == 5


def test_numbers_go_on_after_a_restart(
    tmp_path: Path, request_body: DropRequest, record: Callable[..., Record], metadata: ShotMetadata
) -> None:
    """Drops and shots share one sequence that no restart sets back."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        archive.begin_drop(request_body, owner="a")
        archive.set_drop_state(1, "failed", PROBLEM)
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        second, _ = archive.begin_drop(request_body, owner="a")
        assert second.number == 2
        assert archive.store_shot(2, record(), metadata).number == 2


def test_what_a_dead_daemon_left_is_shown_and_never_fired_again(
    archive: Archive, request_body: DropRequest
) -> None:
    """Unfinished drops become interrupted, with a reason, once."""
    archive.begin_drop(request_body, owner="a")
    archive.set_drop_state(1, "armed")

    (drop,) = archive.interrupt_unfinished()

    assert drop.state == "interrupted"
    assert drop.problem is not None
    assert "armed" in drop.problem.detail
    assert archive.interrupt_unfinished() == []


def test_a_file_published_before_the_crash_is_not_lost(
    archive: Archive, stored: Callable[..., int], request_body: DropRequest
) -> None:
    """A drop whose file is durable but whose row was not written becomes stored."""
    number = stored()
    with archive.transaction():
        archive._index.write("DELETE FROM shots WHERE number=?", (number,))
        archive._index.write("UPDATE drops SET state='storing' WHERE number=?", (number,))

    (drop,) = archive.interrupt_unfinished()

    assert (drop.state, drop.shot) == ("stored", number)
    assert archive.read_shot(number).shot.number == number


def test_a_changed_file_is_refused(archive: Archive, stored: Callable[..., int]) -> None:
    """One flipped bit anywhere in the file is noticed on reading."""
    path = archive.shot_path(stored())
    content = path.read_bytes()
    generator = np.random.default_rng(0)
    for position in generator.integers(0, len(content), 40):
        damaged = bytearray(content)
        damaged[position] ^= 1 << int(generator.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(CorruptShotError, match="SHA-256"):
            archive.read_shot(1)


def test_a_missing_file_is_refused(archive: Archive, stored: Callable[..., int]) -> None:
    """A shot without its file says which file."""
    archive.shot_path(stored()).unlink()

    with pytest.raises(CorruptShotError, match=r"000001\.h5"):
        archive.read_shot(1)


def test_the_reserve_is_refused_before_arming(tmp_path: Path) -> None:
    """With less than the reserve free, the check before arming says so in numbers."""
    with Archive.open(tmp_path, reserve_bytes=1 << 60) as archive:
        assert archive.free_bytes() < 0
        with pytest.raises(StorageFullError, match="MB free") as caught:
            archive.check_space()
    assert caught.value.needed_bytes == 1 << 60
    assert caught.value.remedy


def test_a_lost_index_is_not_replaced_by_an_empty_one(tmp_path: Path) -> None:
    """An archive without its index refuses to open and says how to rebuild it."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")
    (tmp_path / "index.sqlite").unlink()

    with pytest.raises(ArchiveError, match="impactd reindex"):
        Archive.open(tmp_path, reserve_bytes=0)


def test_an_index_of_a_newer_program_is_refused(tmp_path: Path) -> None:
    """A version this program does not know is named, and nothing is changed."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        archive._index.write("PRAGMA user_version=99")

    with pytest.raises(ArchiveError, match="version 99"):
        Archive.open(tmp_path, reserve_bytes=0)


FULL_DISK = """
    import sys
    from pathlib import Path
    import numpy as np
    from drivers.digitizer import Record
    from impactd.storage.archive import Archive, DropRequest, ShotMetadata, StorageFullError

    codes = np.random.default_rng(0).integers(-9000, 9000, 200_000).astype(np.int16)
    record = Record(codes, 3e-4, 0.0, True, 1e6, 1.0, 10.0, 1000, 0, 0)
    about = ShotMetadata("2026-01-01T00:00:00.000000Z", 0, 9.81)
    with Archive.open(Path(sys.argv[1]), reserve_bytes=0) as archive:
        stored = []
        try:
            while True:
                drop, _ = archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")
                stored.append(archive.store_shot(drop.number, record, about).number)
        except StorageFullError as error:
            assert error.remedy, error
        assert len(stored) >= 2, stored
        for number in stored:
            assert np.array_equal(archive.read_shot(number).recording.samples, codes)
        assert not list(Path(sys.argv[1]).glob("**/.*.draft"))
        assert len(list(Path(sys.argv[1]).glob("shots/*"))) == len(stored)
    print("survived")
"""


def test_a_full_disk_is_an_ordinary_error(tmp_path: Path) -> None:
    """On a disk that is really full, a shot is refused, the others read, nothing half is left."""
    script = tmp_path / "full.py"
    script.write_text(textwrap.dedent(FULL_DISK))
    mount = tmp_path / "disk"
    mount.mkdir()
    probe = ["unshare", "-Urm", "mount", "-t", "tmpfs", "-o", "size=3m", "none", str(mount)]
    try:
        subprocess.run(probe, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("this system lets nobody mount a small disk")
    command = f"{' '.join(probe[2:])} && exec {sys.executable} {script} {mount}"

    done = subprocess.run(
        ["unshare", "-Urm", "sh", "-c", command], check=False, capture_output=True, text=True
    )

    assert done.stdout.strip() == "survived", done.stderr


CRASH = """
    import sys
    from pathlib import Path
    import numpy as np
    from drivers.digitizer import Record
    from impactd.storage.archive import Archive, DropRequest, ShotMetadata

    codes = np.random.default_rng(0).integers(-9000, 9000, 200_000).astype(np.int16)
    record = Record(codes, 3e-4, 0.0, True, 1e6, 1.0, 10.0, 1000, 0, 0)
    about = ShotMetadata("2026-01-01T00:00:00.000000Z", 0, 9.81)
    archive = Archive.open(Path(sys.argv[1]), reserve_bytes=0)
    print("open", flush=True)
    while True:
        drop, _ = archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")
        archive.store_shot(drop.number, record, about)
        print(drop.number, flush=True)
"""


@pytest.mark.parametrize("wait_ms", [11, 29])
def test_a_killed_daemon_loses_no_stored_shot(tmp_path: Path, wait_ms: int) -> None:
    """Whenever the process is killed, every shot it called stored reads back, and no number
    comes twice."""
    script = tmp_path / "crash.py"
    script.write_text(textwrap.dedent(CRASH))
    place = tmp_path / "archive"
    process = subprocess.Popen([sys.executable, script, place], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(3)]
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(wait_ms * 1e-3)
    process.kill()
    lines += process.stdout.readlines()
    process.stdout.close()
    process.wait()
    told = [int(line) for line in lines[1:] if line.endswith("\n")]

    with Archive.open(place, reserve_bytes=0) as archive:
        archive.interrupt_unfinished()
        kept = [shot.number for shot in archive.shots(limit=10_000)]
        assert set(told) <= set(kept)
        for number in kept:
            archive.read_shot(number)
        assert all(drop.state in ("stored", "interrupted") for drop in archive.drops(10_000))
        assert [finding for finding in archive.verify() if finding.problem] == []
        last = archive.drops(1)[0].number
        fresh, _ = archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")
        assert fresh.number > last
