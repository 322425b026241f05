"""The settings file: found, checked whole, and refused with path and reason."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from impactd.settings import settings as module
from impactd.settings.settings import SettingsError, find_config, json_schema, load_settings

Change = Callable[[str], str]


@pytest.fixture
def load_changed(tmp_path: Path) -> Callable[[str, str], SettingsError]:
    """Load the simulated rig's file with one text replaced; return the error."""

    def load(old: str, new: str) -> SettingsError:
        text = find_config("simulated.toml").read_text(encoding="utf-8")
        assert old in text
        (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
        file = tmp_path / "changed.toml"
        file.write_text(text.replace(old, new, 1), encoding="utf-8")
        with pytest.raises(SettingsError) as raised:
            load_settings(file)
        assert raised.value.file == file
        return raised.value

    return load


def test_the_simulated_rig_is_complete() -> None:
    """The file that ships needs nothing else and selects the simulated rig."""
    settings = load_settings(find_config("simulated.toml"))
    assert settings.simulated
    assert settings.server.port == 8642
    assert settings.preflight.require_valid_calibration is False
    assert settings.materials.file.is_absolute()


def test_the_data_folder_can_be_given(tmp_path: Path) -> None:
    """`--data` wins over the file."""
    settings = load_settings(find_config("simulated.toml"), data=tmp_path)
    assert settings.storage.directory == tmp_path


def test_the_snapshot_is_json_and_keeps_the_simulation_sealed() -> None:
    """What goes into a shot file must not tell the analysis what it is to find out."""
    snapshot = load_settings(find_config("simulated.toml")).snapshot()
    assert json.loads(json.dumps(snapshot, allow_nan=False)) == snapshot
    assert snapshot["simulated"] is True
    assert "simulation" not in snapshot


@pytest.mark.parametrize(
    ("old", "new", "path", "words"),
    [
        ("port = 8642", "prot = 8642", "server.prot", "did you mean port"),
        ("[trigger]", "[triger]", "triger", "did you mean trigger"),
        ("port = 8642", "port = 86420", "server.port", "86420"),
        ("level_v = 0.05", 'level_v = "high"', "trigger.level_v", "'high'"),
        ("level_v = 0.05", "level_v = nan", "trigger.level_v", "finite"),
        ("sample_rate_hz = 1.0e6\n", "", "digitizer.sample_rate_hz", "frequency standard"),
        ("sample_rate_hz = 1.0e6", "sample_rate_hz = 1.0e5", "digitizer", "more than 5 %"),
        ("range_v = 10.0", "range_v = 3.0", "digitizer.range_v", "10, 5, 2, 1"),
        ("range_v = 10.0", "rang_v = 10.0", "digitizer.rang_v", "did you mean range_v"),
        (
            "vendor_id = 0x0622",
            'driver = "usb2673"',
            "digitizer.driver",
            "'usb2673' is not known; known: 'daq3500', 'usb2637'",
        ),
        ("vendor_id = 0x0622", 'driver = "usb2637"', "digitizer.differential", "unknown key"),
        ("u = 0.19", "u = 0.0", "sensor.hsd_n_per_v.u", "greater than 0"),
        ("value = 35.4e-3", "value = -35.4e-3", "sensor", "must be positive"),
        ("held_above = true\n", "", "valve", "held_above"),
        ('driver = "numato"', 'driver = "lcus"', "valve", "no converter"),
        ("pre_trigger_s = 0.020", "pre_trigger_s = 0.5", "trigger", "shorter than record_s"),
        ('sphere = "acetal"', 'sphere = "acetl"', "calibration.plan.0.sphere", "Did you mean"),
        ('sphere = "acetal"', 'sphere = "hdpe"', "calibration.plan.0.sphere", "reference = true"),
        (
            "drop_height_m = 0.025",
            "drop_height_m = 25.0",
            "calibration.plan.0.drop_height_m",
            "0.002 to 0.15",
        ),
        ("repeats = 2", "repeats = 0", "calibration.plan.0.repeats", "greater than or equal to 1"),
        ("level_v = 0.05", "level_v = 12.0", "", "outside the range"),
        ("relay = 0", 'relay = 0\nport = "/dev/ttyACM0"', "", "left out on the simulated rig"),
    ],
)
def test_a_wrong_key_is_refused_with_its_path(
    load_changed: Callable[[str, str], SettingsError], old: str, new: str, path: str, words: str
) -> None:
    """The message names the TOML path, the reason and, for a slip, the likely word."""
    error = load_changed(old, new)
    reasons = {finding.path_in_file: finding.reason for finding in error.findings}
    assert words in reasons[path]
    assert str(error.file) in str(error)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("", "given: none"),
        ('command = ["x"]\nfile = "x"\nmax_age_s = 60.0', "given: file and command"),
        (
            'file = "x"\nmax_age_s = 60.0\nrelative_humidity = { value = 0.5, u = 0.05 }',
            "given: constants and file",
        ),
        ('file = "x"', "file and max_age_s belong together"),
        ('command = ["x"]\nmax_age_s = 60.0', "file and max_age_s belong together"),
        (
            "temperature_C = { value = 23.0, u = 1.0 }\ncommand_limit_s = 2.0",
            "command_limit_s belongs to command",
        ),
        ("temperature_C = { value = -300.0, u = 1.0 }", "temperature_C.value is -300"),
        ("relative_humidity = { value = 45.0, u = 2.0 }", "between 0 and 1"),
        ("temperature_C = { value = 23.0, u = 1e-14 }", "no standard uncertainty of 23"),
    ],
)
def test_temperature_and_humidity_come_in_one_way(
    load_changed: Callable[[str, str], SettingsError], lines: str, words: str
) -> None:
    """Constants, a file or a command, each whole and possible."""
    error = load_changed("[simulation]", f"[environment]\n{lines}\n\n[simulation]")
    (finding,) = error.findings
    assert finding.path_in_file == "environment"
    assert words in finding.reason


