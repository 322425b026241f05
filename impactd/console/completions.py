"""What the shell offers for a value: materials, effects and models, read without the program."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

_BASES = ("hsd", "kv", "kv2")
_EFFECTS = Path(__file__).resolve().parents[2] / "analysis" / "effects"
_ID = re.compile(r'^    id="(\w+)"', re.MULTILINE)
"""How a file of the library names its effect. Importing them all takes a second."""
_INSTALLED = Path(sys.prefix) / "share" / "impactd" / "config"


def spheres(incomplete: str) -> list[str]:
    """Return the spheres whose names begin so.

    Returns
    -------
    list of str
        None where the materials cannot be read: a shell must not be disturbed.
    """
    return _names("sphere", incomplete)


def surfaces(incomplete: str) -> list[str]:
    """Return the surfaces whose names begin so; see `spheres`."""
    return _names("surface", incomplete)


def effects(incomplete: str) -> list[str]:
    """Return the effects whose ids begin so, with what `impactd demo --effect` takes besides."""
    return [one for one in sorted({*_effects(), "none", "random"}) if one.startswith(incomplete)]


def models(incomplete: str) -> list[str]:
    """Return the models whose names begin so: bases, and after a plus the effects."""
    before, plus, begun = incomplete.rpartition("+")
    known = _effects() if plus else _BASES
    return [f"{before}{plus}{one}" for one in sorted(known) if one.startswith(begun)]


def _effects() -> set[str]:
    try:
        texts = [file.read_text(encoding="utf-8") for file in _EFFECTS.glob("*.py")]
    except OSError:
        return set()
    return {one for text in texts for one in _ID.findall(text)}


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
