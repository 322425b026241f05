"""The tables of models: the named ones with their versions, and which one fits use."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.base_models import DEFAULT_BASE
from impactd.storage.errors import ArchiveError, NotFoundError
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.publish import publish
from impactd.storage.sealed import seal, unseal
from impactd.storage.timestamp import utc_now

CHOICES_NAME = "active-models.json"


@dataclass(frozen=True)
class NamedModel:
    """A model that a diagnosis found and accepted."""

    name: str
    """E.g. ``kv+adhesive_layer``."""
    version: int
    """From 1; every diagnosis that ends in the same name makes the next one."""
    definition: dict[str, Any]
    """What `analysis.diagnosis.named_model` builds it from: owners and numbers of its effects."""
    provenance: dict[str, Any]
    """Diagnosis, shots and files it was found in, and the software."""
    created_utc: str


class ModelTable:
    """The tables of models.

    Every choice is kept in a file of the archive's ``directory`` too, so that it outlives a lost
    index.
    """

    def __init__(self, index: Index, directory: Path) -> None:
        self._index = index
        self._choices = directory / CHOICES_NAME

    def add(self, definition: dict[str, Any], provenance: dict[str, Any]) -> NamedModel:
        """Write a named model as the next version of its name."""
        name = definition["name"]
        with self._index.transaction():
            version = 1 + self._index.number(
                "SELECT coalesce(max(version), 0) FROM named_models WHERE name=?", (name,)
            )
            self._index.write(
                "INSERT INTO named_models VALUES (?, ?, ?, ?, ?)",
                (name, version, as_text(definition), as_text(provenance), utc_now()),
            )
            return self.named(name, version)

    def named(self, name: str, version: int | None = None) -> NamedModel:
        """Return a named model, the latest version unless one is given; raise NotFoundError."""
        row = self._index.row(
            "SELECT * FROM named_models WHERE name=? AND (? IS NULL OR version=?) "
            "ORDER BY version DESC LIMIT 1",
            (name, version, version),
        )
        if row is None:
            raise NotFoundError("model", name if version is None else f"{name} version {version}")
        return _named(row)

    def all(self) -> list[NamedModel]:
        """Return every version of every named model, newest first."""
        rows = self._index.rows("SELECT * FROM named_models ORDER BY created_utc DESC, name")
        return [_named(row) for row in rows]

    def active(self) -> str:
        """Return the model that new results are reported with; ``kv2`` until one was chosen."""
        row = self._index.row("SELECT name FROM active_models ORDER BY id DESC LIMIT 1")
        return DEFAULT_BASE if row is None else str(row["name"])

    def active_version(self) -> int | None:
        """Return the version of the active model, ``None`` for one without."""
        row = self._index.row("SELECT version FROM active_models ORDER BY id DESC LIMIT 1")
        return None if row is None else row["version"]

    def set_active(self, name: str, version: int | None = None) -> None:
        """Choose a model; the caller has checked that the analysis knows it."""
        with self._index.transaction():
            self._index.write(
                "INSERT INTO active_models (name, since_utc, version) VALUES (?, ?, ?)",
                (name, utc_now(), version),
            )
            rows = self._index.rows(
                "SELECT name, since_utc, version FROM active_models ORDER BY id"
            )
            publish(self._choices, seal([dict(row) for row in rows]), replace=True)

    def restore_choices(self) -> int:
        """Take the choices from their file where the index has none; return how many."""
        if self.history() or not self._choices.exists():
            return 0
        kept = self._kept()
        for choice in kept:
            self._index.write(
                "INSERT INTO active_models (name, since_utc, version) VALUES (?, ?, ?)", choice
            )
        return len(kept)

    def findings(self) -> Iterator[tuple[str, str | None]]:
        """Yield the name of the file of choices, if there is one, and what is wrong with it."""
        if not self._choices.exists():
            return
        try:
            same = [choice[:2] for choice in self._kept()] == self.history()
        except ArchiveError as error:
            yield str(self._choices), str(error)
        else:
            yield str(self._choices), None if same else "it is not what the index holds."

    def _kept(self) -> list[tuple[str, str, int | None]]:
        try:
            return [
                (str(one["name"]), str(one["since_utc"]), one["version"])
                for one in unseal(self._choices)
            ]
        except (KeyError, TypeError) as error:
            raise ArchiveError(
                f"{self._choices} cannot be read: {error!r}.",
                remedy="Choose the active model again.",
            ) from error

    def history(self) -> list[tuple[str, str]]:
        """Return every choice with its timestamp, oldest first."""
        rows = self._index.rows("SELECT name, since_utc FROM active_models ORDER BY id")
        return [(row["name"], row["since_utc"]) for row in rows]


def _named(row: sqlite3.Row) -> NamedModel:
    return NamedModel(
        name=row["name"],
        version=row["version"],
        definition=from_text(row["definition"]),
        provenance=from_text(row["provenance"]),
        created_utc=row["created_utc"],
    )
