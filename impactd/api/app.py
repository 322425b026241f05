"""The application: routes, problems and security around one daemon."""

from __future__ import annotations

import functools
import json
from typing import Any

from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from impactd import __version__
from impactd.api.arrivals import Arrivals
from impactd.api.audit import Audit
from impactd.api.conditional import Conditional
from impactd.api.failed_logins import FailedLogins
from impactd.api.finite import without_nan
from impactd.api.gate import MAX_BODY_BYTES, Gate
from impactd.api.guess_limit import GuessLimit
from impactd.api.known_query import refuse_unknown_query
from impactd.api.links import add_links, mark_open_routes, mark_required_keys
from impactd.api.metrics import Metrics
from impactd.api.own_commands import as_typed_here
from impactd.api.problems import MEDIA_TYPE, ProblemError, document_schema, from_status
from impactd.api.read_limit import ReadLimit, in_turn
from impactd.api.routes import (
    alarms,
    calibrations,
    diagnoses,
    drops,
    effects,
    events,
    fits,
    guides,
    health,
    log,
    materials,
    models,
    moduli,
    page,
    recordings,
    results,
    rig,
    series,
    session,
    shots,
    sign_in_codes,
    status,
)
from impactd.api.security import Limits, authorize, is_local, methods_of
from impactd.api.sessions import SESSIONS_NAME, Sessions
from impactd.api.sign_in_codes import SignInCodes
from impactd.api.token_memory import TokenMemory
from impactd.api.translation import TRANSLATIONS, as_problem
from impactd.daemon import Daemon

_ROUTERS = (
    drops.router,
    series.router,
    shots.router,
    fits.router,
    moduli.router,
    results.router,
    calibrations.router,
    diagnoses.router,
    recordings.router,
    effects.router,
    models.router,
    status.router,
    rig.router,
    materials.router,
    alarms.router,
    log.router,
    events.router,
    session.router,
    sign_in_codes.router,
    health.router,
    page.router,
    guides.router,
)
_DESCRIPTION = """\
Runs a sphere-drop impact rig and turns each drop into an elastic modulus.

Every error is an RFC 9457 problem document with a stable `type`, a `detail` that says what happened
and a `remedy` that says what to do. Everything physical needs an `Idempotency-Key`. SI units
throughout; the unit is part of a member's name. NaN and infinity never appear.
"""


def create_app(daemon: Daemon) -> FastAPI:
    """Return the REST API of a daemon; it neither starts nor stops the daemon."""
    app = FastAPI(
        title="impactd",
        version=__version__,
        description=_DESCRIPTION,
        openapi_url=None,  # see `_add_description`
        docs_url=None,  # the stock pages load scripts from the web; a rig may have none
        redoc_url=None,
        dependencies=[Depends(authorize), Depends(refuse_unknown_query), in_turn],
        strict_content_type=True,
        telemetry={"tracing": False},
        responses={
            "default": {"description": "A problem document.", "content": _problem_content()}
        },
    )
    metrics = Metrics(daemon)
    app.state.daemon = daemon
    app.state.limits = Limits()
    app.state.sessions = Sessions(daemon.archive.directory / SESSIONS_NAME)
    app.state.sign_in_codes = SignInCodes()
    app.state.guess_limit = GuessLimit()
    app.state.token_memory = TokenMemory(daemon.archive.tokens)
    app.state.failed_logins = FailedLogins()
    app.state.read_limit = ReadLimit()
    app.state.arrivals = Arrivals(daemon.service.epoch)
    app.state.metrics = metrics
    app.add_middleware(Conditional)
    app.add_middleware(
        Gate,
        allowed_hosts=allowed_hosts(daemon),
        observe=metrics.observe,
        record=Audit(daemon.bus.publish).record,
        max_body_bytes=MAX_BODY_BYTES,
    )
    app.add_exception_handler(HTTPException, _http_problem)
    app.add_exception_handler(RequestValidationError, _validation_problem)
    for kind in TRANSLATIONS:
        app.add_exception_handler(kind, _translated_problem)
    for router in _ROUTERS:
        app.include_router(router)
    _document_problems(app)
    _add_description(app)
    return app


