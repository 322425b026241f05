"""Alarms and the log: what went wrong until it was seen, and who asked for what."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from impactd.alarms import Alarms, alarm_words, guidance_of
from impactd.api.audit import REQUEST
from impactd.console.tables import WIDTH
from impactd.events import EventBus
from impactd.storage.archive import Archive
from tests.impactd.api.conftest import until

LOST = {"detail": "The digitizer was unplugged.", "remedy": "Plug it in."}


def _open(rig):
    """Return the open alarms of the device that these tests lose."""
    found = rig.reader.get("/v1/alarms").json()["open"]
    return [alarm for alarm in found if alarm["sentence"] == LOST["detail"]]


@pytest.fixture
def raised(rig):
    """An open alarm."""
    rig.daemon.alarms.publish("rig.fault", LOST)
    (alarm,) = _open(rig)
    yield alarm
    rig.operator.post(f"/v1/alarms/{alarm['id']}/acknowledge")


def test_an_alarm_says_what_happened_and_what_to_do(raised):
    """In the words of the fault; the steps of guidance begin with its remedy."""
    assert raised["guidance"][0] == LOST["remedy"]
    assert raised["severity"] == "major"
    assert raised["sentence"] == LOST["detail"]
    assert raised["remedy"] == LOST["remedy"]
    assert raised["acknowledged_utc"] is None


def status(rig, *options, **environment):
    """Return what `impactd status` prints."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith("IMPACTD_")}
    return subprocess.run(
        [sys.executable, "-m", "impactd", "status", *options],
        env={**clean, "IMPACTD_URL": rig.url, **environment},
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def test_the_terminal_shows_open_alarms_with_their_guidance(rig, raised):
    """Sentence and numbered steps, as the page has them; the same in the JSON."""
    token = {"IMPACTD_TOKEN": rig.token("read")}
    said = status(rig, **token)
    assert f"Alarm {raised['id']} (major, since {raised['first_utc'][:16]} UTC)" in said
    assert LOST["detail"] in said
    plain = " ".join(said.split())
    for number, step in enumerate(raised["guidance"], 1):
        assert f"{number}. {step}" in plain
    assert raised in json.loads(status(rig, "--json", **token))["alarms"]
    assert max(map(len, said.splitlines()[1:])) <= WIDTH


def test_without_a_token_the_terminal_says_why_it_shows_no_alarm(rig, raised):
    """The status is for everybody on the rig's computer; null is not none."""
    assert "Open alarms are shown to a token" in status(rig)
    assert json.loads(status(rig, "--json"))["alarms"] is None
    assert raised["sentence"] not in status(rig)


def test_the_terminal_begins_with_the_most_severe_alarm(rig, raised):
    """A later minor one stands below it, as on the page."""
    rig.daemon.alarms.publish("environment.unknown", {"detail": "No file.", "remedy": "Mend it."})
    said = status(rig, IMPACTD_TOKEN=rig.token("read"))
    assert 0 < said.index("(major") < said.index("(minor")


def test_a_flapping_device_is_one_alarm(rig, raised):
    """The same words again are counted, not listed again."""
    rig.daemon.alarms.publish("rig.fault", LOST)
    (alarm,) = _open(rig)
    assert (alarm["id"], alarm["times"]) == (raised["id"], 2)


def test_an_alarm_stays_until_it_is_acknowledged_and_keeps_by_whom(rig, raised):
    """The first acknowledgement counts; the same fault afterwards is a new alarm."""
    at = f"/v1/alarms/{raised['id']}/acknowledge"
    assert rig.reader.post(at).status_code == 403
    first = rig.operator.post(at).json()
    assert first["acknowledged_by"] == "operate token"
    assert rig.admin.post(at).json() == first
    assert _open(rig) == []
    assert rig.reader.get("/v1/alarms").json()["acknowledged"][0] == first
    rig.daemon.alarms.publish("rig.fault", LOST)
    (again,) = _open(rig)
    assert again["id"] != raised["id"]
    rig.operator.post(f"/v1/alarms/{again['id']}/acknowledge")


def test_an_alarm_that_is_not_there_is_a_404(rig):
    """As a problem."""
    assert rig.operator.post("/v1/alarms/999999/acknowledge").status_code == 404


def test_alarms_outlive_the_daemon(tmp_path):
    """They are in the archive, not in the memory of a process."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        Alarms(EventBus(archive.events), archive.alarms).publish("rig.fault", LOST)
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert [alarm.sentence for alarm in archive.alarms.open()] == [LOST["detail"]]
    Archive.reindex(tmp_path)
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        assert len(archive.alarms.open()) == 1


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("drop.stored", {"number": 1}),
        ("drop.failed", {"number": 1, "type": "no-impact", "detail": "", "remedy": ""}),
        ("calibration.failed", {"number": 1, "type": "aborted", "reason": ""}),
        ("job.failed", {"kind": "calibrate", "subject": "", "reason": ""}),
    ],
)
def test_what_whoever_asked_is_told_anyway_is_no_alarm(kind, data):
    """A missed trigger, an abort, and the second word about one failure."""
    assert alarm_words(kind, data) is None


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("drop.interrupted", {"number": 7}),
        ("drop.failed", {"number": 7, "type": "disk-full", "detail": "Full.", "remedy": "Free."}),
        ("calibration.failed", {"number": 7, "reason": "It did not converge."}),
        ("job.failed", {"kind": "fit_shot", "subject": "shot 7", "reason": "It crashed."}),
        ("job.lost", {"shot": 7, "detail": "Full."}),
    ],
)
def test_what_reaches_beyond_one_request_is_an_alarm(kind, data):
    """It names its number and says what to do."""
    sentence, remedy = alarm_words(kind, data)
    assert "7" in sentence
    assert remedy
    assert guidance_of(kind, "")


def test_every_write_is_in_the_log_with_its_caller(rig):
    """Who, what, and what came of it, refused or not; a stranger's request changed nothing."""
    assert rig.operator.post("/v1/abort").status_code == 200
    assert rig.reader.post("/v1/abort").status_code == 403
    assert rig.anybody.post("/v1/abort").status_code == 401

    def told():
        return [
            (item["data"]["by"], item["data"]["path"], item["data"]["status"])
            for item in rig.reader.get("/v1/log", params={"about": "people"}).json()["items"][:3]
        ]

    wanted = {("operate token", "/v1/abort", 200), ("read token", "/v1/abort", 403)}
    assert wanted <= set(until(told, lambda seen: wanted <= set(seen)))


def test_the_log_is_paged_newest_first(rig):
    """Each page leads to the next, and the numbers fall."""
    for _ in range(3):
        rig.daemon.bus.publish(REQUEST, {"by": "x", "method": "POST", "path": "/", "status": 200})
    page = rig.reader.get("/v1/log", params={"about": "people", "limit": 2}).json()
    following = rig.reader.get(page["next"]).json()
    numbers = [item["id"] for item in (*page["items"], *following["items"])]
    assert numbers == sorted(set(numbers), reverse=True)
    assert {item["kind"] for item in following["items"]} == {REQUEST}
