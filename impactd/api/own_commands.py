"""Commands in hints, with the options of this daemon's own files, so that they work as printed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

SIGN_UP = "`impactd token create --scope operate --name ME`"
_ON_OUR_FILES = re.compile(
    r"`(impactd (?:token|import|export|verify|reindex|doctor|refit)(?: [^`]*)?)`"
)


def own_options(config: Path | None, data: Path | None) -> str:
    """Return ``--config`` and ``--data`` as a shell takes them from any folder, "" for neither."""
    given = (("--config", config), ("--data", data))
    return " ".join(
        f"{name} {shlex.quote(str(path.resolve()))}" for name, path in given if path is not None
    )


def as_typed_here(text: str, options: str) -> str:
    """Return a text whose commands in backticks have the options, where they take them."""
    return _ON_OUR_FILES.sub(lambda m: f"`{m[1]} {options}`", text) if options else text
