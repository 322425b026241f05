"""Closing the loop through the API: ask, watch, read, cancel, and use what was found."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import signal
import subprocess
import sys

import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect

from .conftest import until

ENDED = ("done", "failed", "cancelled")


@pytest.fixture(scope="module")
def shots(rig, tmp_path_factory):
    """Eight imported shots through a coupler that forgets within 5 ms."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        effects=(make_effect("coupler_highpass", {"time_constant_s": 5e-3}),),
    )
    folder = tmp_path_factory.mktemp("leaky")
    path = write_campaign_folder(folder, simulate_campaign(settings, 3))
    return list(rig.daemon.archive.import_campaign(path).numbers)


@pytest.fixture(scope="module")
def diagnosis(rig, shots):
    """A diagnosis that has ended."""
    answer = rig.operator.post("/v1/diagnoses", json={"shots": shots})
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == answer.json()["links"]["self"]
    return until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ENDED,
        limit_s=200,
    )


def test_a_diagnosis_names_the_effect(diagnosis, shots):
    """The result is the same JSON as offline, with the shots it rests on."""
    assert diagnosis["state"] == "done", diagnosis["reason"]
    result = diagnosis["result"]
    assert result["format"] == "impactd-diagnosis/1"
    assert diagnosis["verdict"] == result["verdict"] == "identified"
    assert [effect["id"] for effect in result["effects"]] == ["coupler_highpass"]
    assert result["shot_numbers"] == sorted(shots)
    assert len(result["file_sha256"]) == len(shots)


def test_it_is_kept_in_a_file_beside_the_shots(rig, diagnosis):
    """A lost index takes no diagnosis with it: the file has result, page and named model."""
    store = rig.daemon.archive.diagnoses
    record = store.read(store.path(diagnosis["id"]))
    assert record["job"]["result"]["diagnosis"]["verdict"] == diagnosis["verdict"]
    assert "<html" in record["job"]["result"]["report_html"]
    named = record["named_model"]
    assert {"name": named["name"], "version": named["version"]} == diagnosis["model"]


def test_its_page_shows_in_a_browser_and_fetches_nothing(rig, diagnosis):
    """The page may use its own style and pictures, and nothing else."""
    answer = rig.reader.get(diagnosis["links"]["report"])
    assert answer.headers["content-type"].startswith("text/html")
    assert "img-src data:" in answer.headers["content-security-policy"]
    assert "coupler_highpass" in answer.text


def test_diagnoses_are_listed_without_their_bulk(rig, diagnosis):
    """A list is short."""
    items = rig.reader.get("/v1/diagnoses").json()["items"]
    (mine,) = [item for item in items if item["id"] == diagnosis["id"]]
    assert mine["verdict"] == "identified"
    assert mine.get("result") is None


def test_the_accepted_model_is_named_and_later_fits_use_it(rig, diagnosis, shots):
    """It has a version and says where it is from; once active, a new fit carries both."""
    assert diagnosis["model"] == {"name": "kv2+coupler_highpass", "version": 1}
    models = rig.reader.get("/v1/models").json()["items"]
    (named,) = [model for model in models if model["name"] == "kv2+coupler_highpass"]
    assert named["provenance"]["diagnosis"] == diagnosis["id"]
    assert named["provenance"]["shots"] == sorted(shots)
    chosen = rig.admin.put("/v1/models/active", json={"name": "kv2+coupler_highpass"}).json()
    try:
        assert (chosen["active"], chosen["active_version"]) == ("kv2+coupler_highpass", 1)
        body = {"shots": shots[:1], "model": "kv2+coupler_highpass"}
        fit = rig.operator.post("/v1/fits", json=body).json()
        done = until(
            lambda: rig.reader.get(fit["links"]["self"]).json(),
            lambda found: found["state"] in ENDED,
        )
        assert done["state"] == "done", done["reason"]
        (one,) = done["fits"]
        assert one["result"]["model_version"] == 1
        assert one["result"]["chi2_per_dof"] == pytest.approx(1.0, abs=0.2)
        number = rig.drop().json()["number"]
        rig.ended(number, ("analysed", "failed", "aborted", "interrupted"))
        shot = rig.reader.get(f"/v1/shots/{number}").json()
        assert {fit["model"] for fit in shot["fits"]} == {
            "hsd",
            "kv",
            "kv2",
            "kv2+coupler_highpass",
        }
    finally:
        rig.admin.put("/v1/models/active", json={"name": "kv2"})


def test_a_model_nobody_found_cannot_be_chosen(rig):
    """A name of library effects is no model before a diagnosis has accepted it."""
    put = rig.admin.put
    assert put("/v1/models/active", json={"name": "kv+echo"}).status_code == 404
    assert put("/v1/models/active", json={"name": "kv", "version": 3}).status_code == 422
    assert put("/v1/models/active", json={"name": "kv+magic"}).status_code == 422


