"""Somebody's own recordings, from the upload to a verdict."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from tests.recordings import VALUES, simulated_csv

from .conftest import until

AT = "/v1/recordings/acetal-1"
BINARY = {"Content-Type": "application/octet-stream"}


def upload(rig, file: str, content: bytes, *, at: str = AT):
    """Send a file as a browser does."""
    return rig.operator.put(f"{at}/files/{file}", content=content, headers=BINARY)


def upload_all(rig, *, at: str = AT):
    """Send four simulated recordings; return which drop each was, by the name of its shot."""
    files, shots = simulated_csv()
    for file, content in files.items():
        answer = upload(rig, file, content, at=at)
        assert answer.status_code == 200, answer.text
    return shots


@pytest.fixture(scope="module")
def drops(rig):
    """Four uploaded recordings; which drop each was, by the name of its shot."""
    return upload_all(rig)


@pytest.fixture(scope="module")
def diagnosis(rig, drops):
    """The diagnosis of these recordings, ended."""
    body = {"values": {**VALUES, "shots": drops}}
    answer = rig.operator.post(f"{AT}/diagnoses", json=body, headers={"Idempotency-Key": "a"})
    assert answer.status_code == 202, answer.text
    again = rig.operator.post(f"{AT}/diagnoses", json=body, headers={"Idempotency-Key": "a"})
    assert again.json()["id"] == answer.json()["id"]
    return until(
        lambda: rig.reader.get(answer.headers["location"]).json(),
        lambda found: found["state"] in ("done", "failed", "cancelled"),
        limit_s=200,
    )


def test_what_was_read_is_answered_in_the_words_of_the_command(rig, drops):
    """Hits with unit and sampling, each assumption, what is missing, and a picture."""
    answer = rig.operator.post(f"{AT}/reading", json={})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert [one["name"] for one in found["shots"]] == list(drops)
    assert {one["quantity"] for one in found["shots"]} == {"voltage"}
    assert found["shots"][0]["sample_rate_Hz"] == pytest.approx(1e6)
    assert found["shots"][0]["contact_s"] == pytest.approx(1e-4, rel=0.5)
    assert any("is in V, as the file states" in one for one in found["assumptions"])
    assert "drop-1, drop-2, drop-3, drop-4: drop height." in found["missing"]
    assert any(one.startswith("Load cell: compliance") for one in found["missing"])
    picture = rig.reader.get(found["links"]["picture"])
    assert picture.content.startswith(b"\x89PNG")


def test_what_was_uploaded_and_stated_is_kept(rig, drops, diagnosis):
    """A browser that comes back finds files, values and diagnoses."""
    kept = rig.reader.get(AT).json()
    assert [one["name"] for one in kept["files"]] == [f"{name}.csv" for name in drops]
    assert kept["values"] == {**VALUES, "shots": drops}
    assert [one["id"] for one in kept["diagnoses"]] == [diagnosis["id"]]
    assert "acetal-1" in [one["name"] for one in rig.reader.get("/v1/recordings").json()["items"]]


def test_a_modulus_comes_of_recordings_with_page_and_pdf(rig, diagnosis):
    """The diagnosis is like any other, and what it rests on is a campaign folder."""
    assert diagnosis["state"] == "done", diagnosis["reason"]
    assert diagnosis["verdict"] == "adequate"
    result = diagnosis["result"]
    assert result["after"]["moduli"]["specimen"]["status"] == "fitted"
    plane = result["after"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    assert plane["value"] == pytest.approx(4.18e9, abs=3 * plane["u"])  # the simulated rig's truth
    assert set(result["files"]) == {"campaign.json", *(f"shot00{at}.npy" for at in range(4))}
    assert "<html" in rig.reader.get(diagnosis["links"]["report"]).text
    sheet = rig.reader.get(diagnosis["links"]["report_pdf"])
    assert sheet.headers["content-type"] == "application/pdf"
    assert sheet.content.startswith(b"%PDF")


def test_the_same_file_may_come_again_and_another_may_not(rig, drops):
    """A repeated upload changes nothing; another file of the name is refused."""
    content = simulated_csv()[0]["drop-1.csv"]
    assert upload(rig, "drop-1.csv", content).status_code == 200
    refused = upload(rig, "drop-1.csv", b"1,2\n")
    assert refused.status_code == 422
    assert "another content" in refused.json()["detail"]


@pytest.mark.parametrize(
    ("file", "content", "said"),
    [
        ("note.pdf", b"%PDF", "none of the endings"),
        ("points-elsewhere.h5", b"\x89HDF\r\n\x1a\n", "none of the endings"),
        ("empty.csv", b"", "is empty"),
        (".hidden.csv", b"1", "no dot in front"),
    ],
)
def test_what_is_no_recording_is_refused_with_what_to_do(rig, file, content, said):
    """A problem that names the file; nothing is kept."""
    answer = upload(rig, file, content, at="/v1/recordings/refused")
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert said in answer.json()["detail"]
    assert answer.json()["remedy"]
    assert rig.reader.get("/v1/recordings/refused").status_code == 404


def no_rate() -> bytes:
    """A column of numbers without times."""
    return "\n".join(f"{one:.3f}" for one in np.sin(np.arange(4000))).encode()


def not_plain() -> bytes:
    """An array of objects: reading one would run what it says."""
    held = io.BytesIO()
    np.save(held, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    return held.getvalue()


@pytest.mark.parametrize(
    ("file", "content", "said", "remedy"),
    [
        ("column.csv", no_rate(), "does not say how fast it was sampled", "--rate"),
        pytest.param(
            "words.csv",
            b"no numbers here\nat all\n",
            "holds no table of numbers",
            "time and signal",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "objects.npy",
            not_plain(),
            "no array of plain numbers",
            "numpy.save",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_bad_file_says_what_is_wrong_and_never_how_the_reader_fell(
    rig, file, content, said, remedy
):
    """The words are the command's; the daemon goes on."""
    at = f"/v1/recordings/{file.partition('.')[0]}"
    assert upload(rig, file, content, at=at).status_code == 200
    answer = rig.operator.post(f"{at}/reading", json={})
    assert answer.status_code == 422
    problem = answer.json()
    assert problem["type"] == "urn:impactd:problem:recordings"
    assert file in problem["detail"]
    assert said in problem["detail"]
    assert remedy in problem["remedy"]
    assert "Traceback" not in answer.text


