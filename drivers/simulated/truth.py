"""The sealed truth of a simulated rig; its owner may open it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def seal(path: Path, truth: dict[str, object]) -> None:
    """Write the truth where only its owner can read it (mode 0600), replacing an older one.

    The file's folder must exist.
    """
    beside = path.with_name(path.name + ".new")
    beside.unlink(missing_ok=True)
    handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump(truth, file, indent=1, allow_nan=False)
        file.flush()
        os.fsync(file.fileno())
    beside.replace(path)


def unseal(path: Path) -> dict[str, Any]:
    """Return the truth that `seal` wrote; ValueError if the file does not hold one."""
    truth = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(truth, dict):
        raise ValueError(f"{path} does not hold a sealed truth.")  # noqa: TRY004 - a bad file
    return truth
