"""Every error is a problem document that says what happened and what to do."""

from __future__ import annotations

import json
import threading

import httpx2
import pytest
import uvicorn

from impactd.api.gate import Gate
from impactd.api.problems import CATALOGUE, MEDIA_TYPE, ProblemError, from_status
from impactd.server import listen

from .conftest import ACETAL_ON_ALUMINIUM, until

KEY = {"Idempotency-Key": "test-problems"}


def problem(answer: httpx2.Response, slug: str) -> dict[str, object]:
    """Return the problem document after checking its form."""
    assert answer.headers["content-type"] == MEDIA_TYPE, answer.text
    document = answer.json()
    assert document["type"] == f"urn:impactd:problem:{slug}"
    assert document["status"] == answer.status_code == CATALOGUE[slug].status
    assert document["title"] == CATALOGUE[slug].title
    assert document["detail"]
    assert document["remedy"]
    assert "Traceback" not in answer.text
    return document


def test_an_unknown_path_is_a_404_problem(rig):
    """A wrong path is named."""
    assert "/v1/nothing" in problem(rig.anybody.get("/v1/nothing"), "not-found")["detail"]


def test_an_unknown_number_is_a_404_problem(rig):
    """A drop that does not exist is named."""
    assert "drop 4711" in problem(rig.reader.get("/v1/drops/4711"), "not-found")["detail"]


def test_a_wrong_method_is_a_405_problem_with_allow(rig):
    """A wrong method says which ones there are."""
    answer = rig.operator.put("/v1/drops/1")
    problem(answer, "method-not-allowed")
    assert "GET" in answer.headers["allow"]


@pytest.mark.parametrize("path", ["drops", "files/one.csv"])
def test_a_file_by_a_wrong_method_is_a_405_problem(rig, path):
    """Where a file is put, the type of a file is not what is wrong with a POST."""
    kind = {"Content-Type": "application/octet-stream"}
    answer = rig.operator.post(f"/v1/recordings/mine/{path}", content=b"1,2", headers=kind)
    problem(answer, "method-not-allowed")
    assert "PUT" in answer.headers["allow"]


@pytest.mark.parametrize("number", ["0", "-1", "x", "1e3", str(2**63), "1.5"])
def test_a_number_that_is_none_is_a_422_problem(rig, number):
    """A number in the path is a positive integer that JSON can hold."""
    problem(rig.reader.get(f"/v1/drops/{number}"), "invalid")


@pytest.mark.parametrize(
    "change",
    [
        {"drop_height_m": "0.047"},
        {"drop_height_m": -1},
        {"drop_height_m": 0},
        {"drop_height_m": 1e9},
        {"drop_height_m": None},
        {"operator": ""},
        {"operator": "a\nb"},
        {"sphere": 3},
        {"force": 1},
    ],
    ids=str,
)
def test_a_wrong_member_of_a_body_is_named(rig, change):
    """422 points at the member and gives the reason."""
    body = ACETAL_ON_ALUMINIUM | change
    document = problem(rig.operator.post("/v1/drops", json=body, headers=KEY), "invalid")
    (member,) = change
    assert document["errors"][0]["pointer"] == f"#/{member}"
    assert document["detail"].startswith(member)
    assert document["detail"].endswith(".")


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        (ACETAL_ON_ALUMINIUM | {"a/b~c": 1}, "#/a~1b~0c"),
        ([], "#"),
        ({"drops": [ACETAL_ON_ALUMINIUM, {**ACETAL_ON_ALUMINIUM, "force": 1}]}, "#/drops/1/force"),
    ],
)
def test_a_place_in_a_body_is_a_json_pointer(rig, body, pointer):
    """RFC 6901: escaped, numbers for places in a list, and nothing for the whole."""
    path = "/v1/series" if "drops" in body else "/v1/drops"
    document = problem(rig.operator.post(path, json=body, headers=KEY), "invalid")
    assert document["errors"][0]["pointer"] == pointer


@pytest.mark.parametrize(("query", "name"), [("limit=x", "limit"), ("limt=3", "limt")])
def test_a_wrong_parameter_is_named_as_one(rig, query, name):
    """It lies in no body: it has a name and where it stands, and no pointer."""
    document = problem(rig.reader.get(f"/v1/shots?{query}"), "invalid")
    found = document["errors"][0]
    assert (found["in"], found["parameter"]) == ("query", name)
    assert "pointer" not in found


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_no_infinity_comes_in_and_none_goes_out(rig, literal):
    """NaN and infinity are refused, and the refusal does not repeat them."""
    text = json.dumps(ACETAL_ON_ALUMINIUM).replace("0.03", literal)
    answer = rig.operator.post(
        "/v1/drops", content=text, headers=KEY | {"Content-Type": "application/json"}
    )
    problem(answer, "invalid")
    json.loads(answer.text, parse_constant=lambda name: pytest.fail(f"{name} in {answer.text}"))


@pytest.mark.parametrize("text", ["{", "", "[]", "null", "\x00", '{"sphere": "\\ud800"}'])
def test_a_body_that_is_no_json_object_is_a_422_problem(rig, text):
    """Broken JSON is refused with a reason."""
    answer = rig.operator.post(
        "/v1/drops", content=text, headers=KEY | {"Content-Type": "application/json"}
    )
    problem(answer, "invalid")


def test_broken_json_is_answered_with_what_breaks_it(rig):
    """Where it breaks, and that it should be JSON at all."""
    headers = KEY | {"Content-Type": "application/json"}
    answer = rig.operator.post("/v1/drops", content='{"sphere": }', headers=headers)
    document = problem(answer, "invalid")
    assert "no JSON" in document["detail"]
    assert "at character 11" in document["detail"]


