"""The one translation of what is raised within a request into problem documents.

The problem of a drop that failed later is made in `impactd.acquisition.failures`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis.errors import AnalysisError, UnknownModelError
from drivers.errors import DriverError
from impactd.acquisition.errors import (
    BusyError,
    DropHeightError,
    NotReadyError,
    RequestAbortedError,
    RequestRefusedError,
)
from impactd.api.client_keys import own_part
from impactd.api.problems import ProblemError
from impactd.importing.errors import RecordingError
from impactd.settings.materials import UnknownMaterialError
from impactd.storage.errors import (
    ArchiveError,
    CampaignError,
    CorruptShotError,
    DropStateError,
    IdempotencyConflictError,
    InUseError,
    NotFoundError,
    StorageFullError,
)

Translate = Callable[[Any], ProblemError]


def _busy(error: BusyError) -> ProblemError:
    return ProblemError(
        "busy", str(error), owner=error.owner, drop=error.number, headers={"Retry-After": "2"}
    )


def _not_ready(error: NotReadyError) -> ProblemError:
    return ProblemError("not-ready", error.sentence, remedy=error.remedy)


def _conflict(error: IdempotencyConflictError) -> ProblemError:
    what = (
        f"The idempotency key {own_part(error.key)!r} already belongs to number {error.number} "
        "with another body."
    )
    return ProblemError("idempotency-conflict", what, remedy=error.remedy, number=error.number)


def _full(error: StorageFullError) -> ProblemError:
    return ProblemError(
        "disk-full",
        error.what,
        remedy=error.remedy,
        free_bytes=error.free_bytes,
        needed_bytes=error.needed_bytes,
    )


def _recordings(error: RecordingError) -> ProblemError:
    detail = f"{error.where} {error.what}".strip()
    return ProblemError("recordings", detail, remedy=error.remedy)


def _said(slug: str) -> Translate:
    """Return a translation for errors with `what`, `why` and `remedy`."""

    def translate(error: ArchiveError | DriverError) -> ProblemError:
        detail = " ".join(part for part in (error.what, error.why) if part)
        return ProblemError(slug, detail, remedy=error.remedy)

    return translate


def _plain(slug: str) -> Translate:
    def translate(error: Exception) -> ProblemError:
        return ProblemError(slug, str(error))

    return translate


# A subclass stands before its base: the first match counts.
TRANSLATIONS: dict[type[Exception], Translate] = {
    BusyError: _busy,
    NotReadyError: _not_ready,
    DropHeightError: _plain("invalid"),
    RequestAbortedError: _plain("aborted"),
    RequestRefusedError: _plain("conflict"),
    UnknownMaterialError: _plain("unknown-material"),
    NotFoundError: _said("not-found"),
    StorageFullError: _full,
    CorruptShotError: _said("damaged"),
    DropStateError: _said("conflict"),
    InUseError: _said("conflict"),
    IdempotencyConflictError: _conflict,
    CampaignError: _plain("invalid"),
    RecordingError: _recordings,
    ArchiveError: _said("storage"),
    DriverError: _said("device"),
    UnknownModelError: _plain("invalid"),
    AnalysisError: _plain("invalid"),
}


def as_problem(error: Exception) -> ProblemError:
    """Return the problem document of an error that `TRANSLATIONS` knows by its class or a base."""
    for kind, translate in TRANSLATIONS.items():
        if isinstance(error, kind):
            return translate(error)
    raise TypeError(f"no translation for {type(error).__name__}") from error
