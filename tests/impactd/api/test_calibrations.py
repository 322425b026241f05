"""Calibrations over HTTP: a series of drops, once per slot."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from impactd.cli import app
from impactd.console.calibration_chart import history, history_table
from impactd.data_lock import read_holder
from tests.simulated_rig import write_simulated_rig

from .conftest import until

PLAN = [
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.025, "repeats": 1},
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.045, "repeats": 1},
]


@pytest.fixture(scope="module")
def calibration(rig):
    """One calibration run that has ended."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    answer = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "test-slot"})
    assert answer.status_code == 202, answer.text
    until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed"),
    )
    return rig.reader.get(answer.headers["location"]).json()


def test_a_calibration_runs_its_plan_and_becomes_the_current_one(rig, calibration):
    """Every planned drop is made and belongs to the run; the result is in force with a date."""
    assert calibration["state"] == "done", calibration["problem"]
    assert len(calibration["drops"]) == 2
    for number in calibration["drops"]:
        drop = rig.reader.get(f"/v1/drops/{number}").json()
        assert drop["calibration"] == calibration["number"]
    current = rig.reader.get("/v1/calibrations/current").json()
    assert current["number"] == calibration["number"]
    assert current["valid_until_utc"] > current["finished_utc"]
    assert rig.reader.get("/v1/calibrations").json()["items"][0] == calibration


CERTIFICATE = """
[certificate]
laboratory = { name = "Impact Laboratory", city = "Braunschweig", country_code = "DE" }
customer = { name = "Impact Laboratory", city = "Braunschweig", country_code = "DE" }
responsible = "A. Person"
role = "head of the laboratory"
performance_location = "laboratory"
cell_manufacturer = "Cell Works"
cell_model = "LC 201"
"""


def test_a_calibration_of_drops_becomes_a_certificate(rig, calibration, tmp_path):
    """Beside the running daemon; the drops must be of the cell that the settings name."""
    other_cell = {'serial_number = "simulated"': 'serial_number = "SN 2"'}
    config = write_simulated_rig(tmp_path, changes=other_cell, more=CERTIFICATE)
    words = ["certificate", "write", str(calibration["number"]), "--identifier", "1"]
    words += ["--data", str(rig.daemon.archive.directory), "--config", str(config)]

    refused = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "no.xml")])
    assert "is of the cell simulated" in str(refused.exception)

    write_simulated_rig(tmp_path, more=CERTIFICATE)
    made = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "yes.xml")])
    assert made.exit_code == 0, made.output
    read = CliRunner().invoke(app, ["certificate", "read", str(tmp_path / "yes.xml"), "--json"])
    gain = calibration["result"]["hsd"]["gain_N_per_V"]
    assert json.loads(read.output)["values"]["hsd_n_per_v"]["u"] == pytest.approx(gain["u"], 1e-3)


def test_a_slot_never_runs_twice(rig, calibration):
    """The timer may ring again: the same slot gives the old run; another plan is a conflict."""
    again = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "test-slot"})
    assert again.status_code == 202
    assert again.json()["number"] == calibration["number"]
    other = rig.operator.post("/v1/calibrations", json={"plan": PLAN[:1], "slot": "test-slot"})
    assert other.status_code == 409
    assert other.json()["type"] == "urn:impactd:problem:idempotency-conflict"


def test_a_run_without_slot_or_key_is_refused(rig):
    """A series of drops is physical: something must say that it was asked for once."""
    answer = rig.operator.post("/v1/calibrations", json={})
    assert answer.status_code == 400
    assert answer.json()["type"] == "urn:impactd:problem:idempotency-key-missing"


def test_only_references_calibrate(rig, calibration):
    """A specimen of unknown modulus cannot carry a calibration."""
    plan = [{"sphere": "acetal", "surface": "specimen", "drop_height_m": 0.03, "repeats": 1}]
    answer = rig.operator.post("/v1/calibrations", json={"plan": plan, "slot": "wrong"})
    assert answer.status_code == 409
    assert answer.json()["type"] == "urn:impactd:problem:not-ready"
    assert "specimen" in answer.json()["detail"]


