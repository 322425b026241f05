"""The shipped simulated rig as configuration files of a test's own."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from impactd.settings.settings import find_config


def write_simulated_rig(
    folder: Path,
    *,
    clock_speed: str = "4.0",
    changes: Mapping[str, str] | None = None,
    more: str = "",
) -> Path:
    """Write `rig.toml` and its materials into a folder, and return the path of `rig.toml`.

    At a `clock_speed` of 1.0 a drop is refused if the host is too busy for half a second; only a
    test of that check should ask for it. `changes` replaces old text by new; `more` is appended.
    """
    text = find_config("simulated.toml").read_text(encoding="utf-8")
    speed = {"clock_speed = 1.0": f"clock_speed = {clock_speed}"}
    for old, new in {**speed, **(changes or {})}.items():
        assert old in text, old
        text = text.replace(old, new)
    config = folder / "rig.toml"
    config.write_text(text + more, encoding="utf-8")
    shutil.copy(find_config("materials.toml"), folder)
    return config
