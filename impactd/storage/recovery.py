"""After a restart: what a dead daemon left under way is ended, and never fired again."""

from __future__ import annotations

from pathlib import Path

from impactd.storage import rescue
from impactd.storage.drops import Drop, DropTable
from impactd.storage.errors import ArchiveError, CorruptShotError
from impactd.storage.index import Index
from impactd.storage.problem import Problem
from impactd.storage.shot_store import ShotStore
from impactd.storage.shots import ShotTable


def end_interrupted(
    index: Index, store: ShotStore, rescue_directory: Path | None = None
) -> list[Drop]:
    """End every drop that is under way, and return these drops as they are now.

    A drop whose file was published before the end, or rescued to another disk, is stored: its shot
    is taken into the index. Every other one is interrupted.
    """
    for draft in store.drafts():
        pid = draft.name.split(".")[-2]
        if not Path(f"/proc/{pid}").exists():
            draft.unlink(missing_ok=True)
    active = DropTable(index).active()
    outside = {
        drop.number: where
        for drop in active
        if (where := _take_back(store, drop.number, rescue_directory))
    }
    if any(store.path(drop.number).exists() for drop in active):
        # The writer may have died between the name and its fsync; a row must not outlive its file.
        store.sync_names()
    return [_end(index, store, drop, outside.get(drop.number)) for drop in active]


def _take_back(store: ShotStore, number: int, rescue_directory: Path | None) -> Path | None:
    """Publish a rescued file in the archive; return where it stays if that is not possible."""
    if store.path(number).exists():
        return None
    path = rescue.find(store.directory, number, rescue_directory)
    if path is None:
        return None
    try:
        store.take(path, number)
    except CorruptShotError:
        return None
    except ArchiveError:
        return path
    return None


def _end(index: Index, store: ShotStore, drop: Drop, outside: Path | None) -> Drop:
    drops = DropTable(index)
    detail = f"The daemon ended while drop {drop.number} was {drop.state}."
    if store.path(drop.number).exists():
        try:
            found = store.find(store.path(drop.number))
        except CorruptShotError as error:
            detail = str(error)
        else:
            with index.transaction():
                ShotTable(index).add(found.row)
                return drops.set_state(drop.number, "stored")
    problem = Problem(
        type="interrupted",
        title="Drop interrupted",
        status=500,
        detail=detail,
        remedy="Check the rig, hang the sphere and ask for a new drop."
        if outside is None
        else f"Its record is whole: stop the daemon, free space, move {outside} to "
        f"{store.path(drop.number)} and run `impactd reindex`.",
    )
    return drops.set_state(drop.number, "interrupted", problem)
