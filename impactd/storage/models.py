"""The table of active models: with which model new shots are reported, and since when."""

from __future__ import annotations

from impactd.storage.index import Index
from impactd.storage.moment import utc_now

BASE_MODEL = "kv"


class ModelTable:
    """The table of active models.

    Parameters
    ----------
    index : Index
        Where it lives.
    """

    def __init__(self, index: Index) -> None:
        self._index = index

    def active(self) -> str:
        """Return the model that new results are reported with; ``kv`` until one was chosen."""
        row = self._index.row("SELECT name FROM active_models ORDER BY id DESC LIMIT 1")
        return BASE_MODEL if row is None else str(row["name"])

    def set_active(self, name: str) -> None:
        """Choose a model; the caller has checked that the analysis knows it."""
        self._index.write(
            "INSERT INTO active_models (name, since_utc) VALUES (?, ?)", (name, utc_now())
        )

    def history(self) -> list[tuple[str, str]]:
        """Return every choice with its moment, oldest first."""
        rows = self._index.rows("SELECT name, since_utc FROM active_models ORDER BY id")
        return [(row["name"], row["since_utc"]) for row in rows]
