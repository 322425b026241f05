"""Whether a campaign folder is still the one that a result was made from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from impactd.storage.campaign_folder import JSON_NAME, read_campaign_folder


def campaign_files(path: Path) -> dict[str, str]:
    """Return the SHA-256 of ``campaign.json`` and of every shot's file, by name.

    The folder was read once already, so that it is known to be whole.
    """
    file = path / JSON_NAME if path.is_dir() else path
    names = {file.name, *(shot.file for shot in read_campaign_folder(path).shots)}
    return {name: _sha256(file.parent / name) for name in names}


def digest_of(files: Mapping[str, str]) -> str:
    """Return the SHA-256 of what ``sha256sum`` prints for files in the order of their names."""
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(files.items()))
    return hashlib.sha256(lines.encode()).hexdigest()


def _sha256(file: Path) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()
