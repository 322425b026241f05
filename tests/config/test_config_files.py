"""The files in config/: complete, documented, and in step with the code."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from impactd.settings.instrument import Daq3500Section, Usb2637Section
from impactd.settings.settings import (
    Settings,
    SettingsError,
    find_config,
    json_schema,
    load_settings,
)

RIG = find_config("rig.toml").read_text(encoding="utf-8")

# What a rig's owner must fill in, for a test of the filled-in file.
FILLED = {
    "name": '"rig 1"', "max_drop_height_m": "0.15", "directory": '"data"',
    "vendor_id": "0x0622", "product_id_unloaded": "0x0470", "product_id_loaded": "0x2c01",
    "channel": "0", "differential": "false", "range_v": "10.0", "sample_rate_hz": "990786.0",
    "sample_rate_u_hz": "10.0", "level_v": "0.05", "hysteresis_v": "0.02", "driver": '"numato"',
    "port": '"/dev/ttyACM0"', "gravity_m_per_s2": "9.81", "speed_repeatability": "0.003",
    "serial_number": '"1"', "certificate": '"1"', "baseline_min_v": "-0.05",
    "baseline_max_v": "0.05", "noise_max_v": "0.01",
    "compliance_m_per_v": "{ value = 1e-8, u = 1e-10 }",
    "crystal_mass_kg": "{ value = 0.03, u = 0.003 }",
    "crystal_stiffness_n_per_m": "{ value = 4e8, u = 4e7 }",
    "crystal_damping_n_s_per_m": "{ value = 500.0, u = 50.0 }",
    "hsd_n_per_v": "{ value = 3.0, u = 0.2 }",
}  # fmt: skip


def sections(text: str) -> dict[str, str]:
    """Return the text of each table, commented-out tables included."""
    found: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        header = re.match(r"(?:# )?\[\[?([a-z_.]+)\]\]?(?:  # ([a-z0-9]+))?$", line)
        if header:
            name = f"{header[1]}.{header[2]}" if header[2] else header[1]
        found[name] = found.get(name, "") + line + "\n"
    return found


def models() -> dict[str, type[BaseModel]]:
    """Return the model of each table, and of the digitizer's other kinds."""
    found: dict[str, type[BaseModel]] = {"digitizer.usb2637": Usb2637Section}
    for name, field in Settings.model_fields.items():
        if name == "digitizer":
            found[name] = Daq3500Section
            continue
        kinds = [field.annotation, *getattr(field.annotation, "__args__", ())]
        found[name] = next(k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel))
    return found


@pytest.mark.parametrize("section", models())
def test_every_key_is_documented(section: str) -> None:
    """rig.toml names every key of every section, with a comment and its unit."""
    text = sections(RIG)[section]
    for key, field in models()[section].model_fields.items():
        if key == "plan":
            assert "calibration.plan" in sections(RIG)
            continue
        line = re.search(rf"^(?:# )?{key} = .*$", text, re.MULTILINE)
        assert line, f"{section}.{key} is missing in rig.toml"
        comment = line[0].rpartition("#")[2]
        assert len(comment) > 10, line[0]
        extra: Any = field.json_schema_extra or {}
        if "unit" in extra:
            assert f"[{extra['unit']}]" in line[0].replace("[byte]", "[byte]"), line[0]


def test_required_keys_stand_commented_out_and_marked() -> None:
    """What must be measured has no value in the file, only the word REQUIRED."""
    for section, model in models().items():
        if section == "simulation":
            continue
        for key, field in model.model_fields.items():
            marked = re.search(rf"^# {key} = .*REQUIRED", sections(RIG)[section], re.MULTILINE)
            assert bool(marked) == (field.is_required() or (section, key) == ("valve", "port")), key


def test_defaults_in_the_file_are_the_defaults_of_the_code() -> None:
    """A key that stands uncommented shows what happens without it."""
    for section, model in models().items():
        for key, field in model.model_fields.items():
            line = re.search(rf"^{key} = (.*?)\s+#", sections(RIG)[section], re.MULTILINE)
            if line:
                value = json.loads(re.sub(r"(?<=\d)_(?=\d)", "", line[1]))
                default = field.get_default(call_default_factory=True)
                shown = list(default) if isinstance(default, tuple) else default
                shown = str(shown) if isinstance(shown, Path) else shown
                assert value == shown, f"{section}.{key}"


def test_the_empty_rig_is_refused_with_every_missing_key() -> None:
    """No sensor quantity, id or port is invented; each one says where to take it from."""
    with pytest.raises(SettingsError) as raised:
        load_settings(find_config("rig.toml"))
    findings = {finding.path_in_file: finding.reason for finding in raised.value.findings}
    assert "certificate" in findings["sensor.compliance_m_per_v"]
    assert "lsusb" in findings["digitizer.vendor_id"]
    assert "frequency standard" in findings["digitizer.sample_rate_hz"]


def test_the_filled_in_rig_is_accepted(tmp_path: Path) -> None:
    """With the required keys filled in, the file describes a real rig."""
    lines = []
    for line in RIG.replace(sections(RIG)["digitizer.usb2637"], "").splitlines():
        key = re.match(r"# ([a-z0-9_]+) = .*REQUIRED", line)
        lines.append(f"{key[1]} = {FILLED[key[1]]}" if key else line)
    (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
    file = tmp_path / "impactd.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    settings = load_settings(file)
    assert not settings.simulated
    assert settings.valve.port == "/dev/ttyACM0"


def test_a_real_rig_without_a_port_is_refused(tmp_path: Path) -> None:
    """The relay's port is never guessed."""
    text = find_config("simulated.toml").read_text(encoding="utf-8")
    (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
    file = tmp_path / "impactd.toml"
    file.write_text(text[: text.index("[simulation]")], encoding="utf-8")
    with pytest.raises(SettingsError, match=r"valve\.port is missing"):
        load_settings(file)


def test_the_committed_schema_is_current() -> None:
    """Generated by `python -m impactd.settings.settings > config/impactd.schema.json`."""
    committed = json.loads(find_config("impactd.schema.json").read_text(encoding="utf-8"))
    assert committed == json.loads(json.dumps(json_schema()))
