"""A backup of an archive: one tar file, taken while the daemon works.

The index is not in it. It is rebuilt from the journal and the files, which is what a restore does
(`reindex`); so nothing has to stand still. The journal is read first and up to its last whole
line: every file that it names is there by then, and what is stored later has its own file.
"""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from impactd.storage.archive import CALIBRATIONS_NAME, Archive
from impactd.storage.diagnoses import DIAGNOSES_NAME
from impactd.storage.errors import ArchiveError
from impactd.storage.journal import JOURNAL_NAME
from impactd.storage.material_changes import MATERIAL_CHANGES_NAME
from impactd.storage.numbers import LAST_NUMBER_NAME
from impactd.storage.recording_files import RECORDINGS_NAME
from impactd.storage.reindex import ReindexReport
from impactd.storage.shot_store import PARTIAL_NAME, SHOTS_NAME
from impactd.storage.timestamp import utc_now
from impactd.storage.version import software

FORMAT = "impactd-backup/1"
MANIFEST = "manifest.json"
_FOLDERS = (SHOTS_NAME, CALIBRATIONS_NAME, DIAGNOSES_NAME, PARTIAL_NAME)
_BLOCK = 1 << 20

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class BackupReport:
    """What a backup holds."""

    file: Path
    files: int
    """Without the manifest."""
    size_bytes: int
    """Of these files together. [B]"""


def back_up(
    directory: Path, out: Path, progress: Progress = lambda text, share: None
) -> BackupReport:
    """Write a backup of an archive to a new tar file; the daemon may work meanwhile.

    ``progress`` hears what is being done and a share between 0 and 1. Raises ArchiveError if there
    is no archive, or the file exists.
    """
    journal = directory / JOURNAL_NAME
    if not journal.is_file():
        raise ArchiveError(f"{directory} holds no archive: {JOURNAL_NAME} is missing.")
    if out.exists():
        raise ArchiveError(f"{out} exists; give the backup another name.")
    text = journal.read_bytes()
    text = text[: text.rfind(b"\n") + 1]  # a line that is being written belongs to the next one
    sums: dict[str, str] = {}
    total = len(text)
    part = out.with_name(f".{out.name}.part")
    with tarfile.open(part, "w") as tar:
        sums[JOURNAL_NAME] = _add(tar, JOURNAL_NAME, text)
        waiting = list(_files(directory))
        for done, path in enumerate(waiting, start=1):
            content = path.read_bytes()
            name = path.relative_to(directory).as_posix()
            sums[name] = _add(tar, name, content)
            total += len(content)
            progress(f"backup: {name}", done / len(waiting))
        manifest = {
            "format": FORMAT, "utc": utc_now(), "software": software(), "sha256": sums
        }  # fmt: skip
        _add(tar, MANIFEST, json.dumps(manifest, indent=1).encode())
    part.replace(out)
    return BackupReport(out, len(sums), total)


def restore(file: Path, directory: Path) -> ReindexReport:
    """Restore an archive from a backup into a new or empty directory, and rebuild its index.

    Raises
    ------
    ArchiveError
        If the folder holds something, or the backup is not what was written; then nothing is kept
        under the name of a good archive.
    """
    if directory.exists() and any(directory.iterdir()):
        raise ArchiveError(f"{directory} is not empty; a backup is restored into an empty folder.")
    try:
        with tarfile.open(file) as tar:
            manifest = _manifest(tar, file)
            directory.mkdir(mode=0o750, parents=True, exist_ok=True)
            tar.extractall(directory, filter="data")  # no path leads out of the folder
    except tarfile.TarError as error:
        raise ArchiveError(f"{file} is no backup, or was cut short: {error}.") from error
    (directory / MANIFEST).unlink()
    found = {
        path.relative_to(directory).as_posix(): _sum(path.read_bytes())
        for path in directory.rglob("*")
        if path.is_file()
    }
    wrong = sorted(
        {name for name, sha in manifest.items() if found.get(name) != sha}
        | (found.keys() - manifest.keys())
    )
    if wrong:
        raise ArchiveError(
            f"{file} is damaged: {', '.join(wrong[:3])} {'is' if len(wrong) == 1 else 'are'} not "
            f"what was written. Take another backup; remove {directory}."
        )
    for folder in _FOLDERS:
        (directory / folder).mkdir(mode=0o750, exist_ok=True)
    return Archive.reindex(directory)


def _files(directory: Path) -> Iterator[Path]:
    for folder in _FOLDERS:
        yield from sorted(p for p in (directory / folder).glob("*") if p.is_file())
    yield from sorted(p for p in (directory / RECORDINGS_NAME).rglob("[!.]*") if p.is_file())
    if (directory / MATERIAL_CHANGES_NAME).is_file():
        yield directory / MATERIAL_CHANGES_NAME
    if (directory / LAST_NUMBER_NAME).is_file():
        yield directory / LAST_NUMBER_NAME  # the last one read: a number never comes again


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> str:
    info = tarfile.TarInfo(name)
    info.size, info.mode = len(content), 0o640
    tar.addfile(info, io.BytesIO(content))
    return _sum(content)


def _sum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _manifest(tar: tarfile.TarFile, file: Path) -> dict[str, str]:
    try:
        member = tar.extractfile(MANIFEST)
        assert member is not None, "it is a file"
        manifest = json.load(member)
        if manifest["format"] != FORMAT:
            raise ArchiveError(
                f"{file} is {manifest['format']}; this program reads {FORMAT}: use a newer one."
            )
        return dict(manifest["sha256"])
    except (KeyError, ValueError, TypeError, AssertionError) as error:
        raise ArchiveError(f"{file} is no backup of impactd, or was cut short.") from error
