"""Program and version, as they go into every file."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version


@cache
def software() -> str:
    """Return e.g. ``impactd 0.1.0``."""
    return f"impactd {version('impactd')}"
