"""JSON files that say whether they are what was written: a record and its SHA-256."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from impactd.storage.errors import ArchiveError
from impactd.storage.index import as_text
from impactd.storage.regular_file import read_regular_file

SEALED_LIMIT_BYTES = 256 * 1024 * 1024
"""A report with the curves of 500 shots at 0.5 MB each. [B]"""


def seal(record: Any) -> bytes:
    """Return the content of a file, for `publish`; the record is anything JSON can say."""
    return as_text({"sha256": _digest(record), "record": record}).encode()


def unseal(path: Path) -> Any:
    """Return the record that was given to `seal`, or the content of a file without a seal.

    Earlier versions did not seal. Raises ArchiveError if the file cannot be read or is not what
    was written.
    """
    remedy = "Restore it from a backup; `impactd verify` names every such file."
    try:
        kept = json.loads(read_regular_file(path, SEALED_LIMIT_BYTES))
        if not (isinstance(kept, dict) and kept.keys() & {"sha256", "record"}):
            return kept
        sound = _digest(kept["record"]) == kept["sha256"]
    except (OSError, ValueError, KeyError, RecursionError) as error:
        raise ArchiveError(f"{path} cannot be read: {error!r}.", remedy=remedy) from error
    if not sound:
        raise ArchiveError(f"{path} is not what was written: its SHA-256 differs.", remedy=remedy)
    return kept["record"]


def _digest(record: Any) -> str:
    return hashlib.sha256(as_text(record).encode()).hexdigest()
