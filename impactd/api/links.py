"""Links between answers, and routes without a token, in the OpenAPI document."""

from __future__ import annotations

from typing import Any

from impactd.api.security import LOOPBACK, PUBLIC, ROUTE_SCOPES

# (method, path, status) of the answer -> member of its body, parameter, where it leads.
_LINKS: dict[tuple[str, str, str], tuple[str, str, tuple[tuple[str, str], ...]]] = {
    ("post", "/v1/drops", "202"): (
        "number",
        "number",
        (
            ("get", "/v1/drops/{number}"),
            ("patch", "/v1/drops/{number}"),
            ("delete", "/v1/drops/{number}"),
            ("get", "/v1/shots/{number}"),
            ("get", "/v1/shots/{number}/trace"),
        ),
    ),
    ("post", "/v1/fits", "202"): ("id", "fit_id", (("get", "/v1/fits/{fit_id}"),)),
    ("post", "/v1/calibrations", "202"): (
        "number",
        "calibration_id",
        (("get", "/v1/calibrations/{calibration_id}"),),
    ),
    ("post", "/v1/diagnoses", "202"): (
        "id",
        "diagnosis_id",
        (
            ("get", "/v1/diagnoses/{diagnosis_id}"),
            ("delete", "/v1/diagnoses/{diagnosis_id}"),
            ("post", "/v1/diagnoses/{diagnosis_id}/next-drop"),
            ("get", "/v1/diagnoses/{diagnosis_id}/report.html"),
            ("get", "/v1/diagnoses/{diagnosis_id}/report.pdf"),
        ),
    ),
    ("post", "/v1/recordings/{name}/diagnoses", "202"): (
        "id",
        "diagnosis_id",
        (
            ("get", "/v1/diagnoses/{diagnosis_id}"),
            ("delete", "/v1/diagnoses/{diagnosis_id}"),
            ("get", "/v1/diagnoses/{diagnosis_id}/report.html"),
            ("get", "/v1/diagnoses/{diagnosis_id}/report.pdf"),
        ),
    ),
}


_KEYS_REQUIRED = (
    ("post", "/v1/drops"),
    ("post", "/v1/series"),
    ("post", "/v1/diagnoses/{diagnosis_id}/next-drop"),
)
"""What moves the rig. A calibration takes the timer's `slot` in place of a key."""


def add_links(schema: dict[str, Any]) -> None:
    """Add the links to an OpenAPI document."""
    paths = schema["paths"]
    for (method, path, status), (member, parameter, targets) in _LINKS.items():
        answer = paths[path][method]["responses"][status]
        answer["links"] = {
            paths[to][by]["operationId"]: {
                "operationId": paths[to][by]["operationId"],
                "parameters": {parameter: f"$response.body#/{member}"},
            }
            for by, to in targets
        }


def mark_open_routes(schema: dict[str, Any]) -> None:
    """Mark the routes that need no token, or none from this machine."""
    for (method, path), needed in ROUTE_SCOPES.items():
        operation = schema["paths"].get(path, {}).get(method.lower())
        if operation is not None and needed == PUBLIC:
            operation["security"] = []
        elif operation is not None and needed == LOOPBACK:
            operation["security"] = [*operation["security"], {}]


def mark_required_keys(schema: dict[str, Any]) -> None:
    """Mark that a request to move needs its ``Idempotency-Key``.

    Without one the answer is 400 with a type of its own, which the framework's check would not
    give.
    """
    for method, path in _KEYS_REQUIRED:
        for one in schema["paths"][path][method]["parameters"]:
            if one["name"] == "Idempotency-Key":
                one["required"] = True
                one["schema"] = next(
                    (
                        kind
                        for kind in one["schema"].get("anyOf", [])
                        if kind.get("type") == "string"
                    ),
                    one["schema"],
                )
