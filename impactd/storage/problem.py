"""A failure as a value, from the rig through the index to an HTTP client."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from impactd.storage.errors import ArchiveError


@dataclass(frozen=True)
class Problem:
    """Why something failed, in the members of RFC 9457."""

    type: str
    """Stable identifier, e.g. ``overrun``."""
    title: str
    """The kind of failure in a few words."""
    status: int
    """HTTP status that goes with it."""
    detail: str
    """What happened this time, with values and units."""
    remedy: str

    def to_text(self) -> str:
        """Return the problem as JSON text, as the index keeps it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str | None) -> Problem | None:
        """Return the problem that `to_text` wrote, ``None`` for ``None``."""
        if text is None:
            return None
        try:
            return cls(**json.loads(text))
        except (ValueError, TypeError) as error:
            raise ArchiveError(
                f"A row of the index cannot be read: {error}.",
                why="The file was changed after it was written.",
                remedy="Run `impactd verify`; `impactd reindex` rebuilds the index from the files.",
            ) from error
