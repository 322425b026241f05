"""The units are what they claim: valid, closed, and caught when they stop being so."""

from __future__ import annotations

import configparser
import shutil
import subprocess
from pathlib import Path

import pytest

from impactd.console.daemon_commands import MAKE_SAFE_WAIT_S

ROOT = Path(__file__).parents[2]
SYSTEMD = ROOT / "systemd"

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None,
    reason="systemd-analyze is not installed (Debian: apt install systemd)",
)


def check(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the check of `make check` over the units in a folder."""
    return subprocess.run(
        [SYSTEMD / "check", folder], capture_output=True, text=True, check=False, timeout=60
    )


@needs_systemd
def test_units_are_valid_and_hardened() -> None:
    """systemd accepts every unit without a warning and rates each service 2.0 or lower."""
    result = check(SYSTEMD)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@needs_systemd
@pytest.mark.parametrize(
    ("unit", "good", "bad", "complaint"),
    [
        ("impactd.service", "ProtectHome=", "ProtectHomes=", "ProtectHomes"),
        ("impactd.service", "SystemCallFilter=", "#SystemCallFilter=", "exposure"),
        ("impactd-calibration.timer", "OnCalendar=", "OnCalendar=nightly-ish ", "OnCalendar"),
        ("impactd-calibration.service", "Requires=impactd", "Requires=imapctd", "imapctd"),
    ],
)
def test_a_broken_unit_is_caught(
    unit: str, good: str, bad: str, complaint: str, tmp_path: Path
) -> None:
    """A misspelt key, lost hardening, a wrong date or unit name fails the check and is named."""
    for source in SYSTEMD.glob("impactd*.*"):
        shutil.copy(source, tmp_path)
    text = (tmp_path / unit).read_text()
    assert good in text
    (tmp_path / unit).write_text(text.replace(good, bad))
    result = check(tmp_path)
    assert result.returncode == 1
    assert complaint in result.stderr or "calendar" in result.stderr


def test_check_says_when_it_cannot_check(tmp_path: Path) -> None:
    """Without systemd-analyze the check says it was skipped, and why, instead of failing."""
    for program in ("bash", "dirname"):
        (tmp_path / program).symlink_to(shutil.which(program) or "")
    result = subprocess.run(
        [SYSTEMD / "check"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env={"PATH": str(tmp_path)},
    )
    assert result.returncode == 0
    assert "skipped" in result.stderr


def test_timer_slot_is_one_per_day() -> None:
    """The shell line of the calibration unit, as systemd unescapes it, names today's slot."""
    unit = (SYSTEMD / "impactd-calibration.service").read_text()
    line = next(line for line in unit.splitlines() if line.startswith("ExecStart="))
    command = line.split(" -c ", 1)[1].strip("'").replace("$$", "$").replace("%%", "%")
    shown = subprocess.run(
        ["/bin/sh", "-c", command.replace("exec /opt/impactd/bin/impactd", "echo")],
        capture_output=True,
        text=True,
        check=True,
        timeout=10,
    ).stdout.split()
    assert shown[:3] == ["calibrate", "--wait", "--slot"]
    prefix, date = shown[3].split("-", 1)
    assert prefix == "timer"
    assert len(date) == len("2026-01-31")


def test_readme_installs_every_file() -> None:
    """Each file of the folder is named in its README, and each install line names a real file."""
    readme = (SYSTEMD / "README.md").read_text()
    for path in SYSTEMD.iterdir():
        if path == SYSTEMD / "README.md":
            continue
        assert path.name in readme
    for line in readme.splitlines():
        if line.startswith("install ") and "/dev/null" not in line:
            sources = [word for word in line.split() if word.startswith(("systemd/", "config/"))]
            assert sources
            for source in sources:
                assert (ROOT / source).is_file(), f"{source} is named in systemd/README.md"


def test_the_valve_is_made_safe_after_every_end() -> None:
    """After the daemon's end, however it came, the unit asks the relay for less than it has."""
    unit = configparser.RawConfigParser(strict=False)
    unit.read_string((SYSTEMD / "impactd.service").read_text())
    service = unit["Service"]
    assert service["ExecStopPost"].startswith("/opt/impactd/bin/impactd make-safe ")
    assert service.getfloat("TimeoutStopSec") > MAKE_SAFE_WAIT_S
    assert "ExecReload" not in service


def test_one_fit_cannot_take_the_service_with_it() -> None:
    """When the kernel ends a process for its memory, the unit goes on."""
    unit = configparser.RawConfigParser(strict=False)
    unit.read_string((SYSTEMD / "impactd.service").read_text())
    assert unit["Service"]["OOMPolicy"] == "continue"
