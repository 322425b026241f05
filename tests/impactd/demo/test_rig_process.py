"""The demo's own daemon: its settings are the shipped ones but for what the demo changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.simulated.effects import EFFECTS, make_effect
from impactd.console.failure import Failure
from impactd.demo.drops import plan
from impactd.demo.rig_process import (
    CLOCK_SPEED,
    NOISE_MAX_V,
    TRIGGER,
    RigProcess,
    write_settings,
)
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config, load_settings


def test_settings_differ_from_the_shipped_rig_only_where_they_must(tmp_path: Path) -> None:
    """Seed, effect, clock, drawers and what the noise may be; all else is of simulated.toml."""
    write_settings(tmp_path / "rig.toml", seed=77, effect="clipping")
    ours = load_settings(tmp_path / "rig.toml")
    shipped = load_settings(find_config("simulated.toml"))
    assert ours.simulation is not None
    assert shipped.simulation is not None
    changed = {"seed": 77, "effect": "clipping", "clock_speed": CLOCK_SPEED}
    assert ours.simulation.model_dump() == shipped.simulation.model_dump() | changed
    assert ours.trigger.model_dump() == shipped.trigger.model_dump() | TRIGGER
    assert ours.preflight.model_dump() == shipped.preflight.model_dump() | {
        "noise_max_v": NOISE_MAX_V
    }
    theirs = {"simulation", "materials", "trigger", "preflight"}
    assert ours.model_dump(exclude=theirs) == shipped.model_dump(exclude=theirs)


def test_hum_as_large_as_any_that_is_drawn_lets_spheres_fall(tmp_path: Path) -> None:
    """Before a drop nothing may come near the trigger, and the noise has a limit."""
    write_settings(tmp_path / "rig.toml", seed=77, effect="mains_hum")
    ours = load_settings(tmp_path / "rig.toml")
    largest = next(p.high for p in EFFECTS["mains_hum"].parameters if p.name == "amplitude_v")
    for harmonics in (1.0, 2.0, 3.0, 4.0):
        values = {"amplitude_v": largest, "frequency_hz": 50.0, "harmonics": harmonics}
        hum_v = make_effect("mains_hum", values).ambient(np.arange(0.0, 0.02, 1e-5))
        assert hum_v is not None
        assert np.abs(hum_v).max() < ours.trigger.level_v - ours.trigger.hysteresis_v
        assert np.std(hum_v) < ours.preflight.noise_max_v


def test_the_drawers_hold_what_is_dropped_as_it_is_shipped(tmp_path: Path) -> None:
    """A secret that acts on one material only acts on one that the demo drops."""
    write_settings(tmp_path / "rig.toml", seed=77, effect="none")
    kept = load_materials(tmp_path / "materials.toml")
    shipped = load_materials(find_config("materials.toml"))
    dropped = [*plan(), *(("acetal", "aluminium", 0.02), ("acetal_small", "aluminium", 0.02))]
    assert set(kept.spheres) == {sphere for sphere, _, _ in dropped}
    assert set(kept.surfaces) == {surface for _, surface, _ in dropped}
    for name, sphere in kept.spheres.items():
        assert sphere == shipped.spheres[name]


def test_a_daemon_that_cannot_start_is_reported_with_its_own_words(tmp_path: Path) -> None:
    """A broken settings file ends the demo with the daemon's sentence, not with a timeout."""
    (tmp_path / "rig.toml").write_text("[rigg]\n")
    with (
        RigProcess(tmp_path / "rig.toml", tmp_path / "archive", tmp_path / "log") as rig,
        pytest.raises(Failure, match=r"code 1.*rig"),
    ):
        rig.connect()
