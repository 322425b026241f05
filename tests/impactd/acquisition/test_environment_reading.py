"""Temperature and humidity of a drop: where they come from, and that they hold up nothing."""

from __future__ import annotations

import json
import os
import stat
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.campaign import Environment, Quantity
from impactd.acquisition.environment_reading import EnvironmentReading, Unknown
from impactd.acquisition.transitions import State
from impactd.settings.sections import EnvironmentSection

from .conftest import Laboratory, request

WARM = {"temperature_C": {"value": 31.5, "u": 0.2}, "relative_humidity": {"value": 0.4, "u": 0.03}}
READ = Environment(Quantity(31.5, 0.2), Quantity(0.4, 0.03))
STATED = Environment(temperature_c=Quantity(21.3, 0.1))
HOUR_S = 3600.0


def read(
    section: EnvironmentSection | None, stated: Environment | None = None
) -> tuple[Environment | None, Unknown | None]:
    """Return what a reading brings once it is over."""
    with EnvironmentReading(section, stated) as reading:
        ends_s = time.monotonic() + 20.0
        while not reading.wait(0.01):
            assert time.monotonic() < ends_s
        return reading.result()


def from_file(path: Path) -> EnvironmentSection:
    """Return settings that name a file."""
    return EnvironmentSection(file=path, max_age_s=60.0)


def from_script(folder: Path, lines: str, limit_s: float = 10.0) -> EnvironmentSection:
    """Return settings that name a shell script with these lines."""
    script = folder / "a sensor.sh"
    script.write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return EnvironmentSection(command=(str(script), json.dumps(WARM)), command_limit_s=limit_s)


def is_gone(pid: int) -> bool:
    """Return whether a process has ended; one that nobody has waited for yet has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_without_settings_and_without_a_technicians_word_nothing_is_known() -> None:
    """Nobody promised a reading, so nobody misses it."""
    assert read(None) == (None, None)
    assert read(None, STATED) == (STATED, None)


def test_a_constant_is_taken_as_it_stands() -> None:
    """A climate-controlled room has one temperature."""
    assert read(EnvironmentSection(**WARM)) == (READ, None)


def test_the_technicians_reading_counts_and_the_settings_complete_it() -> None:
    """Each quantity by itself."""
    found, unknown = read(EnvironmentSection(**WARM), STATED)
    assert found == Environment(Quantity(21.3, 0.1), Quantity(0.4, 0.03))
    assert unknown is None


def test_a_command_is_not_run_where_the_technician_said_all(tmp_path: Path) -> None:
    """Nothing is waited for that is not needed."""
    section = from_script(tmp_path, f"touch {tmp_path}/ran")
    assert read(section, READ) == (READ, None)
    assert not (tmp_path / "ran").exists()


def test_a_fresh_file_is_read(tmp_path: Path) -> None:
    """What a sensor's program wrote lately counts; notes beside it do no harm."""
    file = tmp_path / "now.json"
    file.write_text(json.dumps({**WARM, "sensor": "SHT45 no. 7"}), encoding="utf-8")
    assert read(from_file(file)) == (READ, None)


def _missing(file: Path) -> None:
    file.unlink()


def _stale(file: Path) -> None:
    os.utime(file, (time.time() - HOUR_S,) * 2)


def _of_tomorrow(file: Path) -> None:
    os.utime(file, (time.time() + HOUR_S,) * 2)


def _link(file: Path) -> None:
    file.rename(file.with_name("elsewhere"))
    file.symlink_to(file.with_name("elsewhere"))