@pytest.mark.parametrize(
    ("lines", "path", "words"),
    [
        ("temperature_C = 23.0", "environment.temperature_C", "got 23.0"),
        ("temperature_C = { value = 23.0 }", "environment.temperature_C.u", "missing"),
        ("temperature_C = { value = 23.0, u = 0.0 }", "environment.temperature_C.u", "than 0"),
        ("temperature_c = { value = 23.0, u = 1.0 }", "environment.temperature_c", "temperature_C"),
        ("command = []", "environment.command", "at least 1"),
        ('command = "x"', "environment.command", "tuple"),
        ('command = ["x"]\ncommand_limit_s = 600.0', "environment.command_limit_s", "60"),
    ],
)
def test_a_reading_without_its_uncertainty_is_refused(
    load_changed: Callable[[str, str], SettingsError], lines: str, path: str, words: str
) -> None:
    """A plain number is no reading, and a command is a list."""
    error = load_changed("[simulation]", f"[environment]\n{lines}\n\n[simulation]")
    reasons = {finding.path_in_file: finding.reason for finding in error.findings}
    assert words in reasons[path]


@pytest.mark.parametrize(
    "lines",
    [
        "temperature_C = { value = 23.0, u = 1.0 }",
        'file = "now.json"\nmax_age_s = 60.0',
        'command = ["sensor", "--password", "secret"]\ncommand_limit_s = 2.0',
    ],
)
def test_each_way_to_temperature_and_humidity_is_accepted(tmp_path: Path, lines: str) -> None:
    """A file is looked for beside the settings; what a shot file keeps holds no argument."""
    text = find_config("simulated.toml").read_text(encoding="utf-8")
    (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
    file = tmp_path / "changed.toml"
    file.write_text(f"{text}\n[environment]\n{lines}\n", encoding="utf-8")
    settings = load_settings(file)
    around = settings.environment
    assert around is not None
    assert around.file in (None, tmp_path / "now.json")
    assert around.is_constant == (around.file is None and around.command is None)
    snapshot = settings.snapshot()
    assert json.loads(json.dumps(snapshot, allow_nan=False)) == snapshot
    assert "secret" not in json.dumps(snapshot)


def test_everything_that_is_wrong_is_said_at_once(
    load_changed: Callable[[str, str], SettingsError],
) -> None:
    """A second round is not needed to find the second mistake."""
    error = load_changed("port = 8642", "prot = 1\nhots = 2")
    assert {finding.path_in_file for finding in error.findings} == {"server.prot", "server.hots"}


def test_what_is_no_toml_is_refused_with_the_line(tmp_path: Path) -> None:
    """A syntax error names line and column."""
    file = tmp_path / "broken.toml"
    file.write_text("[rig]\nname = \n", encoding="utf-8")
    with pytest.raises(SettingsError, match="line 2"):
        load_settings(file)


def test_a_missing_file_is_said_plainly(tmp_path: Path) -> None:
    """No traceback for a wrong name."""
    with pytest.raises(SettingsError, match="No such file"):
        load_settings(tmp_path / "none.toml")


def test_without_any_file_the_simulated_rig_is_pointed_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who has no settings yet is shown a complete example."""
    monkeypatch.delenv("IMPACTD_CONFIG", raising=False)
    monkeypatch.setattr(module, "SYSTEM_FILE", tmp_path / "none.toml")
    with pytest.raises(SettingsError, match=r"simulated\.toml"):
        load_settings()


def test_the_environment_names_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """`IMPACTD_CONFIG` is looked at when no file is given."""
    monkeypatch.setenv("IMPACTD_CONFIG", str(find_config("simulated.toml")))
    assert load_settings().rig.name == "simulated rig"


def test_config_is_found_after_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Away from a checkout the files lie under the environment's prefix."""
    place = tmp_path / "share" / "impactd" / "config"
    place.mkdir(parents=True)
    (place / "simulated.toml").write_text("", encoding="utf-8")
    installed = tmp_path / "lib" / "impactd" / "settings" / "settings.py"
    monkeypatch.setattr(module, "__file__", str(installed))
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert find_config("simulated.toml") == place / "simulated.toml"
    with pytest.raises(SettingsError, match="reinstall"):
        find_config("no-such-file.toml")


def test_the_schema_describes_every_key() -> None:
    """Each property of the JSON schema says what it means."""
    schema = json_schema()
    for name, section in schema["$defs"].items():
        for key, description in section["properties"].items():
            assert description.get("description"), f"{name}.{key}"


@pytest.mark.parametrize(
    ("changes", "path", "words"),
    [
        ("pacer_divisor = 47\nsample_rate_hz = 1.0e6", "digitizer.pacer_divisor", "set 63 for 1"),
        ("pacer_divisor = 999\nsample_rate_hz = 64.0e3", "digitizer.pacer_divisor", "ten samples"),
        ("pacer_divisor = 127\nsample_rate_hz = 1.0e6", "digitizer", "500000 Hz that pacer_"),
        ("range_v = 5.0\nsample_rate_hz = 1.0e6", "digitizer.range_v", "+/-10 V only"),
        ("sample_rate_hz = 1.0e6\nchannel = 64", "digitizer.channel", "less than or equal to 63"),
        ("", "digitizer.sample_rate_hz", "frequency standard"),
    ],
)
def test_the_second_digitizer_says_which_rates_and_range_it_has(
    tmp_path: Path, changes: str, path: str, words: str
) -> None:
    """What the board cannot do is refused with what it can."""
    channel = "" if "channel" in changes else "channel = 0\n"
    lines = f'[digitizer]\ndriver = "usb2637"\nsample_rate_u_hz = 10.0\n{channel}{changes}\n\n'
    text = find_config("simulated.toml").read_text(encoding="utf-8")
    text = text[: text.index("[digitizer]")] + lines + text[text.index("[trigger]") :]
    (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError) as raised:
        load_settings(tmp_path / "rig.toml")
    reasons = {finding.path_in_file: finding.reason for finding in raised.value.findings}
    assert words in reasons[path]
