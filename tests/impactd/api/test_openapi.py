"""The description of the API is complete and true."""

from __future__ import annotations

from impactd.wire.answers import DropAnswer


def test_every_operation_describes_its_problems(rig):
    """Each operation has a summary and names the form of its errors."""
    document = rig.anybody.get("/openapi.json").json()
    assert "Problem" in document["components"]["schemas"]
    assert "HTTPValidationError" not in str(document)
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            assert operation["summary"], (method, path)
            assert "application/problem+json" in str(operation["responses"]["default"]), path


def test_the_example_of_a_drop_is_accepted(rig):
    """The example in the description is a drop this rig knows."""
    document = rig.anybody.get("/openapi.json").json()
    example = document["components"]["schemas"]["DropBody"]["example"]
    rig.daemon.materials.check(example["sphere"], example["surface"])
    answer = document["components"]["schemas"]["DropAnswer"]["example"]
    absent = dict.fromkeys(DropAnswer.model_fields)  # members that are null are left out there
    DropAnswer.model_validate(absent | answer)


def test_metrics_count_requests_by_route_and_read_the_rig(rig):
    """A scrape shows readiness, free space and requests, without one label per number."""
    rig.reader.get("/v1/drops/1")
    rig.reader.get("/v1/drops/2")
    text = rig.anybody.get("/metrics").text
    assert "impactd_ready " in text
    assert "impactd_free_bytes " in text
    assert 'route="/v1/drops/{number}"' in text
    assert "/v1/drops/2" not in text


def test_status_is_one_honest_sentence(rig):
    """READY or NOT READY in words and as a flag, and they agree."""
    status = rig.anybody.get("/v1/status").json()
    assert status["sentence"].startswith("READY" if status["ready"] else "NOT READY")
    assert {"state", "owner", "drop", "calibration"} <= set(status)


def test_the_active_model_can_be_chosen(rig):
    """PUT /models/active changes what results are reported with; unknown models are refused."""
    before = rig.reader.get("/v1/models").json()["active"]
    try:
        assert rig.admin.put("/v1/models/active", json={"name": "hsd"}).json()["active"] == "hsd"
        assert rig.reader.get("/v1/models").json()["active"] == "hsd"
        wrong = rig.admin.put("/v1/models/active", json={"name": "magic"})
        assert wrong.status_code == 422
    finally:  # other tests share this daemon
        rig.admin.put("/v1/models/active", json={"name": before})


def test_the_effect_library_is_a_list(rig):
    """Effects are listed, even when there are none yet."""
    assert isinstance(rig.reader.get("/v1/effects").json()["items"], list)


def test_links_lead_to_operations_that_exist(rig):
    """Whoever follows a link from an answer arrives at a described operation."""
    document = rig.anybody.get("/openapi.json").json()
    operations = {
        operation["operationId"]
        for path in document["paths"].values()
        for operation in path.values()
    }
    links = document["paths"]["/v1/drops"]["post"]["responses"]["202"]["links"]
    assert len(links) == 5
    assert {link["operationId"] for link in links.values()} <= operations


def test_open_routes_say_that_they_need_no_token(rig):
    """Public routes have no security, loopback routes an optional one, the rest both kinds."""
    paths = rig.anybody.get("/openapi.json").json()["paths"]
    assert paths["/healthz"]["get"]["security"] == []
    assert {} in paths["/v1/status"]["get"]["security"]
    assert paths["/v1/drops"]["post"]["security"] == [{"HTTPBearer": []}, {"APIKeyCookie": []}]


def test_a_wrong_method_is_answered_with_all_right_ones(rig):
    """Allow names the methods of every route of the path."""
    for path, methods in (
        ("/v1/drops", "GET, HEAD, POST"),
        ("/v1/drops/1", "DELETE, GET, HEAD, PATCH"),
        ("/v1/shots/1.h5", "GET, HEAD"),
        ("/v1/calibrations/current", "GET, HEAD"),
    ):
        answer = rig.admin.put(path)
        assert answer.status_code == 405
        assert answer.headers["allow"] == methods
