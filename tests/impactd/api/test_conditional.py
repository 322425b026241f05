"""HEAD, ETags, misspelt filters and the description of the API for people."""

from __future__ import annotations


def test_a_json_answer_that_is_known_is_not_sent_again(rig, shot):
    """304 without a body for its own tag, 200 for another one."""
    at = f"/v1/shots/{shot['number']}"
    first = rig.reader.get(at)
    tag = first.headers["etag"]
    again = rig.reader.get(at, headers={"If-None-Match": f'"x", W/{tag}'})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == tag
    assert rig.reader.get(at, headers={"If-None-Match": '"other"'}).json() == first.json()


def test_head_is_get_without_its_body(rig, shot):
    """The same headers, also of refusals; a stream and an abort are no business of it."""
    for at in (f"/v1/shots/{shot['number']}", "/v1/rig", "/v1/moduli"):
        seen, whole = rig.reader.head(at), rig.reader.get(at)
        assert (seen.status_code, seen.content) == (200, b"")
        assert seen.headers["etag"] == whole.headers["etag"]
    missing = rig.reader.head("/v1/shots/9999")
    assert (missing.status_code, missing.content) == (404, b"")
    assert rig.anybody.head("/v1/rig").status_code == 401


def test_a_misspelt_filter_is_refused(rig):
    """Else it would mean all; the answer says what was meant, and what there is."""
    answer = rig.reader.get("/v1/shots", params={"surfce": "specimen"})
    assert answer.status_code == 422
    assert "'surfce'" in answer.json()["detail"]
    assert "Did you mean 'surface'?" in answer.json()["remedy"]
    assert rig.reader.get("/v1/rig", params={"x": 1}).json()["remedy"] == "It knows none."


def test_a_request_to_move_declares_its_key(rig):
    """Programs made from the description send it; without one the answer stays 400."""
    document = rig.anybody.get("/openapi.json").json()
    parameters = document["paths"]["/v1/drops"]["post"]["parameters"]
    (key,) = [one for one in parameters if one["name"] == "Idempotency-Key"]
    assert key["required"] is True
    assert key["schema"]["type"] == "string"


def test_moduli_rig_models_and_effects_have_types(rig):
    """No answer of theirs is a bare object in the description."""
    paths = rig.anybody.get("/openapi.json").json()["paths"]
    for name in ("moduli", "rig", "models", "effects", "results", "materials"):
        at = f"/v1/{name}"
        content = paths[at]["get"]["responses"]["200"]["content"]["application/json"]
        assert "$ref" in content["schema"], at


def test_the_description_is_a_page_of_this_daemon(rig):
    """/docs needs no token and names files of the page only."""
    page = rig.anybody.get("/docs")
    assert page.status_code == 200
    assert "http" not in page.text.replace("https://", "http://").split("</head>")[0]
