"""The clock jumps, summer time begins and ends, the timer fires twice or was off."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from datetime import UTC, datetime, timedelta, tzinfo
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from impactd.acquisition import preflight
from impactd.storage import timestamp

from .daemon_here import DaemonHere, daemon_here
from .daemon_process import until

SYSTEMD = Path(__file__).parents[3] / "systemd"
PLAN = [{"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.02, "repeats": 2}]
HOUR = timedelta(hours=1)


class Clock:
    """The wall clock of the program, as somebody or NTP sets it."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        clock = self
        self.ahead = timedelta()

        class Wall(datetime):
            @classmethod
            def now(cls, tz: tzinfo | None = None) -> Any:
                return datetime.now(tz) + clock.ahead

        patch.setattr(timestamp, "datetime", Wall)
        patch.setattr(preflight, "datetime", Wall)

    def set(self, text: str) -> None:
        """Set the clock."""
        self.ahead = datetime.fromisoformat(text).replace(tzinfo=UTC) - datetime.now(UTC)

    def slot(self) -> str:
        """Return what the unit would ask for now, by the very command of the unit."""
        unit = (SYSTEMD / "impactd-calibration.service").read_text()
        found = re.search(r'--slot "([^"]+)"', unit)
        assert found is not None
        line = found[1].replace("$$", "$").replace("%%", "%")
        now = datetime.now(UTC) + self.ahead
        line = line.replace("date --utc", f"date --utc --date=@{now.timestamp():.0f}")
        shell = ["sh", "-c", f'echo "{line}"']
        return subprocess.run(shell, capture_output=True, text=True, check=True).stdout.strip()


def _timer_fires(here: DaemonHere, clock: Clock) -> int:
    body = {"slot": clock.slot(), "plan": PLAN, "unattended": True}
    answer = here.client.post("/v1/calibrations", json=body)
    assert answer.status_code == 202, answer.text
    return int(answer.json()["number"])


def _ended(here: DaemonHere, number: int) -> None:
    until(lambda: here.get(f"/v1/calibrations/{number}")["state"], ("done", "failed").__contains__)
    here.ready()


def test_one_calibration_per_slot_whatever_the_clock_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Jumps of an hour in the middle of a run, a second firing, a machine that was off at two."""
    clock = Clock(monkeypatch)
    clock.set("2026-03-28T02:03:00")
    with daemon_here(tmp_path / "data") as here:
        first = _timer_fires(here, clock)
        clock.ahead -= HOUR  # set back during the run: it will be two o'clock again
        _ended(here, first)
        clock.ahead += HOUR
        assert _timer_fires(here, clock) == first
        clock.ahead += HOUR
        assert _timer_fires(here, clock) == first
        clock.set("2026-03-29T02:01:00")  # the night in which summer time begins
        second = _timer_fires(here, clock)
        clock.ahead += HOUR
        _ended(here, second)
        assert here.get("/v1/status")["calibration"]["word"] in ("valid", "none")
        _durations_are_sane(here)
    clock.set("2026-03-30T09:00:00")  # off at two, back at nine: Persistent= fires at once
    with daemon_here(tmp_path / "data") as here:
        third = _timer_fires(here, clock)
        assert _timer_fires(here, clock) == third
        clock.ahead -= 2 * HOUR
        _ended(here, third)
        assert _timer_fires(here, clock) == third
        runs = here.get("/v1/calibrations")["items"]
        assert sorted(run["number"] for run in runs) == [first, second, third]
        assert len({run["slot"] for run in runs}) == 3
        drops = here.get("/v1/drops?limit=200")["items"]
        # On a busy host a drop may fail and be tried once more, as the plan allows.
        assert sum(drop["state"] in ("stored", "analysed") for drop in drops) == 3 * 2
        _durations_are_sane(here)
    print("clock: 5 jumps, 3 slots fired 8 times: 3 calibrations of 2 drops, durations monotonic")


def _durations_are_sane(here: DaemonHere) -> None:
    """What is measured comes from the monotonic clock: an hour's jump would be seen in it."""
    events = here.daemon.archive.events.since(0)
    assert [event.id for event in events] == sorted(event.id for event in events)
    seen = [event.data for event in events if event.kind == "drop.stored"]
    assert seen
    for data in seen:
        assert 0 < data["record_to_stored_s"] <= data["impact_to_stored_s"] < 600
    left = [e.data["remaining_s"] for e in events if e.kind == "calibration.progress"]
    assert all(value is None or 0 < value < 600 for value in left)


def test_a_token_ends_when_the_clock_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A token of one hour is refused once the clock was set an hour ahead."""
    clock = Clock(monkeypatch)
    with daemon_here(tmp_path / "data") as here:
        secret = here.daemon.archive.tokens.create("short", "read", 1 / 24)[1]
        check = here.daemon.archive.tokens.check
        assert check(secret) is not None
        clock.ahead += HOUR + timedelta(seconds=1)
        assert check(secret) is None


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("day", ["2026-03-27", "2026-10-23"])
def test_the_timer_fires_once_a_night_through_summer_time(day: str) -> None:
    """Five nights around each change of the clocks, in Berlin: 24 h apart, five slots."""
    timer = (SYSTEMD / "impactd-calibration.timer").read_text()
    calendar = re.search(r"^OnCalendar=(.+)$", timer, re.MULTILINE)
    assert calendar is not None
    done = subprocess.run(
        [
            "systemd-analyze", "calendar", "--iterations=5",
            f"--base-time={day} 12:00:00 UTC", calendar[1],
        ],
        env={**os.environ, "TZ": "Europe/Berlin", "LC_ALL": "C"},
        capture_output=True,
        text=True,
        check=True,
    )  # fmt: skip
    fired = re.findall(r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d) UTC", done.stdout)
    moments = sorted({datetime.fromisoformat(text) for text in fired})
    assert len(moments) == 5, done.stdout
    assert {b - a for a, b in pairwise(moments)} == {24 * HOUR}
    assert len({one.date() for one in moments}) == 5
