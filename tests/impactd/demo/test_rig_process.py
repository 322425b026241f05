"""The demo's own daemon: its settings are the shipped ones but for what the demo changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from impactd.console.failure import Failure
from impactd.demo.rig_process import CLOCK_SPEED, RigProcess, write_settings
from impactd.settings import find_config, load_settings


def test_settings_differ_from_the_shipped_rig_only_where_they_must(tmp_path: Path) -> None:
    """Seed, effect and clock are the demo's; every other value is that of simulated.toml."""
    write_settings(tmp_path / "rig.toml", seed=77, effect="clipping")
    ours = load_settings(tmp_path / "rig.toml")
    shipped = load_settings(find_config("simulated.toml"))
    assert ours.simulation is not None
    assert shipped.simulation is not None
    changed = {"seed": 77, "effect": "clipping", "clock_speed": CLOCK_SPEED}
    assert ours.simulation.model_dump() == shipped.simulation.model_dump() | changed
    assert ours.model_dump(exclude={"simulation"}) == shipped.model_dump(exclude={"simulation"})


def test_a_daemon_that_cannot_start_is_reported_with_its_own_words(tmp_path: Path) -> None:
    """A broken settings file ends the demo with the daemon's sentence, not with a timeout."""
    (tmp_path / "rig.toml").write_text("[rigg]\n")
    with (
        RigProcess(tmp_path / "rig.toml", tmp_path / "archive", tmp_path / "log") as rig,
        pytest.raises(Failure, match=r"code 1.*rig"),
    ):
        rig.connect()