def _fifo(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def _holding(content: str | bytes) -> Callable[[Path], None]:
    def hold(file: Path) -> None:
        """Write the content."""
        file.write_bytes(content if isinstance(content, bytes) else content.encode())

    return hold


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_missing, "cannot be read: No such file"),
        (_stale, "is stale: it was last written at 20"),
        (_of_tomorrow, "which is in the future"),
        (_link, "links are not followed"),
        (_fifo, "FIFO"),
        (_holding(""), "not JSON"),
        (_holding(b"\xff\xfe"), "not UTF-8"),
        (_holding(" " * 70_000), "at most 65536 are read"),
        (_holding("[21.5]"), "must be an object"),
        (_holding("{}"), "neither temperature_C nor relative_humidity"),
        (_holding('{"temperature_C": 21.5}'), "must be an object, not 21.5"),
        (_holding('{"temperature_C": {"value": 21.5}}'), "needs its standard uncertainty"),
        (_holding('{"temperature_C": {"value": NaN, "u": 0.1}}'), "NaN is no JSON number"),
        (_holding('{"temperature_C": {"value": 9999, "u": 0.1}}'), "between -273.15 and 5000"),
        (_holding('{"relative_humidity": {"value": 45, "u": 1}}'), "between 0 and 1"),
        (_holding('{"temperature": {"value": 21.5, "u": 0.1}}'), "'temperature_C' was probably"),
    ],
)
def test_a_file_that_says_nothing_to_rely_on_is_told(
    tmp_path: Path, spoil: Callable[[Path], None], words: str
) -> None:
    """No number is made up; what the technician read stays."""
    file = tmp_path / "now.json"
    file.write_text(json.dumps(WARM), encoding="utf-8")
    spoil(file)
    found, unknown = read(from_file(file), STATED)
    assert found == STATED
    assert unknown is not None
    assert words in unknown.reason
    assert str(file) in unknown.reason
    assert "sensor's program" in unknown.remedy


def test_what_a_command_prints_is_read(tmp_path: Path) -> None:
    """Its name and its arguments arrive as they stand in the settings."""
    assert read(from_script(tmp_path, 'printf %s "$1"')) == (READ, None)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("echo broken >&2; exit 3", "failed with exit status 3"),
        ('printf %s "$1"; exit 1', "failed with exit status 1"),
        ("kill -TERM $$", "failed with signal 15"),
        ("echo 21.5 degrees", "not JSON"),
        ("true", "not JSON"),
        ("exec yes", "more than 65536 bytes"),
    ],
)
def test_a_command_that_fails_is_told(tmp_path: Path, lines: str, words: str) -> None:
    """With its exit status, or with what is wrong about what it printed."""
    found, unknown = read(from_script(tmp_path, lines))
    assert found is None
    assert unknown is not None
    assert words in unknown.reason
    assert "by hand" in unknown.remedy


def test_a_command_that_is_not_there_is_told(tmp_path: Path) -> None:
    """The shell says so on stderr; the reason has the name."""
    section = EnvironmentSection(command=(str(tmp_path / "nothing"),))
    found, unknown = read(section)
    assert found is None
    assert unknown is not None
    assert "nothing) failed with exit status 127" in unknown.reason


@pytest.mark.parametrize(
    "lines",
    [
        "echo $$ > PIDS; sleep 60",
        "echo $$ > PIDS; exec >&-; sleep 60",
        "sleep 60 & echo $! > PIDS; echo $$ >> PIDS; wait",
    ],
)
def test_a_command_that_hangs_is_ended_with_its_children(tmp_path: Path, lines: str) -> None:
    """Its time is the settings' limit; then it is killed."""
    pids = tmp_path / "pids"
    section = from_script(tmp_path, lines.replace("PIDS", str(pids)), limit_s=1.0)
    found, unknown = read(section)
    assert found is None
    assert unknown is not None
    assert "did not answer within 1 s" in unknown.reason
    ends_s = time.monotonic() + 20.0
    while not all(is_gone(int(pid)) for pid in pids.read_text().split()):
        assert time.monotonic() < ends_s
        time.sleep(0.01)


def test_a_grandchild_that_keeps_the_pipe_open_keeps_no_thread(tmp_path: Path) -> None:
    """Whoever escapes the group of the command holds up nothing."""
    before = threading.active_count()
    found, unknown = read(from_script(tmp_path, "setsid sleep 3 &", limit_s=0.5))
    assert found is None
    assert unknown is not None
    ends_s = time.monotonic() + 20.0
    while threading.active_count() > before:
        assert time.monotonic() < ends_s
        time.sleep(0.01)


