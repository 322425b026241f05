"""What the page is made of, and what it asks for."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from impactd.api.routes.page import POLICY
from impactd.jobs.curves import packed, samples_of
from impactd.page.files import PLOTLY_NAME, STATIC, page_files


def test_the_page_is_served_with_a_strict_policy(rig):
    """Scripts and styles from this daemon only; nothing inline, nothing framed."""
    answer = rig.anybody.get("/")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-security-policy"] == POLICY
    assert "unsafe" not in POLICY
    assert "http" not in POLICY


def test_every_file_is_served_and_asked_for_again_only_when_it_changed(rig):
    """The right type, and a 304 for whoever has it already."""
    types = {
        ".css": "text/css",
        ".html": "text/html",
        ".js": "text/javascript",
        ".svg": "image/svg+xml",
    }
    for name, file in page_files().items():
        if name == "index.html":
            continue
        answer = rig.anybody.get(f"/page/{name}")
        assert answer.status_code == 200, name
        assert answer.headers["content-type"].startswith(types[file.path.suffix])
        again = rig.anybody.get(f"/page/{name}", headers={"If-None-Match": answer.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")
    assert PLOTLY_NAME in page_files()


@pytest.mark.parametrize("name", ["css/nothing.css", "css/..%2f..%2ffiles.py", "../files.py"])
def test_nothing_but_the_page_is_served(rig, name):
    """Only what is in the list, whatever a path says."""
    assert rig.anybody.get(f"/page/{name}").status_code in (401, 404)


def test_no_file_of_the_page_names_another_host():
    """Nothing is fetched from elsewhere; names of namespaces are no addresses."""
    for file in STATIC.rglob("*"):
        if file.is_file():
            text = file.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
            assert "http://" not in text, file
            assert "https://" not in text, file


def test_the_rig_says_what_may_be_asked_of_it(rig):
    """Names as a drop takes them, limits in metres."""
    found = rig.reader.get("/v1/rig").json()
    assert {"name": "aluminium", "reference": True} in found["surfaces"]
    acetal = next(one for one in found["spheres"] if one["name"] == "acetal")
    assert acetal["diameter_m"] == pytest.approx(0.00952)
    assert found["min_drop_height_m"] < found["max_drop_height_m"]
    assert sum(one["repeats"] for one in found["calibration_plan"]) == 8


def test_a_curve_is_kept_to_a_step_that_nobody_sees():
    """Half a step off at most, a fifth of the size of text, also for nothing at all."""
    time = np.linspace(0.0, 1.0, 3000)
    curve = 3.8 * np.exp(-((time - 0.3) ** 2) / 0.001) + 0.01 * np.sin(200 * time)
    kept = packed(curve, first=17)
    assert np.abs(samples_of(kept) - curve).max() <= 0.51 * kept["step"]
    assert len(kept["differences"]) < 4 * curve.size
    assert samples_of(packed(np.zeros(4), first=0)).tolist() == [0.0, 0.0, 0.0, 0.0]


def test_curves_lie_over_the_trace(rig, shot):
    """All models, at the samples' own times; what the closed KV leaves is the noise."""
    number = shot["number"]
    found = rig.reader.get(f"/v1/shots/{number}/curves").json()
    assert {one["model"] for one in found["items"]} == {"hsd", "kv", "kv2"}
    assert found["missing"] == []
    kv = next(one for one in found["items"] if one["model"] == "kv2")
    last_s = kv["start_s"] + kv["interval_s"] * (len(kv["signal"]) - 1)
    query = {"points": 4000, "start_s": kv["start_s"], "stop_s": last_s}
    trace = rig.reader.get(f"/v1/shots/{number}/trace", params=query).json()
    assert not trace["decimated"]
    left = np.array(trace["signal"]) - np.array(kv["signal"])
    fit = next(one for one in shot["fits"] if one["model"] == "kv2")
    assert left.std() == pytest.approx(fit["result"]["rms"], rel=0.02)
    assert "curve" not in fit["result"]


def test_a_shot_goes_into_a_spreadsheet(rig, shot):
    """Every sample with its time from the trigger, under a heading with the unit."""
    answer = rig.reader.get(f"/v1/shots/{shot['number']}.csv")
    assert answer.headers["content-disposition"].endswith('.csv"')
    rows = list(csv.reader(answer.text.splitlines()))
    assert rows[0] == ["time_s", "volts"]
    assert len(rows) == shot["samples"] + 1
    assert float(rows[1 + shot["trigger_index"]][0]) == 0.0


def test_shots_are_found_by_words_and_come_with_their_advice(rig, shot):
    """Part of a material in any case, the operator, the number; nothing for anything else."""
    for search in ("ACET", "lumini", "ab", str(shot["number"])):
        found = rig.reader.get("/v1/shots", params={"search": search, "summary": True}).json()
        one = next(item for item in found["items"] if item["number"] == shot["number"])
        now = rig.reader.get(f"/v1/shots/{shot['number']}").json()  # it may be fitted anew
        assert (one["advice"], one["because"]) == (now["advice"], now["because"])
        assert one["reduced_modulus_Pa"]["value"] > 0
    for search in ("unobtainium", "%", "'"):
        assert rig.reader.get("/v1/shots", params={"search": search}).json()["items"] == []