def test_a_running_diagnosis_can_be_cancelled(rig, shots):
    """DELETE ends it within moments; the worker is there for the next job."""
    made = rig.operator.post("/v1/diagnoses", json={"shots": shots}).json()
    waiting = rig.operator.post("/v1/diagnoses", json={"shots": shots}).json()
    at = made["links"]["self"]
    until(lambda: rig.reader.get(at).json(), lambda found: found["state"] != "queued")
    assert rig.operator.delete(waiting["links"]["self"]).json()["state"] == "cancelled"
    assert rig.operator.delete(at).status_code == 202
    ended = until(lambda: rig.reader.get(at).json(), lambda found: found["state"] in ENDED)
    assert ended["state"] in ("cancelled", "done")
    assert rig.reader.get(f"{at}/report.html").status_code == (
        404 if ended["state"] == "cancelled" else 200
    )


def test_what_is_no_diagnosis_is_not_found(rig, shots):
    """A number of nothing, or of a fit, is 404; an unknown shot or base is refused."""
    fit = rig.operator.post("/v1/fits", json={"shots": shots[:1]}).json()
    assert rig.reader.get("/v1/diagnoses/999999").status_code == 404
    assert rig.reader.get(f"/v1/diagnoses/{fit['id']}").status_code == 404
    assert rig.operator.post("/v1/diagnoses", json={"shots": [999999]}).status_code == 404
    assert rig.operator.post("/v1/diagnoses", json={"shots": shots, "base": "x"}).status_code == 422


def diagnose(rig, *words, **options):
    """Start `impactd diagnose` against the daemon."""
    return subprocess.Popen(
        [sys.executable, "-m", "impactd", "diagnose", *map(str, words)],
        env={**os.environ, "IMPACTD_URL": rig.url, "IMPACTD_TOKEN": rig.token("operate")},
        stdout=subprocess.PIPE,
        text=True,
        # whoever started the tests in the background may have told them to ignore Ctrl-C
        preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
        **options,
    )


def shown(terminal: int, wanted: str = "") -> str:
    """Return what a terminal showed until it showed what was wanted, or to its end."""
    seen = ""
    while not wanted or wanted not in seen:
        try:
            seen += os.read(terminal, 4096).decode()
        except OSError:  # the other side has gone
            break
    return seen


def test_the_command_line_has_the_daemon_do_it_and_shows_how_far(rig, shots, tmp_path):
    """Shots by number: progress on the terminal, then summary, JSON and page as offline."""
    terminal, other_side = os.openpty()
    out, page = tmp_path / "found.json", tmp_path / "page.html"
    command = diagnose(rig, *shots, "--json", out, "--report", page, stderr=other_side)
    os.close(other_side)
    told = shown(terminal)
    os.close(terminal)
    printed, _ = command.communicate(timeout=200)
    assert command.returncode == 0, told
    assert "running, " in told
    assert " of 9)" in told  # which step of the method
    assert "%" in told
    assert printed.startswith("IDENTIFIED")
    found = json.loads(out.read_text())
    assert found["shot_numbers"] == sorted(shots)
    assert page.read_text().startswith("<!doctype html>")


def test_with_a_budget_the_daemon_gives_the_best_verdict_so_far(rig, shots):
    """It reaches the worker; the result says that it is one, and so does its page."""
    body = {"shots": shots, "budget_s": 0.001}
    made = rig.operator.post("/v1/diagnoses", json=body).json()
    done = until(
        lambda: rig.reader.get(made["links"]["self"]).json(),
        lambda found: found["state"] in ENDED,
        limit_s=200,
    )
    assert done["state"] == "done", done["reason"]
    assert done["result"]["ended_early"]["budget_s"] == 0.001
    assert done["verdict"] == "unknown"
    assert done["model"] is None
    assert "best verdict after" in done["sentence"]
    assert "best verdict after" in rig.reader.get(done["links"]["report"]).text
    for refused in (0, -1, "soon"):
        body = {"shots": shots, "budget_s": refused}
        assert rig.operator.post("/v1/diagnoses", json=body).status_code == 422


def test_ctrl_c_cancels_the_diagnosis_and_says_so(rig, shots):
    """An interrupted command leaves no diagnosis running that nobody waits for."""
    terminal, other_side = os.openpty()
    command = diagnose(rig, *shots, stderr=other_side)
    os.close(other_side)
    shown(terminal, "diagnosis")  # queued or running; a second later it may have ended
    command.send_signal(signal.SIGINT)
    told = shown(terminal)
    os.close(terminal)
    command.communicate(timeout=60)
    assert command.returncode == 1, told
    assert "was cancelled" in told
    assert "Traceback" not in told
    ended = until(
        lambda: rig.reader.get("/v1/diagnoses").json()["items"][0],
        lambda found: found["state"] in ENDED,
    )
    assert ended["state"] == "cancelled"


def test_shots_that_are_not_there_are_one_sentence_and_a_pipe_stays_quiet(rig):
    """An unknown number fails with the daemon's own words, without progress in between."""
    command = diagnose(rig, 999999, stderr=subprocess.PIPE)
    _, said = command.communicate(timeout=60)
    assert command.returncode == 1
    assert said.count("\n") == 1
    assert "999999" in said