# Through a whole drop


def test_a_drop_keeps_what_the_sensor_said(
    tmp_path: Path, build: Callable[..., Laboratory]
) -> None:
    """File, index and evidence agree; the settings' snapshot names the program alone."""
    section = from_script(tmp_path, 'printf %s "$1"')
    laboratory = build(environment=section.model_dump(exclude_none=True)).start()
    drop = laboratory.drop()
    assert drop.state == "stored"
    stored = laboratory.archive.read_shot(drop.number)
    assert stored.metadata.environment == stored.shot.environment == READ
    assert laboratory.archive.shot(drop.number).environment == READ
    assert stored.metadata.configuration["environment"]["command"] == [
        str(tmp_path / "a sensor.sh")
    ]
    assert "environment.unknown" not in [kind for kind, _ in laboratory.events]


def test_a_drop_without_a_reading_is_stored_and_told(
    tmp_path: Path, build: Callable[..., Laboratory]
) -> None:
    """The shot says why it has none, and so does an event."""
    missing = {"file": tmp_path / "none.json", "max_age_s": 60.0}
    laboratory = build(environment=missing).start()
    drop = laboratory.drop(request(environment=STATED))
    assert drop.state == "stored"
    metadata = laboratory.archive.read_shot(drop.number).metadata
    assert metadata.environment == STATED
    assert any("not known" in note and "none.json" in note for note in metadata.notes)
    told = next(data for kind, data in laboratory.events if kind == "environment.unknown")
    assert told["drop"] == drop.number
    assert "No such file" in told["detail"]


def test_the_command_has_ended_before_the_valve_opens(
    tmp_path: Path, build: Callable[..., Laboratory]
) -> None:
    """Nothing of it runs beside a fall, not even what hung."""
    pids = tmp_path / "pids"
    section = from_script(tmp_path, f"echo $$ > {pids}; sleep 60", limit_s=1.0)
    laboratory = build(environment=section.model_dump(exclude_none=True)).start()
    release = laboratory.rig.valve.release
    seen: list[bool] = []

    def spy(*permitted: Callable[[], bool]) -> object:
        seen.append(is_gone(int(pids.read_text())))
        return release(*permitted)

    laboratory.rig.valve.release = spy  # type: ignore[method-assign, assignment]
    assert laboratory.drop().state == "stored"
    assert seen == [True]


def test_an_abort_while_the_command_hangs_ends_the_drop_at_once(
    tmp_path: Path, build: Callable[..., Laboratory]
) -> None:
    """The valve never opens, the abort does not wait for the command, and the command is gone."""
    pids = tmp_path / "pids"
    section = from_script(tmp_path, f"echo $$ > {pids}; sleep 60", limit_s=50.0)
    laboratory = build(environment=section.model_dump(exclude_none=True)).start()
    opened: list[int] = []
    release = laboratory.rig.valve.release
    laboratory.rig.valve.release = lambda *a: (opened.append(1), release(*a))[1]  # type: ignore[method-assign]
    drop = laboratory.service.request_drop(request(), owner="ab")
    laboratory.wait_for(lambda: pids.exists() and pids.read_text().endswith("\n"))
    laboratory.wait_for(
        lambda: "waits for temperature and humidity" in laboratory.service.status().sentence
    )
    assert laboratory.state is State.CHECKING
    report = laboratory.service.abort(by="cd")
    assert report.aborted
    ended = laboratory.service.wait(drop.number, 20.0)
    assert ended.state == "aborted"
    assert ended.problem is not None
    assert "waits for temperature and humidity" in ended.problem.detail
    laboratory.wait_for(lambda: is_gone(int(pids.read_text())))
    assert opened == []
    # The rig is free for the next one.
    assert laboratory.service.wait_ready(20.0)
