"""`impactd doctor` against installations that really have the problem."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import serial

from impactd.console import doctor_rescue
from impactd.console.doctor import examine
from impactd.console.doctor_checks import Finding
from impactd.daemon import Daemon
from impactd.settings.settings import find_config, load_settings

ROOT = Path(__file__).parents[3]
NOBODY = 65534
Write = Callable[..., Path]


@pytest.fixture
def settings(tmp_path: Path) -> Write:
    """Return a function that writes the simulated rig's settings, changed as a text."""

    def write(*changes: tuple[str, str], real: bool = False) -> Path:
        text = find_config("simulated.toml").read_text(encoding="utf-8")
        if real:
            text = re.sub(r"\n\[simulation\].*?(?=\n\[|\Z)", "", text, flags=re.S)
        for pattern, replacement in changes:
            text, count = re.subn(pattern, replacement, text, flags=re.M)
            assert count, pattern
        (tmp_path / "materials.toml").write_bytes(find_config("materials.toml").read_bytes())
        file = tmp_path / "rig.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def told(config: Path, data: Path) -> dict[str, Finding]:
    """Return what the doctor finds, by name."""
    return {finding.name: finding for finding in examine(config, data)}


def is_told(finding: Finding, said: str, mend: str) -> None:
    """Hold a problem to its sentence and its cure."""
    assert not finding.well
    assert said in finding.said
    assert mend in finding.mend


def test_where_a_record_goes_without_a_rescue_directory_is_a_sentence(tmp_path):
    """Whether there is a place, and whether it is of any use."""
    nowhere, _ = doctor_rescue._without([], tmp_path)
    assert nowhere.endswith("the record in memory is lost")
    same, _ = doctor_rescue._without([tmp_path], tmp_path)
    assert same.endswith(f"has only {tmp_path} to go to, on the same disk, and is lost")


def test_a_missing_package_is_named_before_anything_stumbles_over_it(tmp_path):
    """A virtual environment without pyserial: the package and the command that brings it."""
    there = tmp_path / "site"
    there.mkdir()
    for entry in Path(serial.__file__).parents[1].iterdir():
        if not entry.name.startswith(("serial", "pyserial")):
            (there / entry.name).symlink_to(entry)
    code = (
        f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(there)!r}]\n"
        "from impactd.cli import main; sys.argv[1:] = ['doctor', '--json']; main()"
    )
    made = subprocess.run(
        [sys.executable, "-S", "-E", "-c", code], capture_output=True, text=True, check=False,
        cwd=tmp_path, timeout=120,
    )  # fmt: skip
    assert made.returncode == 1, made.stderr
    assert json.loads(made.stdout)[-1]["said"] == "pyserial is missing"
    assert "pip install" in json.loads(made.stdout)[-1]["mend"]
    assert "Traceback" not in made.stderr


def test_a_wrong_key_is_named(settings, tmp_path):
    """A misspelt key of the settings."""
    file = settings((r"^port = 8642", "prot = 8642"))
    is_told(told(file, tmp_path / "data")["configuration"], "prot", "config/rig.toml")


def test_settings_that_are_not_there_are_named(tmp_path):
    """A path with a typing error."""
    found = told(tmp_path / "none.toml", tmp_path / "data")
    is_told(found["configuration"], "none.toml", "--config FILE")


def test_materials_are_held_to_what_is_possible(settings, tmp_path):
    """A file that nobody wrote, then one with a sphere of negative mass."""
    file, materials = settings(), tmp_path / "materials.toml"
    good = materials.read_text(encoding="utf-8")
    materials.unlink()
    assert any("materials.toml" in f.said for f in examine(file, tmp_path / "data") if not f.well)
    materials.write_text(good.replace("mass_kg = 0.000878", "mass_kg = -1"), encoding="utf-8")
    bad = [finding for finding in examine(file, tmp_path / "data") if not finding.well]
    assert "mass_kg" in bad[0].said
    assert bad[0].mend


def test_a_disk_without_its_reserve_is_told(settings, tmp_path):
    """The reserve is larger than what is free."""
    file = settings((r"^reserve_bytes = [\d_]+", "reserve_bytes = 1_000_000_000_000_000"))
    is_told(told(file, tmp_path / "data")["disk"], "room for 0 shots", "Free space")


def test_a_damaged_index_is_told_with_its_cure(settings, tmp_path):
    """Garbage where the index was."""
    file, data = settings(), tmp_path / "data"
    told(file, data)  # makes the archive
    for left in data.glob("index.sqlite-*"):
        left.unlink()
    (data / "index.sqlite").write_bytes(b"no database, whatever its name says" * 100)
    is_told(told(file, data)["index"], "damaged", "impactd reindex")


def test_a_foreign_token_is_told(settings, tmp_path, monkeypatch):
    """No token at all, and one of another archive in the environment."""
    monkeypatch.setenv("IMPACTD_TOKEN", "of another archive")
    found = told(settings(), tmp_path / "data")
    is_told(found["tokens"], "0 valid", "impactd token create")
    is_told(found["your token"], "unknown here", "export IMPACTD_TOKEN")