def test_a_text_that_is_refused_is_quoted(rig):
    """An empty one can be seen."""
    document = problem(rig.drop(ACETAL_ON_ALUMINIUM | {"operator": ""}), "invalid")
    assert document["detail"].startswith('operator is "":')


@pytest.mark.parametrize("path", ["/v1/fits", "/v1/diagnoses"])
def test_a_shot_named_twice_is_refused(rig, path):
    """It would count as two drops, and make the uncertainty smaller than it is."""
    answer = rig.operator.post(path, json={"shots": [3, 1, 3]}, headers=KEY)
    document = problem(answer, "invalid")
    assert document["errors"][0]["pointer"] == "#/shots"
    assert "shot 3 is named twice" in document["detail"]


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", None])
def test_a_body_that_is_not_called_json_is_a_415_problem(rig, kind):
    """A form of another web site cannot pose as JSON."""
    headers = KEY | ({"Content-Type": kind} if kind else {})
    answer = rig.operator.post(
        "/v1/drops", content=json.dumps(ACETAL_ON_ALUMINIUM), headers=headers
    )
    problem(answer, "media-type")


def test_a_large_body_is_a_413_problem(rig):
    """More than 64 KiB are not read when the length says so."""
    body = ACETAL_ON_ALUMINIUM | {"operator": "x" * 70_000}
    document = problem(rig.operator.post("/v1/drops", json=body, headers=KEY), "body-too-large")
    assert document["limit_bytes"] == 65536


def test_a_large_body_of_unknown_length_is_a_413_problem(rig):
    """More than 64 KiB are not read when they come in chunks either."""
    answer = rig.operator.post(
        "/v1/drops",
        content=(b" " * 1000 for _ in range(200)),
        headers=KEY | {"Content-Type": "application/json"},
    )
    problem(answer, "body-too-large")


def test_a_drop_without_an_idempotency_key_is_a_400_problem(rig):
    """Nothing physical happens on a request that could be repeated by accident."""
    answer = rig.operator.post("/v1/drops", json=ACETAL_ON_ALUMINIUM)
    problem(answer, "idempotency-key-missing")


def test_an_unknown_material_is_named_with_those_there_are(rig):
    """A typing error in a sphere's name is answered with the list."""
    document = problem(rig.drop(ACETAL_ON_ALUMINIUM | {"sphere": "acetl"}), "unknown-material")
    assert "acetal" in document["detail"]
    assert "`impactd materials sphere NAME KEY=VALUE...`" in document["detail"]


def test_a_full_disk_is_a_507_problem_before_anything_moves(rig, monkeypatch):
    """Inside the reserve no drop begins; the answer says how much is missing."""
    until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
    before = rig.daemon.archive.drops()
    monkeypatch.setattr(rig.daemon.archive, "reserve_bytes", 10**18)
    document = problem(rig.drop(), "disk-full")
    assert document["needed_bytes"] == 10**18
    assert not rig.anybody.get("/v1/status").json()["ready"]
    assert rig.anybody.get("/readyz").status_code == 503
    assert rig.daemon.archive.drops() == before


def test_every_problem_type_has_its_own_uri_and_a_remedy():
    """The catalogue is complete and free of doubles."""
    assert len({kind.uri for kind in CATALOGUE.values()}) == len(CATALOGUE)
    assert all(kind.remedy and kind.title and kind.status >= 400 for kind in CATALOGUE.values())


def test_a_problem_never_holds_nan():
    """A member that is not finite becomes null."""
    assert ProblemError("busy", "x", rate=float("nan")).document()["rate"] is None


@pytest.mark.parametrize("status", [400, 404, 413, 418, 500, 503])
def test_any_status_of_the_framework_has_a_problem(status):
    """A bare status becomes a problem of its class."""
    assert from_status(status, "x").kind.status // 100 == status // 100


async def _broken_app(scope, _receive, send):
    if scope["path"] == "/raises":
        raise ZeroDivisionError("secret detail")
    headers = [(b"content-type", b"text/plain"), (b"content-range", b"bytes */9")]
    await send({"type": "http.response.start", "status": 416, "headers": headers})
    await send({"type": "http.response.body", "body": b"plain ", "more_body": True})
    await send({"type": "http.response.body", "body": b"text"})


@pytest.fixture(scope="module")
def broken_url():
    """Serve an application that fails behind the gate."""
    seen = []
    gate = Gate(
        _broken_app,
        allowed_hosts=["127.0.0.1"],
        observe=lambda _scope, status, _seconds: seen.append(status),
        record=lambda _written: None,
    )
    server = uvicorn.Server(uvicorn.Config(gate, lifespan="off", log_config=None))
    listener = listen("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    until(lambda: server.started, bool)
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    server.should_exit = True
    thread.join(timeout=10)


def test_an_unforeseen_failure_is_a_500_problem_without_a_traceback(broken_url, capsys):
    """The person gets a reference, the log gets the traceback."""
    document = problem(httpx2.get(f"{broken_url}/raises", trust_env=False), "internal")
    assert "secret detail" not in json.dumps(document)
    captured = capsys.readouterr()
    logged = captured.out + captured.err
    assert document["reference"] in logged
    assert "ZeroDivisionError" in logged


def test_a_plain_error_of_a_library_becomes_a_problem(broken_url):
    """An error answer that is not a problem yet is replaced, its useful headers kept."""
    answer = httpx2.get(f"{broken_url}/plain", trust_env=False)
    problem(answer, "range-not-satisfiable")
    assert answer.headers["content-range"] == "bytes */9"
