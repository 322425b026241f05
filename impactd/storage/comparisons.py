"""The table of comparisons: each drop's shot beside its repetitions, as it was seen right after."""

from __future__ import annotations

from impactd.aliases import Json
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.timestamp import utc_now


class ComparisonTable:
    """The table of comparisons; a shot has one, never made anew when more repetitions follow."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def add(self, shot: int, result: Json) -> None:
        """Write the comparison of a shot, once."""
        self._index.write(
            "INSERT OR IGNORE INTO comparisons (shot, result, created_utc) VALUES (?, ?, ?)",
            (shot, as_text(result), utc_now()),
        )

    def get(self, shot: int) -> Json | None:
        """Return the comparison of a shot, ``None`` where none was made."""
        row = self._index.row("SELECT result FROM comparisons WHERE shot=?", (shot,))
        return None if row is None else from_text(row["result"])
