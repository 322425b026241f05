"""Results over HTTP: pairs, control charts, selections to take away."""

from __future__ import annotations

import csv
import gzip
import hashlib
import io
import json
import math
import sys
import zipfile

import pyarrow.parquet

from impactd.reports.campaign import campaign_page
from impactd.reports.templating import gigapascals


def test_a_pair_has_mean_scatter_and_chart(rig, shot):
    """The mean is that of the moduli; the chart holds each shot with its time."""
    at = f"sphere={shot['sphere']}&surface={shot['surface']}"
    read = ["/v1/results", "/v1/moduli", f"/v1/results/chart?{at}", f"/v1/shots/{shot['number']}"]
    before = None
    while before != shot:  # a calibration may have it fitted again between two answers
        before = shot
        found, moduli, chart, shot = (rig.reader.get(path).json() for path in read)
    assert found["moduli"] == moduli["moduli"]
    pair = next(one for one in found["pairs"] if one["surface"] == shot["surface"])
    mean = moduli["pairs"][f"{pair['sphere']}/{pair['surface']}"]["reduced_modulus_Pa"]
    assert pair["reduced_modulus_Pa"] == mean
    assert shot["number"] in chart["numbers"]
    assert len(chart["numbers"]) == len(chart["reduced_modulus_Pa"]) == pair["shots"]
    at = chart["numbers"].index(shot["number"])
    fit = next(one for one in shot["fits"] if one["model"] == "kv2")
    modulus = fit["result"]["reduced_modulus_Pa"]["value"]
    assert math.isclose(chart["reduced_modulus_Pa"][at], modulus, rel_tol=1e-9)


def test_the_report_of_a_period_has_the_numbers_of_the_results(rig, shot):
    """Moduli with what was stated before, pairs, budgets: as the answers have them."""
    read = ["/v1/results", "/v1/results/report.html"]
    before = None
    while before != shot:  # a calibration may have it fitted again between two answers
        before = shot
        found, page = (rig.reader.get(path) for path in read)
        shot = rig.reader.get(f"/v1/shots/{shot['number']}").json()
    assert page.headers["content-type"].startswith("text/html")
    assert "script-src 'sha256-" in page.headers["content-security-policy"]
    found, text = found.json(), page.text
    pair = next(one for one in found["pairs"] if one["surface"] == shot["surface"])
    row = f"<td>{pair['sphere']} on {pair['surface']}</td><td>{pair['shots']}</td>"
    assert f"{row}<td>{gigapascals(pair['reduced_modulus_Pa'])}</td>" in text
    for name, one in found["moduli"].items():
        modulus = gigapascals(one["youngs_modulus_Pa"])
        assert f"<tr><td>{name}</td><td>{one['status']}</td><td>{modulus}</td>" in text
        if one["youngs_modulus_Pa"]:
            assert f"E of {name} = {modulus} GPa (95 %)" in text
        stated = one.get("stated_youngs_modulus_Pa")
        assert not stated or f"stated {gigapascals(stated)}</td>" in text
    empty = rig.reader.get("/v1/results/report.html", params={"until": "2000-01-01"})
    assert "There is no modulus yet" in empty.text
    assert "Moduli from 0 shots" in empty.text


def test_the_chart_in_a_report_marks_what_is_outside_its_limits():
    """Limits are lines, and shots beyond them have another class; two shots are no chart."""
    chart = {
        "sphere": "<b>", "surface": "specimen", "shots": 3, "decimated": False,
        "started_utc": ["2026-01-01T00:00:00Z"] * 3, "reduced_modulus_Pa": [1e9, 1e9, 2e9],
        "numbers": [1, 2, 3],
        "control": {"centre_Pa": 1.1e9, "lower_Pa": 0.9e9, "upper_Pa": 1.3e9},
    }  # fmt: skip
    pair = {
        "sphere": "<b>", "surface": "specimen", "shots": 2, "reduced_modulus_Pa": None,
        "scatter_relative": 0.01, "expected_scatter_relative": 0.01, "trend": None,
        "control": {"outside_count": 1},
    }  # fmt: skip
    found = {
        "shots": 2, "model": "kv2", "since": None, "until": None, "warnings": [], "moduli": {},
        "network": None, "pairs": [pair], "software": "impactd",
    }  # fmt: skip
    page = campaign_page(found, [chart], {"moduli": {}})
    assert page.count("<line ") == 3
    assert page.count('<circle class="outside"') == 1
    assert page.count('<circle class="inside"') == 2
    assert "<title>shot 3, 2026-01-01 00:00 UTC: 2 GPa</title>" in page
    assert "<b>" not in page
    free = {**chart, "control": None}
    assert "Limits are drawn from eight shots on." in campaign_page(found, [free], {"moduli": {}})
    few = {**free, "numbers": [1, 2]}
    page = campaign_page(found, [few], {"moduli": {}})
    assert "<circle" not in page
    assert "A pair with fewer than three shots has no chart." in page


