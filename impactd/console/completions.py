"""What the shell offers for a value: names of the materials file, read without the program."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path
from typing import Any

_INSTALLED = Path(sys.prefix) / "share" / "impactd" / "config"


def spheres(incomplete: str) -> list[str]:
    """Return the spheres whose names begin so.

    Parameters
    ----------
    incomplete : str
        What was typed.

    Returns
    -------
    list of str
        None where the materials cannot be read: a shell must not be disturbed.
    """
    return _names("sphere", incomplete)


def surfaces(incomplete: str) -> list[str]:
    """Return the surfaces whose names begin so; see `spheres`."""
    return _names("surface", incomplete)


def _names(kind: str, incomplete: str) -> list[str]:
    try:
        names = _materials().get(kind, {})
    except (OSError, ValueError, KeyError):
        return []
    return sorted(name for name in names if name.startswith(incomplete))


def _materials() -> dict[str, Any]:
    """Return the materials of the rig that IMPACTD_CONFIG names, or those that came with us."""
    told = os.environ.get("IMPACTD_CONFIG")
    # as `impactd.settings.settings.find_config`, which would load what a shell does not wait for
    places = (Path(__file__).resolve().parents[2] / "config", _INSTALLED)
    ours = next((place for place in places if place.is_dir()), _INSTALLED) / "rig.toml"
    config = Path(told) if told else ours
    section = tomllib.loads(config.read_text(encoding="utf-8")).get("materials", {})
    return tomllib.loads((config.parent / section["file"]).read_text(encoding="utf-8"))
