"""Temperature and humidity of a drop over HTTP and from the command line."""

from __future__ import annotations

import json
import subprocess
import sys
import uuid
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from impactd.settings.sections import EnvironmentSection
from impactd.storage.archive import Archive
from impactd.storage.exchange import export_shots

from .conftest import ACETAL_ON_ALUMINIUM, run_daemon, simulated_settings, until

READ = {
    "temperature_C": {"value": 21.3, "u": 0.2},
    "relative_humidity": {"value": 0.45, "u": 0.02},
}
WARM = ACETAL_ON_ALUMINIUM | {"environment": READ}


def wait_ready(rig):
    """Wait until a drop may be asked for."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])


def stored_shot(rig, number):
    """Return the shot of a drop once it is stored."""
    drop = rig.ended(number)
    assert drop["shot"] == number, drop
    return rig.reader.get(f"/v1/shots/{number}").json()


def test_the_technicians_reading_is_kept_and_shown(rig, tmp_path):
    """Drop, shot, list of shots, file and exported campaign all say it."""
    wait_ready(rig)
    answer = rig.drop(WARM)
    assert answer.status_code == 202, answer.text
    number = answer.json()["number"]
    assert answer.json()["environment"] == READ
    assert stored_shot(rig, number)["environment"] == READ
    listed = rig.reader.get("/v1/shots").json()["items"]
    assert next(one for one in listed if one["number"] == number)["environment"] == READ
    (tmp_path / "shot.h5").write_bytes(rig.reader.get(f"/v1/shots/{number}.h5").content)
    with h5py.File(tmp_path / "shot.h5") as file:
        around = file["entry/environment"]
        assert around["temperature"][()] == 21.3
        assert around["temperature"].attrs["units"] == "degC"
        assert around["relative_humidity_uncertainty"][()] == 0.02
    export_shots([rig.daemon.archive.read_shot(number)], "campaign", tmp_path / "out")
    campaign = json.loads((tmp_path / "out" / "campaign.json").read_text())
    assert campaign["shots"][0]["environment"] == READ


def test_a_drop_of_which_nothing_is_said_has_none(rig, shot):
    """Null, not a made-up number."""
    assert shot["environment"] is None
    assert rig.reader.get(f"/v1/drops/{shot['number']}").json()["environment"] is None


def test_a_key_with_another_reading_is_a_conflict(rig):
    """The reading is a part of the request that a key belongs to; the same one is the same drop."""
    wait_ready(rig)
    key = str(uuid.uuid4())
    number = rig.drop(WARM, key=key).json()["number"]
    assert rig.drop(WARM, key=key).json()["number"] == number
    warmer = READ | {"temperature_C": {"value": 21.4, "u": 0.2}}
    for body in (ACETAL_ON_ALUMINIUM, ACETAL_ON_ALUMINIUM | {"environment": warmer}):
        answer = rig.drop(body, key=key)
        assert answer.status_code == 409
        assert answer.json()["type"] == "urn:impactd:problem:idempotency-conflict"
    rig.ended(number)


@pytest.mark.parametrize(
    ("around", "pointer", "words"),
    [
        ({"temperature_C": 21.3}, "#/environment/temperature_C", "standard uncertainty"),
        ({"temperature_C": {"value": 21.3}}, "#/environment/temperature_C/u", "required"),
        (
            {"temperature_C": {"value": -300, "u": 1}},
            "#/environment/temperature_C/value",
            "greater than or equal to -273.15",
        ),
        (
            {"relative_humidity": {"value": 45, "u": 2}},
            "#/environment/relative_humidity/value",
            "less than or equal to 1",
        ),
        (
            {"relative_humidity": {"value": 0.45, "u": 0}},
            "#/environment/relative_humidity/u",
            "greater than or equal to 0.000000000001",
        ),
        (
            {"temperature_C": {"value": 21.3, "u": 1e-14}},
            "#/environment/temperature_C/u",
            "greater than or equal to 0.000000005",
        ),
        ({"temperature_K": {"value": 294, "u": 1}}, "#/environment/temperature_K", "not permitted"),
    ],
)
def test_what_no_room_has_is_refused_in_words(rig, around, pointer, words):
    """The place, what was given and what is allowed; nothing is dropped."""
    answer = rig.drop(ACETAL_ON_ALUMINIUM | {"environment": around})
    assert answer.status_code == 422
    assert answer.json()["type"] == "urn:impactd:problem:invalid"
    assert answer.json()["errors"][0]["pointer"] == pointer
    assert words in answer.json()["detail"]


def command(rig, *words):
    """Run `impactd drop`."""
    return subprocess.run(
        [sys.executable, "-m", "impactd", "drop", *words, "--url", rig.url],
        env={"PATH": "/usr/bin:/bin", "IMPACTD_TOKEN": rig.token("operate")}
        | {"PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_command_line_gives_readings_with_their_uncertainty(rig):
    """A value without its u, and a u without its value, are wrong usage."""
    wait_ready(rig)
    words = ("acetal", "aluminium", "0.03", "--json", "--no-wait")
    reading = ("--temperature", "21.3", "--temperature-u", "0.2")
    made = command(rig, *words, *reading, "--humidity", "0.45", "--humidity-u", "0.02")
    assert made.returncode == 0, made.stderr
    drop = json.loads(made.stdout)
    assert drop["environment"] == READ
    rig.ended(drop["number"])
    bare = command(rig, *words, "--temperature", "21.3")
    assert bare.returncode == 2
    assert "add" in bare.stderr
    assert "--temperature-u" in bare.stderr
    alone = command(rig, *words, "--humidity-u", "0.02")
    assert alone.returncode == 2
    assert "--humidity, which" in " ".join(alone.stderr.replace("│", " ").split())


@pytest.fixture
def sensor(tmp_path):
    """A daemon whose settings name a file that nobody has written yet."""
    settings = simulated_settings(tmp_path / "data")
    around = EnvironmentSection(file=tmp_path / "now.json", max_age_s=3600.0)
    yield from run_daemon(settings.model_copy(update={"environment": around}))


def test_a_sensor_that_is_away_is_an_alarm_and_no_obstacle(sensor, tmp_path):
    """Drops go on without a reading; one alarm counts them. Once it writes, it is read."""
    for _ in range(2):
        wait_ready(sensor)
        shot = stored_shot(sensor, sensor.drop().json()["number"])
        assert shot["environment"] is None
    (alarm,) = until(
        lambda: sensor.reader.get("/v1/alarms").json()["open"],
        lambda found: found and found[0]["times"] == 2,
    )
    assert alarm["kind"] == "environment.unknown"
    assert "now.json" in alarm["sentence"]
    (tmp_path / "now.json").write_text(json.dumps(READ))
    wait_ready(sensor)
    number = sensor.drop().json()["number"]
    assert stored_shot(sensor, number)["environment"] == READ
    # The request said nothing; what the sensor said belongs to the shot.
    assert sensor.reader.get(f"/v1/drops/{number}").json()["environment"] is None


def test_a_rebuilt_index_knows_what_was_read_and_what_was_asked(sensor, tmp_path):
    """The shot files give both back, with the journal or without."""
    wait_ready(sensor)
    key = str(uuid.uuid4())
    number = sensor.drop(WARM, key=key).json()["number"]
    stored_shot(sensor, number)
    archive = sensor.daemon.archive
    before = archive.drop(number)
    copy = tmp_path / "copy"
    (copy / "shots").mkdir(parents=True)
    file = archive.shot_path(number)
    (copy / "shots" / file.name).write_bytes(file.read_bytes())
    assert Archive.reindex(copy).shots == 1
    with Archive.open(copy, reserve_bytes=0) as rebuilt:
        assert rebuilt.shot(number).environment == archive.shot(number).environment
        assert rebuilt.drop(number).request == before.request
        found = rebuilt.drop_by_key(before.idempotency_key, before.request)
        assert found is not None
        assert replace(found, state=before.state, updated_utc=before.updated_utc) == before


@pytest.fixture
def hanging(tmp_path):
    """A daemon whose sensor's command never comes back by itself."""
    settings = simulated_settings(tmp_path / "data")
    lines = f"echo $$ > {tmp_path}/pid; exec sleep 600"
    around = EnvironmentSection(command=("sh", "-c", lines), command_limit_s=60.0)
    yield from run_daemon(settings.model_copy(update={"environment": around}))


def test_an_abort_answers_while_the_command_hangs(hanging, tmp_path):
    """The drop ends as aborted, nothing falls, and the command is gone."""
    number = hanging.drop().json()["number"]
    until(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text(), bool)
    until(
        lambda: hanging.anybody.get("/v1/status").json()["sentence"],
        lambda sentence: "waits for temperature and humidity" in sentence,
    )
    answer = hanging.operator.post("/v1/abort").json()
    assert answer["aborted"] is True
    assert answer["drop"] == number
    drop = hanging.ended(number)
    assert (drop["state"], drop["shot"]) == ("aborted", None)
    kinds = until(
        lambda: {event.kind for event in hanging.daemon.archive.events.since(0)},
        lambda told: "drop.aborted" in told,
    )
    assert not kinds & {"drop.armed", "drop.released", "environment.unknown"}
    pid = int((tmp_path / "pid").read_text())
    until(lambda: Path(f"/proc/{pid}/stat").exists(), lambda alive: not alive)
    wait_ready(hanging)
