"""From settings to devices: real drivers unopened, simulated ones with a sealed truth."""

from __future__ import annotations

import json
import math
import stat
from pathlib import Path

import pytest

from drivers.daq3500.device import Daq3500
from drivers.relay.lcus import LcusValve
from drivers.relay.numato import NumatoValve
from impactd.rig.build import build_rig
from impactd.rig.rig import PersonLoader
from impactd.rig.simulated import SEALED_NAME, world_settings
from impactd.settings.materials import load_materials
from impactd.settings.settings import Settings, SettingsError, find_config, load_settings


def _simulated(data: Path, **simulation: object) -> Settings:
    settings = load_settings(find_config("simulated.toml"), data=data)
    assert settings.simulation is not None
    return settings.model_copy(
        update={"simulation": settings.simulation.model_copy(update=simulation)}
    )


def test_a_real_rig_is_built_without_touching_a_device(tmp_path: Path) -> None:
    """Building opens nothing: a daemon can start before its hardware is plugged in."""
    settings = load_settings(find_config("simulated.toml"), data=tmp_path)
    valve = settings.valve.model_copy(update={"port": "/dev/no-such-port"})
    real = settings.model_copy(update={"simulation": None, "valve": valve})
    rig = build_rig(real, load_materials(real.materials.file))
    assert isinstance(rig.digitizer, Daq3500)
    assert isinstance(rig.valve, NumatoValve)
    assert isinstance(rig.loader, PersonLoader)
    assert (rig.simulated, rig.clock_speed, rig.world) == (False, 1.0, None)
    rig.close()


def test_the_fallback_relay_is_chosen_by_name(tmp_path: Path) -> None:
    """`driver = "lcus"` builds the LCUS-1 driver."""
    settings = load_settings(find_config("simulated.toml"), data=tmp_path)
    keys = {"port": "/dev/no-such-port", "driver": "lcus", "adc_channel": None}
    valve = settings.valve.model_copy(update=keys)
    real = settings.model_copy(update={"simulation": None, "valve": valve})
    assert isinstance(build_rig(real, load_materials(real.materials.file)).valve, LcusValve)


def test_a_person_is_asked_in_words() -> None:
    """The request says what to hang, how high and over what, until it is taken back."""
    loader = PersonLoader()
    words = loader.ask("acetal", "polycarbonate", 0.047)
    assert words == "hang the acetal sphere 47.0 mm above the polycarbonate coupon"
    assert loader.asked == words
    loader.cancel()
    assert loader.asked is None


def test_the_truth_is_sealed_for_its_owner_only(tmp_path: Path) -> None:
    """What the world drew lies in the data folder, readable by nobody else."""
    settings = _simulated(tmp_path, effect="random", seed=7)
    rig = build_rig(settings, load_materials(settings.materials.file))
    sealed = tmp_path / SEALED_NAME
    assert stat.S_IMODE(sealed.stat().st_mode) == 0o600
    truth = json.loads(sealed.read_text(encoding="utf-8"))
    assert len(truth["effects"]) == 1
    assert truth["surfaces"]["specimen"]["youngs_modulus_Pa"] > 0
    rig.close()


def test_the_world_is_drawn_within_labels_and_certificate(tmp_path: Path) -> None:
    """The simulated truth is what the labels say, within what they leave open."""
    settings = _simulated(tmp_path, clock_speed=math.inf)
    materials = load_materials(settings.materials.file)
    assert settings.simulation is not None
    world = world_settings(settings, materials, settings.simulation)
    assert set(world.spheres) == set(materials.spheres)
    assert world.surfaces["specimen"].youngs_modulus_pa is None
    assert world.cell.compliance_m_per_v == settings.sensor.compliance_m_per_v.value
    assert world.clock_speed == math.inf


def test_named_effects_take_given_parameters_and_draw_the_rest(tmp_path: Path) -> None:
    """Several effects act at once; a parameter that is given is taken at its word."""
    settings = _simulated(
        tmp_path,
        effect="coupler_highpass+mains_hum",
        effect_parameters={"coupler_highpass": {"time_constant_s": 5e-3}},
    )
    assert settings.simulation is not None
    world = world_settings(settings, load_materials(settings.materials.file), settings.simulation)
    first, second = (effect for effect in world.effects if not isinstance(effect, str))
    assert (first.id, first.values["time_constant_s"]) == ("coupler_highpass", 5e-3)
    assert second.id == "mains_hum"


@pytest.mark.parametrize(
    ("effect", "parameters", "path"),
    [
        ("no_such_effect", {}, "simulation.effect"),
        ("echo", {"echo": {"no_such_key": 1.0}}, "simulation.effect_parameters.echo"),
    ],
)
def test_an_unknown_effect_is_refused_with_its_path(
    tmp_path: Path, effect: str, parameters: dict[str, dict[str, float]], path: str
) -> None:
    """The simulator lists what it knows."""
    settings = _simulated(tmp_path, effect=effect, effect_parameters=parameters)
    assert settings.simulation is not None
    with pytest.raises(SettingsError) as raised:
        world_settings(settings, load_materials(settings.materials.file), settings.simulation)
    assert raised.value.path_in_file == path