def test_an_impossible_value_is_named_and_nothing_is_queued(rig, drops, diagnosis):
    """The place in the values, and the reason; no campaign folder is left behind."""
    wrong = json.loads(json.dumps(VALUES))
    wrong["spheres"]["acetal"]["radius_m"] = -1
    body = {"values": {**wrong, "shots": drops}}
    answer = rig.operator.post(f"{AT}/diagnoses", json=body)
    assert answer.status_code == 422
    assert "values, " in answer.json()["detail"]
    assert "radius_m" in answer.json()["detail"]
    (only,) = rig.reader.get(AT).json()["diagnoses"]
    assert only["id"] == diagnosis["id"]


def test_an_upload_has_a_size_and_only_uploads_are_files(rig):
    """More than 32 MiB is refused; other routes take JSON alone."""
    answer = upload(rig, "large.csv", bytes(2**25 + 1))
    assert answer.status_code == 413
    assert answer.json()["limit_bytes"] == 2**25
    other = rig.operator.post("/v1/fits", content=b"{}", headers=BINARY)
    assert other.status_code == 415


def test_a_table_of_drops_says_which_drop_was_which(rig):
    """As the command reads it: decimal commas, names of files; what is no table is refused."""
    at = "/v1/recordings/with-table"
    assert rig.operator.put(f"{at}/drops", content=b"name\n", headers=BINARY).status_code == 404
    upload_all(rig, at=at)
    table = b"name;sphere;surface;drop_height_mm\r\ndrop-1.csv;acetal;specimen;19,1\r\n"
    answer = rig.operator.put(f"{at}/drops", content=table, headers=BINARY)
    assert answer.status_code == 200, answer.text
    stated = {"sphere": "acetal", "surface": "specimen", "drop_height_m": pytest.approx(0.0191)}
    assert answer.json()["values"] == {
        "shots": {"drop-1.csv": stated}, "spheres": {"acetal": {}}, "surfaces": {"specimen": {}}
    }  # fmt: skip
    body = {"values": answer.json()["values"]}
    assert rig.operator.post(f"{at}/reading", json=body).status_code == 200
    assert rig.reader.get(at).json()["values"] == answer.json()["values"]
    refused = rig.operator.put(f"{at}/drops", content=b"height;19\n", headers=BINARY)
    assert refused.status_code == 422
    assert "The table of drops: has no column name" in refused.json()["detail"]


