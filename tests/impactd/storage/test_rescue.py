"""Where a record goes that its own disk does not take."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.digitizer import Record
from impactd.storage import rescue
from impactd.storage.archive import Archive, ArchiveError, DropRequest, ShotMetadata
from impactd.storage.lasting import mount_of, why_not_lasting


@pytest.mark.parametrize("folder", ["/tmp/x", "/var/tmp", "/dev/shm/x", "/run/impactd"])
def test_a_folder_that_is_emptied_is_no_place(folder: str) -> None:
    """The folders that systemd empties with the service, whatever disk they lie on."""
    assert why_not_lasting(Path(folder)) is not None
    assert Path(folder) not in rescue.places(Path(folder))


def test_memory_is_no_place_whatever_its_name() -> None:
    """A tmpfs is known from the table of mounts."""
    mounts = Path("/proc/self/mountinfo").read_text(encoding="utf-8").splitlines()
    points = [Path(line.split()[4]) for line in mounts if " - tmpfs " in line]
    outside = [point for point in points if not point.is_relative_to("/run")]
    if not outside:
        pytest.skip("no tmpfs is mounted here")
    for point in outside:
        if mount_of(point).kind == "tmpfs":  # another mount may hide it
            assert why_not_lasting(point / "below") is not None


def test_a_link_to_a_folder_that_is_emptied_is_no_place(lasting_folder: Path) -> None:
    """What counts is where the file lies."""
    (lasting_folder / "link").symlink_to("/var/tmp")
    assert "emptied" in str(why_not_lasting(lasting_folder / "link"))


def test_the_configured_folder_comes_first_then_the_cache(
    lasting_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The service's cache wins over the user's; nothing else is a place."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(lasting_folder / "user"))
    monkeypatch.delenv("CACHE_DIRECTORY", raising=False)
    disk = lasting_folder / "disk"
    assert rescue.places(disk) == [disk, lasting_folder / "user"]
    monkeypatch.setenv("CACHE_DIRECTORY", str(lasting_folder / "service"))
    assert rescue.places(disk) == [disk, lasting_folder / "service"]
    assert rescue.places(None) == [lasting_folder / "service"]


def test_a_rescued_record_outlives_the_folders_for_temporary_files(  # noqa: PLR0917 - fixtures
    tmp_path: Path,
    lasting_folder: Path,
    record: Callable[..., Record],
    metadata: ShotMetadata,
    request_body: DropRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The daemon ends, its private TMPDIR is deleted, and the next start stores the shot."""
    private = tmp_path / "private"
    private.mkdir()
    monkeypatch.setenv("TMPDIR", str(private))
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setenv("CACHE_DIRECTORY", str(private))  # a cache that goes, too
    data = tmp_path / "data"
    with Archive.open(data, reserve_bytes=0, rescue_directory=lasting_folder) as archive:
        drop, _ = archive.begin_drop(request_body, owner="anna")
        path = archive.rescue_shot(drop.number, record(), metadata)
    shutil.rmtree(private)
    assert path.is_relative_to(lasting_folder)
    with Archive.open(data, reserve_bytes=0, rescue_directory=lasting_folder) as archive:
        (ended,) = archive.interrupt_unfinished()
        assert ended.state == "stored"
        archive.read_shot(drop.number)
    assert not path.exists()


def test_without_a_lasting_place_the_refusal_names_what_was_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A record is not put where it will be deleted."""
    monkeypatch.setenv("CACHE_DIRECTORY", "/var/tmp")
    with pytest.raises(ArchiveError, match="/dev/shm"):
        rescue.keep(tmp_path, 1, b"record", Path("/dev/shm"))


def test_a_folder_that_is_not_there_is_not_made(
    tmp_path: Path, lasting_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be a disk that is not mounted, and what is written below its mount point is hidden."""
    monkeypatch.setenv("CACHE_DIRECTORY", "/var/tmp")
    with pytest.raises(ArchiveError, match="No such file"):
        rescue.keep(tmp_path, 1, b"record", lasting_folder / "disk")
    assert not (lasting_folder / "disk").exists()


def test_the_marks_of_the_last_two_starts_are_kept(tmp_path: Path, lasting_folder: Path) -> None:
    """The newest first; damage reads as none."""
    for start in ("a", "b", "c"):
        rescue.leave_mark(lasting_folder, tmp_path, start)
    assert [mark.start for mark in rescue.read_marks(lasting_folder, tmp_path)] == ["c", "b"]
    (path,) = lasting_folder.rglob("alive-*.json")
    path.write_bytes(b"\xff[")
    assert rescue.read_marks(lasting_folder, tmp_path) == []
