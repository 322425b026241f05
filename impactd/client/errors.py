"""What a client raises: each says what happened and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_PREFIX = "urn:impactd:problem:"


class RigError(Exception):
    """What was asked of a rig did not come about; the message is written for people."""


class UnreachableError(RigError):
    """No daemon answers at the address: the request did not arrive."""


class LostError(RigError):
    """Nobody knows whether the request arrived."""


class ProblemError(RigError):
    """The daemon refused, with a problem document (RFC 9457).

    Parameters
    ----------
    document : mapping
        The document.

    Attributes
    ----------
    type : str
        Stable; for programs.
    status : int
        HTTP status. [1]
    detail, remedy : str
        What happened, and what to do.
    members : dict
        Every member of the document, for example ``owner`` of a busy rig.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.type = str(document["type"])
        self.title = str(document.get("title", ""))
        self.status = int(document.get("status", 0))
        self.detail = str(document["detail"])
        self.remedy = str(document.get("remedy", ""))
        self.members = dict(document)
        super().__init__(f"{self.detail} {self.remedy}".strip())


class NotReadyError(ProblemError):
    """The light is NOT READY, or somebody else's drop holds the rig."""


class AbortedError(ProblemError):
    """An abort came first; nothing moved."""


class NotFoundError(ProblemError):
    """There is no such drop, shot, calibration or material."""


class TokenError(ProblemError):
    """The token is missing, unknown or not allowed to do this."""


class InvalidError(ProblemError):
    """A value is not allowed."""


class EndedError(RigError):
    """A drop, calibration, fit or diagnosis ended without a result.

    Parameters
    ----------
    message : str
        What ended, and why.
    answer : mapping
        Its last state as the API told it.
    """

    def __init__(self, message: str, answer: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.answer = dict(answer)


_CLASSES: Mapping[str, type[ProblemError]] = {
    "busy": NotReadyError,
    "not-ready": NotReadyError,
    "aborted": AbortedError,
    "not-found": NotFoundError,
    "unknown-material": NotFoundError,
    "token-missing": TokenError,
    "token-invalid": TokenError,
    "scope-too-small": TokenError,
    "invalid": InvalidError,
}


def problem_of(document: Mapping[str, Any]) -> ProblemError:
    """Return the exception of a problem document."""
    slug = str(document["type"]).removeprefix(_PREFIX)
    return _CLASSES.get(slug, ProblemError)(document)