def test_the_data_directory_says_who_serves_it(rig):
    """The lock names process and address while the daemon runs."""
    holder = read_holder(rig.daemon.archive.directory)
    assert holder["url"] == rig.url


WEIGHTS = {
    "method": "static_weights",
    "readings": [
        {"mass_kg": m, "volts": 0.01 + m * 9.80665 / 1780.0 + wiggle, "u_volts": 1e-6}
        for m, wiggle in ((0.0, 4e-7), (0.2, -6e-7), (0.5, 2e-7), (1.0, -1e-7))
    ],
    "hold_time_s": 2.0,
    "discharge_time_constant_s": 1e6,
}


def weigh(rig, body, key):
    """Send readings of weights."""
    return rig.operator.post("/v1/calibrations", json=body, headers={"Idempotency-Key": key})


def test_weights_give_a_gain_of_their_own_kind(rig, calibration):
    """Readings become a record with S, beside the calibration with drops and not in its place."""
    answer = weigh(rig, WEIGHTS, "weights-1")
    assert answer.status_code == 202, answer.text
    found = rig.reader.get(answer.headers["location"]).json()
    assert (found["kind"], found["state"]) == ("static_weights", "done")
    gain = found["result"]["hsd"]["gain_N_per_V"]
    assert abs(gain["value"] - 1780.0) < 3 * gain["u"]
    assert found["result"]["against"]["calibration"] == calibration["number"]
    current = rig.reader.get("/v1/calibrations/current").json()
    assert current["number"] == calibration["number"]
    assert current["kind"] == "drops"
    assert weigh(rig, WEIGHTS, "weights-1").json()["number"] == found["number"]


def test_discharged_weights_are_kept_with_their_warning(rig):
    """A reading of which nothing is left gives a record without a gain, and says why."""
    answer = weigh(rig, {**WEIGHTS, "discharge_time_constant_s": 0.5}, "weights-2")
    result = answer.json()["result"]
    assert result["outcome"]["status"] == "meaningless"
    assert result["hsd"] is None
    assert "Meaningless" in result["warnings"][0]


@pytest.mark.parametrize(
    "wrong",
    [
        {"readings": None},
        {"hold_time_s": None},
        {"readings": [{"mass_kg": -1.0, "volts": 0.0}, {"mass_kg": 1.0, "volts": 0.0}]},
        {"method": "drops"},
        {"plan": PLAN},
        {"readings": [{"mass_kg": 1.0, "volts": 0.0, "u_volts": 1e-3}] * 2},
    ],
)
def test_weights_that_fix_nothing_are_refused(rig, wrong):
    """Missing or impossible readings are refused with a problem, and nothing is stored."""
    before = rig.reader.get("/v1/calibrations").json()["items"][0]["number"]
    answer = weigh(rig, {**WEIGHTS, **wrong}, "weights-3")
    assert answer.status_code in {400, 422}, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert rig.reader.get("/v1/calibrations").json()["items"][0]["number"] == before


def test_the_list_shows_the_series_and_its_drift(rig, calibration, tmp_path, monkeypatch):
    """A second run on the same rig stands in the series with its drift, in a table and a chart."""
    answer = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "second-slot"})
    assert answer.status_code == 202, answer.text
    second = until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed"),
    )
    assert second["state"] == "done", second["problem"]
    series = rig.reader.get("/v1/calibrations").json()["series"]
    assert [entry["number"] for entry in series] == [calibration["number"], second["number"]]
    assert series[0]["since_previous"] is None
    moved = series[1]["since_previous"]["combinations"]
    assert set(moved) == {"gain_N_per_V", "natural_frequency_Hz", "damping_ratio"}
    assert all(one["common_cancels"] for one in moved.values())
    assert "bounce 1" in " ".join(second["result"]["shots"])
    monkeypatch.setenv("IMPACTD_TOKEN", rig.token("read"))
    chart = tmp_path / "drift.png"
    history(chart=chart, url=rig.url, as_json=False)
    assert chart.read_bytes().startswith(b"\x89PNG")
    assert "combined standard uncertainties" in history_table(series)
