"""After a restart: what a dead daemon left under way is ended, and never fired again."""

from __future__ import annotations

from pathlib import Path

from impactd.storage.drops import Drop, DropTable
from impactd.storage.errors import CorruptShotError
from impactd.storage.index import Index
from impactd.storage.problem import Problem
from impactd.storage.shot_store import ShotStore
from impactd.storage.shots import ShotTable


def end_interrupted(index: Index, store: ShotStore) -> list[Drop]:
    """End every drop that is under way.

    A drop whose file was published before the end is stored: its shot is taken into the index.
    Every other one is interrupted.

    Parameters
    ----------
    index : Index
        The index.
    store : ShotStore
        The files.

    Returns
    -------
    list of Drop
        The drops that were under way, as they are now.
    """
    for draft in store.drafts():
        pid = draft.name.split(".")[-2]
        if not Path(f"/proc/{pid}").exists():
            draft.unlink(missing_ok=True)
    return [_end(index, store, drop) for drop in DropTable(index).active()]


def _end(index: Index, store: ShotStore, drop: Drop) -> Drop:
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
        remedy="Check the rig, hang the sphere and ask for a new drop.",
    )
    return drops.set_state(drop.number, "interrupted", problem)