def test_recordings_are_deleted_with_who_and_when_in_the_log(rig, diagnosis):
    """All of their files; the document of a diagnosis stays."""
    at = "/v1/recordings/to-delete"
    upload(rig, "drop-1.csv", simulated_csv()[0]["drop-1.csv"], at=at)
    assert rig.operator.post(f"{at}/reading", json={}).status_code == 200
    folder = rig.daemon.archive.directory / "recordings" / "to-delete"
    assert (folder / "recordings.png").is_file()
    assert rig.reader.delete(at).status_code == 403
    assert rig.operator.delete(at).status_code == 204
    assert rig.reader.get(at).status_code == 404
    assert not folder.exists()
    again = rig.operator.delete(at)
    assert again.status_code == 404
    assert "There is no recording set to-delete." in again.json()["detail"]

    def deleted():
        items = rig.reader.get("/v1/log", params={"limit": 20}).json()["items"]
        return [one for one in items if one["data"].get("path") == at]

    entry = until(deleted, lambda found: len(found) >= 2)[-1]
    assert entry["data"]["method"] == "DELETE"
    assert entry["data"]["by"]
    assert entry["utc"]


def test_recordings_under_diagnosis_are_not_deleted(rig):
    """The diagnosis is named; once it has ended, they go and its document stays."""
    at = "/v1/recordings/busy"
    body = {"values": {**VALUES, "shots": upload_all(rig, at=at)}}
    made = rig.operator.post(f"{at}/diagnoses", json=body).json()
    refused = rig.operator.delete(at)
    assert refused.status_code == 409
    assert f"diagnosis {made['id']}" in refused.json()["detail"]
    rig.operator.delete(f"/v1/diagnoses/{made['id']}")
    until(
        lambda: rig.reader.get(f"/v1/diagnoses/{made['id']}").json(),
        lambda found: found["state"] in ("done", "cancelled"),
        limit_s=60,
    )
    assert rig.operator.delete(at).status_code == 204
    assert rig.reader.get(f"/v1/diagnoses/{made['id']}").status_code == 200


def test_what_was_read_is_not_read_again_for_a_diagnosis(rig):
    """The campaign folder of the reading becomes that of the diagnosis."""
    at = "/v1/recordings/read-once"
    body = {"values": {**VALUES, "shots": upload_all(rig, at=at)}}
    assert rig.operator.post(f"{at}/reading", json=body).status_code == 200
    folder = rig.daemon.archive.directory / "recordings" / "read-once"
    (read,) = (folder / "reading").iterdir()
    written = (read / "campaign.json").stat()
    made = rig.operator.post(f"{at}/diagnoses", json=body).json()
    (kept,) = (folder / "campaigns").iterdir()
    assert (kept / "campaign.json").stat() == written
    assert not any((folder / "reading").iterdir())
    rig.operator.delete(f"/v1/diagnoses/{made['id']}")