def test_a_taken_port_is_told(settings, tmp_path):
    """Another program listens where the daemon should."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        number = other.getsockname()[1]
        found = told(settings((r"^port = 8642", f"port = {number}")), tmp_path / "data")
    is_told(found["port"], f"127.0.0.1:{number}", "server.port")


def test_devices_that_are_not_there_are_told_one_by_one(settings, tmp_path):
    """No digitizer on the bus (or no libusb), no relay board at its port."""
    file = settings((r"^\[valve\]", '[valve]\nport = "/dev/no-such-relay"'), real=True)
    found = told(file, tmp_path / "data")
    assert not found["digitizer"].well
    assert re.search("libusb|digitizer|board", found["digitizer"].said)
    assert found["digitizer"].mend
    is_told(found["valve"], "/dev/no-such-relay", "/dev/serial/by-id")


def test_a_relay_board_in_other_hands_is_told(settings, tmp_path):
    """Another program holds the port."""
    _, terminal = os.openpty()
    name = os.ttyname(terminal)
    with serial.Serial(name, exclusive=True):
        file = settings((r"^\[valve\]", f'[valve]\nport = "{name}"'), real=True)
        found = told(file, tmp_path / "data")
    os.close(terminal)
    is_told(found["valve"], "in use", "Stop it")


_AS_NOBODY = """
import json, os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import impactd.data_lock, impactd.settings.materials, impactd.rig.build
from impactd.console import doctor, doctor_checks
from impactd.settings.settings import load_settings
file, foreign, own = map(Path, sys.argv[2:5])
os.setgroups([]); os.setgid(int(sys.argv[5])); os.setuid(int(sys.argv[5]))
found = [doctor_checks.compiled_code(), *doctor._directory(load_settings(file, data=foreign))]
found += doctor._devices(load_settings(file, data=own))
print(json.dumps([(f.name, f.well, f.said, f.mend) for f in found]))
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become somebody else")
def test_what_a_user_may_not_touch_is_told(settings, tmp_path):
    """A foreign data folder, no place for compiled code, a serial port of another group."""
    for folder in (tmp_path, *tmp_path.parents):
        if folder.name.startswith(("pytest-", "popen-", tmp_path.name)):
            folder.chmod(0o755)  # pytest's own folders, one more of them beside other workers
    foreign, own = tmp_path / "foreign", tmp_path / "own"
    foreign.mkdir(mode=0o755)
    own.mkdir()
    os.chown(own, NOBODY, NOBODY)
    _, terminal = os.openpty()
    file = settings((r"^\[valve\]", f'[valve]\nport = "{os.ttyname(terminal)}"'), real=True)
    words = [sys.executable, "-B", "-c", _AS_NOBODY, ROOT, file, foreign, own, str(NOBODY)]
    clean = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "NUMBA_CACHE_DIR": "/proc/none"}
    made = subprocess.run(
        words, capture_output=True, text=True, check=False, env=clean, cwd="/", timeout=200,
    )  # fmt: skip
    os.close(terminal)
    assert made.returncode == 0, made.stderr
    found = {row[0]: Finding(*row) for row in json.loads(made.stdout)}
    is_told(found["compiled code"], "/proc/none", "NUMBA_CACHE_DIR")
    is_told(found["data directory"], "cannot be written", "chown")
    is_told(found["valve"], "may not be opened", "dialout")


def test_a_missing_rescue_directory_is_told_with_what_is_lost(settings, tmp_path):
    """Not a fault, as a rig may have one disk; the sentence says what that costs."""
    finding = told(settings(), tmp_path / "data")["rescue directory"]
    assert finding.well
    assert "none is configured" in finding.said
    assert "lost" in finding.said
    assert "/srv/impactd-rescue" in finding.mend


def _with_rescue(place):
    return (r"^reserve_bytes = .*", f'\\g<0>\nrescue_directory = "{place}"')


def test_a_rescue_directory_is_tried_with_a_file_of_a_record(settings, tmp_path, lasting_folder):
    """Written and synced, then removed; a daemon that ran leaves a mark that doctor finds."""
    file, data = settings(_with_rescue(lasting_folder)), tmp_path / "data"
    first = told(file, data)
    assert first["rescue directory"].well
    assert "took and synced" in first["rescue directory"].said
    assert "there is none" in first["rescue mark"].said
    assert not [path for path in lasting_folder.rglob("*") if path.is_file()]
    daemon = Daemon(load_settings(file, data=data))
    daemon.start()
    assert "none is of an earlier run" in _mark(file, data)
    daemon.stop()
    assert "survived its end" in _mark(file, data)


def _mark(file, data):
    found = doctor_rescue.rescue_directory(load_settings(file, data=data))
    return {finding.name: finding for finding in found}["rescue mark"].said


def test_a_rescue_directory_that_is_no_rescue_is_told(settings, tmp_path, lasting_folder):
    """Absent, emptied at a stop, or of somebody else."""
    data = tmp_path / "data"
    found = told(settings(_with_rescue(lasting_folder / "none")), data)["rescue directory"]
    is_told(found, "is not there", "install -d")
    found = told(settings(_with_rescue(tmp_path)), data)["rescue directory"]
    is_told(found, "emptied", "/srv/impactd-rescue")
    (lasting_folder / "impactd-rescued").mkdir(mode=0o777)
    (lasting_folder / "impactd-rescued").chmod(0o777)
    found = told(settings(_with_rescue(lasting_folder)), data)["rescue directory"]
    is_told(found, "belongs to somebody else", "daemon's user")


def test_the_way_to_temperature_and_humidity_is_tried(settings, tmp_path):
    """What a sensor says now is told with its unit; one that is away, with what to do."""
    section = '[environment]\nfile = "now.json"\nmax_age_s = 60.0\n\n[simulation]'
    config = settings((r"^\[simulation\]$", section))
    is_told(told(config, tmp_path / "data")["environment"], "now.json) cannot be read", "sensor")
    reading = {"temperature_C": {"value": 22.4, "u": 0.2}}
    (tmp_path / "now.json").write_text(json.dumps(reading), encoding="utf-8")
    found = told(config, tmp_path / "data")["environment"]
    assert (found.well, found.said) == (True, "22.4 degC (u 0.2 K)")