def allowed_hosts(daemon: Daemon) -> list[str]:
    """Return the host names requests may carry, numeric IPv6 addresses in brackets."""
    server = daemon.settings.server
    names = {*server.allowed_hosts, server.host} - {"0.0.0.0", "::"}  # noqa: S104 - taken out, not bound
    return sorted(f"[{name}]" if ":" in name and name[0] != "[" else name for name in names)


async def _http_problem(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    if isinstance(error, ProblemError):
        if is_local(request):
            error.remedy = as_typed_here(error.remedy, request.app.state.daemon.own_options)
        return error.response()
    method, path = request.method, request.url.path
    detail = {
        404: f"There is no resource at {path}.",
        405: f"{path} does not support {method}.",
    }.get(error.status_code, str(error.detail))
    headers = dict(error.headers or {})
    if error.status_code == 405:
        # The framework names the methods of one route only; a path may have several.
        headers["Allow"] = ", ".join(methods_of(path))
    return from_status(error.status_code, detail, headers).response()


async def _validation_problem(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return _no_json(first)
    found = [
        {
            **_place(item["loc"]),
            "reason": item["msg"].removeprefix("Value error, "),  # the framework's own words
            "given": without_nan(item.get("input")) if _is_short(item.get("input")) else None,
        }
        for item in error.errors()
    ]
    said = "; ".join(_sentence(item) for item in found)
    return ProblemError("invalid", f"{said}.", errors=found).response()


def _no_json(item: dict[str, Any]) -> JSONResponse:
    """Return what a person needs to correct a body that is no JSON: what is wrong, and where."""
    at, why = item["loc"][-1], item["ctx"]["error"]
    reason = f"it is no JSON: {why[:1].lower()}{why[1:]} at character {at}"
    return ProblemError(
        "invalid",
        f"The body cannot be read: {reason}.",
        remedy="Send one JSON object; `/openapi.json` has an example.",
        errors=[{"pointer": "#", "reason": reason, "given": None}],
    ).response()


def _sentence(found: dict[str, Any]) -> str:
    """Return what is wrong with one value, in words."""
    name = f"{found['in']} {found['parameter']}" if "in" in found else found["pointer"][2:]
    given = "" if found["given"] is None else f" is {json.dumps(found['given'])}"
    reason = str(found["reason"]).removesuffix(".")
    return f"{name or 'the body'}{given}: {reason[:1].lower()}{reason[1:]}"


def _place(location: tuple[Any, ...]) -> dict[str, str]:
    """Return the place of a value: a JSON pointer (RFC 6901) into the body, or the parameter."""
    place, *rest = location
    if place != "body":
        return {"in": str(place), "parameter": "/".join(map(str, rest))}
    keys = (str(part).replace("~", "~0").replace("/", "~1") for part in rest)
    return {"pointer": "#" + "".join(f"/{key}" for key in keys)}


def _is_short(value: object) -> bool:
    return isinstance(value, (str, int, float, bool)) and len(str(value)) <= 100


async def _translated_problem(_request: Request, error: Exception) -> JSONResponse:
    return as_problem(error).response()


def _add_description(app: FastAPI) -> None:
    """Answer `/openapi.json` from bytes made once: anybody may ask, and making them takes long."""

    @functools.cache
    def text() -> bytes:
        return json.dumps(app.openapi(), ensure_ascii=False, separators=(",", ":")).encode()

    async def description(_request: Request) -> Response:
        return Response(text(), media_type="application/json")

    app.add_route("/openapi.json", description, include_in_schema=False)


def _problem_content() -> dict[str, Any]:
    return {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}


def _document_problems(app: FastAPI) -> None:
    """Describe problem documents in OpenAPI, in place of the framework's own 422."""
    make = app.openapi

    def openapi() -> dict[str, Any]:
        fresh = app.openapi_schema is None
        schema = make()
        if fresh:
            components = schema.setdefault("components", {}).setdefault("schemas", {})
            components["Problem"] = document_schema()
            for name in ("HTTPValidationError", "ValidationError"):
                components.pop(name, None)
            add_links(schema)
            mark_open_routes(schema)
            mark_required_keys(schema)
            for path in schema["paths"].values():
                for operation in path.values():
                    invalid = operation.get("responses", {}).get("422")
                    if invalid is not None:
                        invalid["content"] = _problem_content()
        return schema

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's documented way to extend it