def test_a_pair_that_was_never_dropped_is_not_found(rig, shot):
    """404 with its names."""
    answer = rig.reader.get("/v1/results/chart", params={"sphere": "a", "surface": "b"})
    assert answer.status_code == 404
    assert "'a' on 'b'" in answer.json()["detail"]


def test_a_selection_leaves_with_the_numbers_of_the_page(rig, shot):
    """CSV, packed CSV and JSON say what the shot itself says; the head tells what it is."""
    shot = rig.reader.get(f"/v1/shots/{shot['number']}").json()  # it may have been fitted again
    at = "/v1/results/export"
    number = shot["number"]
    text = rig.reader.get(at, params={"shots": str(number)}).text
    assert text.startswith("# software: impactd")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    (row,) = rows
    fit = next(one for one in shot["fits"] if one["model"] == row["model"])
    modulus = fit["result"]["reduced_modulus_Pa"]
    assert float(row["reduced_modulus_Pa"]) == modulus["value"]
    assert float(row["expanded_95_Pa"]) == modulus["expanded"]["U"]
    assert row["advice"] == shot["advice"]
    packed = rig.reader.get(at, params={"shots": str(number), "format": "csv.gz"})
    assert gzip.decompress(packed.content).decode() == text
    said = json.loads(rig.reader.get(at, params={"shots": str(number), "format": "json"}).text)
    assert said["shots"][0]["reduced_modulus_Pa"] == modulus["value"]


def test_parquet_holds_the_numbers_of_the_csv(rig, shot):
    """Typed columns with their units, the same values; a reader needs nothing of impactd."""
    at, shots = "/v1/results/export", {"shots": str(shot["number"])}
    text = rig.reader.get(at, params=shots).text
    (row,) = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    answer = rig.reader.get(at, params={**shots, "format": "parquet"})
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    table = pyarrow.parquet.read_table(io.BytesIO(answer.content))
    (found,) = table.to_pylist()
    assert {name: "" if value is None else str(value) for name, value in found.items()} == row
    assert found["shot"] == shot["number"]
    assert table.schema.field("reduced_modulus_Pa").metadata[b"unit"] == b"Pa"
    assert table.schema.metadata[b"software"].startswith(b"impactd ")


def test_without_the_extra_parquet_is_refused(rig, shot, monkeypatch):
    """One sentence says which extra is missing, and what can be had without it."""
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    at = {"shots": str(shot["number"]), "format": "parquet"}
    answer = rig.reader.get("/v1/results/export", params=at)
    assert answer.status_code == 422
    assert "impactd[parquet]" in answer.json()["remedy"]


def test_a_zip_holds_the_files_as_they_were_stored(rig, shot):
    """Each file has its SHA-256, and the table lies beside them."""
    number = shot["number"]
    answer = rig.reader.get("/v1/results/export", params={"shots": str(number), "format": "hdf5"})
    assert answer.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(answer.content)) as found:
        content = found.read(f"shots/shot-{number:06d}.h5")
        assert hashlib.sha256(content).hexdigest() == shot["sha256"]
        assert found.read("results.csv").startswith(b"# software")


def test_a_list_that_is_none_is_refused(rig, shot):
    """422 with how to write one; nothing chosen is 404."""
    wrong = rig.reader.get("/v1/results/export", params={"shots": "3..5"})
    assert wrong.status_code == 422
    assert "3, 5, 8-19" in wrong.json()["remedy"]
    assert rig.reader.get("/v1/results/export", params={"shots": "9999"}).status_code == 404


def test_the_rig_says_how_it_was_found(rig, shot):
    """Six checks, two devices, the noise of each fitted shot, and how many shots fit the disk."""
    found = rig.reader.get("/v1/rig/health").json()
    names = [one["name"] for one in found["checks"]]
    assert sorted(names) == ["calibration", "digitizer", "disk", "input", "sphere", "valve"]
    assert [one["name"] for one in found["devices"]] == ["digitizer", "valve"]
    assert shot["number"] in found["noise"]["numbers"]
    assert all(0 < value < 0.02 for value in found["noise"]["noise_rms_V"])
    assert found["disk"]["shots_left"] > 0
