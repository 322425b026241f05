"""The materials of a rig with their changes: who, when, and from what to what.

::

    materials.toml ──┐
                     ├─> MaterialBook.current ──> drops, fits, moduli
    ARCHIVE/material-changes.jsonl, one line a change, synced before it counts

A change takes effect at once and for what comes after it. A stored fit says with which ``version``
it was made, and that version can be had again.
"""

from __future__ import annotations

import json
import re
import threading
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from impactd.aliases import Json
from impactd.settings.errors import SettingsError
from impactd.settings.materials import Materials, materials_of, read_entries
from impactd.storage.material_changes import MATERIAL_CHANGES_NAME, append_line, whole_lines
from impactd.storage.plain_text import find_forbidden
from impactd.storage.ranges import impossible_density
from impactd.storage.timestamp import utc_now

Role = Literal["sphere", "surface"]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True)
class MaterialChange:
    """One change of one material."""

    version: int
    """From 1; the book has this version after the change."""
    utc: str
    by: str
    role: Role
    name: str
    before: Json | None
    """Its entry until then, ``None`` for a new one."""
    after: Json
    """Its entry since, in the keys of the materials file."""
    note: str
    """Why, in the words of whoever changed it."""


class MaterialBook:
    """The materials of a rig, with their changes. Thread safe.

    The materials ``file`` stays as it is; the changes are kept in the archive's ``directory``, as
    they belong to the shots. Raises SettingsError if file or changes cannot be read.
    """

    def __init__(self, file: Path, directory: Path) -> None:
        self._file = file
        self._log = directory / MATERIAL_CHANGES_NAME
        self._lock = threading.Lock()
        self._base = read_entries(file)
        self.changes: tuple[MaterialChange, ...] = _read(self._log)
        self._entries = _applied(self._base, self.changes)
        self.current: Materials = self._with_version(self._entries, self.version)

    @property
    def version(self) -> int:
        """How many changes there were."""
        return len(self.changes)

    def entries(self, role: Role) -> dict[str, Json]:
        """Return every entry of a role in the keys of the materials file."""
        return deepcopy(self._entries[role])

    def at(self, version: int) -> Materials:
        """Return the materials as they were after so many changes."""
        if version >= self.version:
            return self.current
        version = max(0, version)
        return self._with_version(_applied(self._base, self.changes[:version]), version)

    def _with_version(self, entries: Json, version: int) -> Materials:
        return replace(materials_of(entries, self._file), version=version)

    def first_stated(self) -> Materials:
        """Return every material as it was stated first: a simulated rig is made from these."""
        entries = deepcopy(self._base)
        for one in self.changes:
            entries.setdefault(one.role, {}).setdefault(one.name, deepcopy(one.after))
        return materials_of(entries, self._file)

    def change(self, role: Role, name: str, entry: Json, *, by: str, note: str) -> MaterialChange:
        """Change or add a material; it counts once it would survive a power cut.

        Parameters
        ----------
        name : str
            Letters, digits, ``_``, ``.`` and ``-``: it stands in requests and file names.
        entry : dict
            In the keys of the materials file; complete, not a difference.

        Raises
        ------
        SettingsError
            If name or entry must not be used; nothing is changed then.
        """
        if not _NAME.fullmatch(name):
            raise SettingsError(
                None,
                role,
                (f"{name!r} is not a valid name; use letters, digits, _, . and -, at most 64"),
            )
        if find_forbidden(note) is not None:
            raise SettingsError(None, "note", "it holds characters that no text may hold")
        with self._lock:
            made = MaterialChange(
                version=self.version + 1,
                utc=utc_now(),
                by=by,
                role=role,
                name=name,
                before=self._entries[role].get(name),
                after=entry,
                note=note,
            )
            entries = _applied(self._entries, (made,))
            materials = replace(materials_of(entries, None), version=made.version)
            _refuse_impossible(role, name, materials)
            _append(self._log, made)
            self.changes = (*self.changes, made)
            self._entries, self.current = entries, materials
            return made


def _refuse_impossible(role: Role, name: str, materials: Materials) -> None:
    """Refuse a sphere of an impossible density: millimetres or grams were given."""
    if role == "sphere":
        sphere = materials.spheres[name]
        impossible = impossible_density(sphere.radius_m, sphere.mass_kg)
        if impossible is not None:
            raise SettingsError(None, f"{role}.{name}.mass_kg", impossible.removesuffix("."))


def _applied(entries: Json, changes: tuple[MaterialChange, ...]) -> Json:
    found = deepcopy(entries)
    for one in changes:
        found.setdefault(one.role, {})[one.name] = deepcopy(one.after)
    return found


def _append(log: Path, change: MaterialChange) -> None:
    line = json.dumps(asdict(change), allow_nan=False, ensure_ascii=False) + "\n"
    try:
        append_line(log, line.encode())
    except OSError as error:
        raise SettingsError(log, "", f"the change cannot be written: {error.strerror}") from error


def _read(log: Path) -> tuple[MaterialChange, ...]:
    try:
        lines = whole_lines(log)
    except FileNotFoundError:
        return ()
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(log, "", f"cannot be read: {error}") from None
    try:
        return tuple(MaterialChange(**json.loads(line)) for line in lines)
    except (ValueError, TypeError) as error:
        raise SettingsError(
            log, "", f"line {len(lines)} or one before is no change of a material: {error}"
        ) from None
