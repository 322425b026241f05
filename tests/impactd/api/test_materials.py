"""Materials over HTTP: changed without a restart; what was fitted before stays as it was."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from impactd.cli import app
from impactd.jobs.campaign_export import export_campaign

from .conftest import run_daemon, simulated_settings

DROP = {"sphere": "hdpe", "surface": "specimen", "drop_height_m": 0.03, "operator": "ab"}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A daemon whose materials may be changed."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("own")))


def entry(own, name="hdpe"):
    """Return an entry as it is now."""
    return own.reader.get(f"/v1/materials/spheres/{name}").json()["entry"]


def test_a_new_mass_counts_for_the_next_drop_and_not_for_the_last(own, tmp_path):
    """Fits say their version; the export of an old shot has the old mass."""
    old = own.drop(DROP).json()["number"]
    own.ended(old, ("analysed", "failed"))
    body = {"entry": entry(own) | {"mass_kg": 4.4e-4}, "note": "weighed again"}
    changed = own.operator.put("/v1/materials/spheres/hdpe", json=body)
    assert changed.status_code == 200, changed.text
    assert changed.json()["changed_by"] == "operate token"
    new = own.drop(DROP).json()["number"]
    own.ended(new, ("analysed", "failed"))
    for number, version, mass in ((old, 0, entry_mass(own, 0)), (new, 1, 4.4e-4)):
        fits = own.reader.get(f"/v1/shots/{number}").json()["fits"]
        assert {fit["result"]["materials_version"] for fit in fits} == {version}
        file = export_campaign(
            own.daemon.archive,
            [number],
            tmp_path / str(number),
            settings=own.daemon.settings,
            book=own.daemon.book,
        )
        told = json.loads(file.read_text())["spheres"]["hdpe"]["mass_kg"]
        assert (told["value"] if isinstance(told, dict) else told) == mass
    (change, *_) = own.reader.get("/v1/materials").json()["changes"]
    assert (change["name"], change["note"]) == ("hdpe", "weighed again")


def entry_mass(own, version):
    """Return the sphere's mass of a version."""
    return own.daemon.book.at(version).spheres["hdpe"].mass_kg


def test_the_same_entry_again_changes_nothing(own):
    """A repetition of the request is no change."""
    before = own.reader.get("/v1/materials").json()["version"]
    for _ in range(2):
        body = {"entry": entry(own, "ptfe")}
        assert own.operator.put("/v1/materials/spheres/ptfe", json=body).status_code == 200
    assert own.reader.get("/v1/materials").json()["version"] == before


def test_an_impossible_value_is_refused_with_its_pointer(own):
    """And a reader may change nothing."""
    body = {"entry": entry(own) | {"radius_m": -1}}
    answer = own.operator.put("/v1/materials/spheres/hdpe", json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "#/entry/radius_m"
    assert own.reader.put("/v1/materials/spheres/hdpe", json=body).status_code == 403


def test_a_new_coupon_may_be_dropped_on_by_name(own, run_own):
    """Added from the terminal as a copy, it is listed and known to the form of a drop."""
    told = run_own("materials", "surface", "plate_7", "--copy-of", "specimen", "source=lot 7")
    assert told.exit_code == 0, told.output
    assert "lot 7" in told.output
    rig = own.reader.get("/v1/rig").json()
    assert "plate_7" in [one["name"] for one in rig["surfaces"]]
    told = run_own("materials", "surface", "plate_7", "coupon_mass_kg=3.8e-3+-1e-6")
    assert "0.0038 +- 1e-06" in told.output
    assert "plate_7" in run_own("materials").output


def test_every_change_of_a_material_is_shown_however_many_others_there_were(own, run_own):
    """A first change is not crowded out of its own list by a hundred of another material."""
    first = run_own("materials", "sphere", "neoprene", "source=drawer 1", "--note", "the first")
    assert first.exit_code == 0, first.output
    for turn in range(101):
        body = {"entry": entry(own, "steel") | {"source": f"box {turn}"}}
        assert own.operator.put("/v1/materials/spheres/steel", json=body).status_code == 200
    assert "the first" in run_own("materials", "sphere", "neoprene").output
    told = own.reader.get("/v1/materials/spheres/steel/changes").json()["items"]
    assert [one["after"]["source"] for one in told] == [f"box {n}" for n in range(100, -1, -1)]
    assert own.reader.get("/v1/materials/spheres/marble/changes").status_code == 404


@pytest.mark.parametrize("wrong", ["mass_kg=nan", "radius_m.u=1e-6", "mass_kg"])
def test_an_assignment_that_cannot_be_is_wrong_usage(run_own, wrong):
    """It is answered with what was written; nothing is changed."""
    told = run_own("materials", "sphere", "hdpe", wrong)
    assert told.exit_code == 2
    assert wrong in told.output


@pytest.fixture
def run_own(own, monkeypatch):
    """Return the command line of this daemon's operator."""

    monkeypatch.setenv("IMPACTD_URL", own.url)
    monkeypatch.setenv("IMPACTD_TOKEN", own.token("operate"))
    return lambda *words: CliRunner().invoke(app, list(words))
