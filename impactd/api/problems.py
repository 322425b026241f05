"""Every answer that is not a success, as RFC 9457 problem documents.

One catalogue of problem types; a type's URI, status and title never change once released.
``type`` is a URN, because the daemon lives on loopback and has no address of its own on the web.

A problem says in ``detail`` what happened (with values and units) and in ``remedy`` what to do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse

from impactd.api.finite import without_nan
from impactd.api.own_commands import SIGN_UP

MEDIA_TYPE = "application/problem+json"
URI_PREFIX = "urn:impactd:problem:"


@dataclass(frozen=True)
class ProblemType:
    """One kind of problem."""

    slug: str
    """Last part of the type URI."""
    status: int
    title: str
    """The kind in a few words, the same for every occurrence."""
    remedy: str
    """What to do when the occurrence names nothing better."""

    @property
    def uri(self) -> str:
        """Return the stable type URI."""
        return URI_PREFIX + self.slug


_TYPES = (
    ProblemType(
        "bad-request", 400, "The request is malformed", "Compare the request with /openapi.json."
    ),
    ProblemType(
        "idempotency-key-missing",
        400,
        "An Idempotency-Key is required",
        "Send a header `Idempotency-Key` with a new random value. Send the same value when you "
        "repeat the request.",
    ),
    ProblemType(
        "token-missing",
        401,
        "A token is required",
        f"{SIGN_UP} makes one. The command line takes it "
        "from IMPACTD_TOKEN; other clients send `Authorization: Bearer TOKEN`.",
    ),
    ProblemType(
        "token-invalid",
        401,
        "The token is not valid",
        "Make a new token with `impactd token create`; `impactd token list` shows which expired.",
    ),
    ProblemType(
        "code-invalid",
        401,
        "The sign-in code is not valid",
        "Run `impactd sign-in-code` and type the new code, or sign in with a token.",
    ),
    ProblemType(
        "scope-too-small",
        403,
        "The token does not allow this",
        "Use a token with the named scope; `impactd token create --scope SCOPE` makes one.",
    ),
    ProblemType(
        "csrf",
        403,
        "The request may come from another site",
        "Send the `csrf` of `GET /v1/session` in the header X-CSRF-Token, or use a bearer token.",
    ),
    ProblemType(
        "not-found", 404, "There is no such thing", ("List what exists, then repeat the request.")
    ),
    ProblemType(
        "method-not-allowed",
        405,
        "The resource does not know this method",
        "Use one of the methods in the `Allow` header.",
    ),
    ProblemType("busy", 409, "The rig is busy", "Wait until it ends, or abort it."),
    ProblemType(
        "not-ready",
        409,
        "The rig is not ready",
        ("Correct the named cause, then send the request again."),
    ),
    ProblemType(
        "aborted",
        409,
        "An abort came first",
        "Nothing moved. Find out why the rig was aborted, then repeat the request with a new "
        "Idempotency-Key.",
    ),
    ProblemType(
        "idempotency-conflict",
        409,
        "This Idempotency-Key belongs to another request",
        "Use a new key for a new request. Send the old body unchanged to get the old answer.",
    ),
    ProblemType(
        "conflict",
        409,
        "The state forbids this",
        ("Read the present state, then decide what to do."),
    ),
    ProblemType(
        "body-too-large",
        413,
        "The body is too large",
        "Send at most the named number of bytes; use `impactd new` for larger recordings.",
    ),
    ProblemType(
        "media-type", 415, "The body is not JSON", "Send `Content-Type: application/json`."
    ),
    ProblemType(
        "range-not-satisfiable",
        416,
        "The range lies outside the file",
        "Ask for a range within the size in the `Content-Range` header.",
    ),
    ProblemType(
        "host-not-allowed",
        421,
        "This host name is not served here",
        "Use the daemon's configured address, or add the name to server.allowed_hosts.",
    ),
    ProblemType(
        "invalid",
        422,
        "The request holds a value that is not allowed",
        ("Correct the fields that are named."),
    ),
    ProblemType(
        "recordings",
        422,
        "The recordings cannot be used as they are",
        "Correct what the sentence names, then send them again.",
    ),
    ProblemType(
        "unknown-material",
        422,
        "The material is not known",
        "Use a name that `impactd materials` lists, or add this one.",
    ),
    ProblemType(
        "too-many-guesses",
        429,
        "Too many wrong sign-in codes",
        "Wait for the seconds in the `Retry-After` header, or sign in with a token.",
    ),
    ProblemType(
        "internal",
        500,
        "The daemon failed",
        "Find the reference in the daemon's log (`journalctl -u impactd`) and report those lines.",
    ),
    ProblemType(
        "damaged",
        500,
        "A stored file is damaged",
        "Run `impactd verify`, and restore the file from a backup.",
    ),
    ProblemType(
        "not-yet", 501, "Not yet", "This part comes with a later release; see CHANGELOG.md."
    ),
    ProblemType(
        "device",
        503,
        "A device did not do what it was asked",
        "Check power and cables, then run `impactd doctor`.",
    ),
    ProblemType(
        "unavailable",
        503,
        "The daemon cannot serve this now",
        "Correct what the sentence names; `impactd status` says when the daemon is ready.",
    ),
    ProblemType(
        "storage",
        503,
        "The archive cannot be written",
        "Run `impactd doctor` and `impactd verify`.",
    ),
    ProblemType(
        "disk-full",
        507,
        "The disk is full",
        "Free space on the data directory's disk; the reserve is storage.reserve_bytes.",
    ),
)
CATALOGUE: Mapping[str, ProblemType] = {kind.slug: kind for kind in _TYPES}

# What the framework answers by itself, by status.
_BY_STATUS = {
    400: "bad-request",
    404: "not-found",
    405: "method-not-allowed",
    413: "body-too-large",
    415: "media-type",
    416: "range-not-satisfiable",
    421: "host-not-allowed",
    422: "invalid",
    429: "too-many-guesses",
}


class ProblemError(HTTPException):
    """A request ends with a problem document.

    A subclass of the framework's own exception, so that every layer lets it through.

    Parameters
    ----------
    slug : str
        Key into `CATALOGUE`.
    detail : str
        What happened here, with values and units.
    remedy : str, optional
        What to do, where the type's own remedy is too general.
    **members : object
        Extra members of the document, JSON-ready.
    """

    def __init__(
        self,
        slug: str,
        detail: str,
        *,
        remedy: str = "",
        headers: Mapping[str, str] | None = None,
        **members: Any,
    ) -> None:
        self.kind = CATALOGUE[slug]
        self.remedy = remedy or self.kind.remedy
        self.members = members
        super().__init__(self.kind.status, detail, headers)

    def document(self) -> dict[str, Any]:
        """Return the problem as it is sent: RFC 9457 members, ``remedy``, and its own members."""
        document: dict[str, Any] = without_nan(
            {
                "type": self.kind.uri,
                "title": self.kind.title,
                "status": self.kind.status,
                "detail": self.detail,
                "remedy": self.remedy,
                **self.members,
            }
        )
        return document

    def response(self) -> JSONResponse:
        """Return the problem as a response of media type ``application/problem+json``."""
        return JSONResponse(
            self.document(), self.kind.status, dict(self.headers or {}), media_type=MEDIA_TYPE
        )


def from_status(status: int, detail: str, headers: Mapping[str, str] | None = None) -> ProblemError:
    """Return the problem for a bare HTTP status (>= 400) that the framework chose.

    It is ``bad-request`` or ``internal`` where no type belongs to the status.
    """
    slug = _BY_STATUS.get(status, "bad-request" if status < 500 else "internal")
    return ProblemError(slug, detail, headers=headers)


def document_schema() -> dict[str, Any]:
    """Return the JSON schema of a problem document, with an example, for OpenAPI."""
    text = {"type": "string"}
    return {
        "type": "object",
        "required": ["type", "title", "status", "detail", "remedy"],
        "properties": {
            "type": {"type": "string", "format": "uri", "enum": [k.uri for k in _TYPES]},
            "title": text,
            "status": {"type": "integer"},
            "detail": text,
            "remedy": text,
        },
        "example": {
            "type": CATALOGUE["busy"].uri,
            "title": CATALOGUE["busy"].title,
            "status": 409,
            "detail": "Drop 17 of ab is running.",
            "remedy": CATALOGUE["busy"].remedy,
            "owner": "ab",
            "drop": 17,
        },
    }
