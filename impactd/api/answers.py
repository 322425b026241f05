"""The archive's values as the models of the API's answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any
from urllib.parse import urlencode

from impactd.advice import UNLIKE, advice, best_fit, in_words
from impactd.aliases import Json
from impactd.api.client_keys import own_part
from impactd.api.finite import without_nan
from impactd.api.problems import URI_PREFIX, ProblemError
from impactd.storage.calibrations import Calibration
from impactd.storage.drops import Drop
from impactd.storage.fits import Fit
from impactd.storage.jobs import Job
from impactd.storage.materials_json import environment_to_json
from impactd.storage.problem import Problem
from impactd.storage.shots import Shot
from impactd.storage.timestamp import as_utc
from impactd.wire.answers import DropAnswer, FitAnswer, FitJobAnswer, ProblemMember, ShotAnswer
from impactd.wire.rig_answers import CalibrationAnswer


def problem_member(problem: Problem | None) -> ProblemMember | None:
    """Return a stored problem with its type as a URI."""
    if problem is None:
        return None
    kind = problem.type if ":" in problem.type else URI_PREFIX + problem.type
    return ProblemMember(
        type=kind,
        title=problem.title,
        status=problem.status,
        detail=problem.detail,
        remedy=problem.remedy,
    )


def drop_answer(drop: Drop) -> DropAnswer:
    """Return a drop as the API answers it."""
    return DropAnswer(
        number=drop.number,
        state=drop.state,
        shot=drop.shot,
        problem=problem_member(drop.problem),
        **asdict(drop.request) | {"environment": environment_to_json(drop.request.environment)},
        owner=drop.owner,
        calibration=drop.calibration,
        rebound_height_m=drop.rebound_height_m,
        u_rebound_height_m=drop.u_rebound_height_m,
        requested_utc=drop.requested_utc,
        updated_utc=drop.updated_utc,
        links={
            "self": f"/v1/drops/{drop.number}",
            "shot": f"/v1/shots/{drop.shot}" if drop.shot else None,
            "calibration": f"/v1/calibrations/{drop.calibration}" if drop.calibration else None,
        },
    )


def shot_answer(
    shot: Shot, fits: list[Fit] | None = None, comparison: Json | None = None
) -> ShotAnswer:
    """Return a shot as the API answers it, with fits and advice where ``fits`` are given."""
    members = asdict(shot)
    del members["file"]  # where the daemon keeps it is nobody's business
    members["environment"] = environment_to_json(shot.environment)
    at = f"/v1/shots/{shot.number}"
    answer = ShotAnswer(
        **without_nan(members),
        repetitions=without_nan(comparison),
        links={"self": at, "file": f"{at}.h5", "trace": f"{at}/trace"},
    )
    if fits is not None:
        answer.fits = [fit_answer(fit) for fit in fits]
        _advise(answer, shot, fits)
    return answer


def shot_summary(shot: Shot, fits: list[Fit], comparison: Json | None = None) -> ShotAnswer:
    """Return a shot for a list: with its advice and modulus, without its fits."""
    answer = shot_answer(shot, comparison=comparison)
    _advise(answer, shot, fits)
    return answer


def _advise(answer: ShotAnswer, shot: Shot, fits: list[Fit]) -> None:
    found = answer.repetitions
    unlike = found is not None and found.unlike
    answer.advice, answer.reasons = advice(shot, fits, unlike=unlike)
    answer.because = [
        found.sentence if found is not None and reason == UNLIKE else in_words(reason)
        for reason in answer.reasons
    ]
    best = best_fit(fits)
    answer.reduced_modulus_Pa = None if best is None else best.result.get("reduced_modulus_Pa")
    answer.model = None if best is None else best.model


def fit_answer(fit: Fit) -> FitAnswer:
    """Return a fit as the API answers it."""
    return FitAnswer(
        id=fit.id,
        shot=fit.shot,
        model=fit.model,
        calibration=fit.calibration,
        created_utc=fit.created_utc,
        # The curve has a route of its own; nobody reads it as text.
        result=without_nan({key: fit.result[key] for key in fit.result if key != "curve"}),
    )


def fit_job_answer(job: Job, fits: list[Fit]) -> FitJobAnswer:
    """Return the job of a fit, with the results it has so far."""
    return FitJobAnswer(
        id=job.id,
        state=job.state,
        kind=job.kind,
        subject=job.subject,
        attempts=job.attempts,
        reason=job.reason,
        created_utc=job.created_utc,
        finished_utc=job.finished_utc,
        fits=[fit_answer(fit) for fit in fits],
        result=without_nan(job.result),
        links={"self": f"/v1/fits/{job.id}"},
    )


def calibration_answer(calibration: Calibration) -> CalibrationAnswer:
    """Return a calibration as the API answers it."""
    return CalibrationAnswer(
        number=calibration.number,
        kind=calibration.kind,
        state=calibration.state,
        slot=None if calibration.slot is None else own_part(calibration.slot),
        owner=calibration.owner,
        plan=calibration.plan,
        drops=list(calibration.drops),
        result=without_nan(calibration.result),
        problem=problem_member(calibration.problem),
        requested_utc=calibration.requested_utc,
        finished_utc=calibration.finished_utc,
        valid_until_utc=calibration.valid_until_utc,
        links={"self": f"/v1/calibrations/{calibration.number}"},
    )


def next_page(path: str, numbers: list[int], limit: int, query: Mapping[str, Any]) -> str | None:
    """Return the path of the page after this one, ``None`` when this page was not full.

    ``query`` are the filters, which stay as they are.
    """
    if len(numbers) < limit:
        return None
    kept = {name: value for name, value in query.items() if value is not None}
    return f"{path}?{urlencode({**kept, 'limit': limit, 'before': numbers[-1]})}"


def timestamp(name: str, text: str | None) -> str | None:
    """Return a timestamp in the archive's form; raise ProblemError 422 when the text is none."""
    if text is None:
        return None
    try:
        return as_utc(text.replace(" ", "+"))  # a plus sign arrives as a space when not escaped
    except (ValueError, OverflowError) as error:
        raise ProblemError(
            "invalid",
            f"{name} is {text!r}, which is not an ISO 8601 timestamp.",
            remedy="Write it like 2026-03-01 or 2026-03-01T12:00:00Z.",
        ) from error


def plain(value: Any) -> Any:
    """Return any value of the daemon (dataclasses within) as JSON-ready plain values."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    return without_nan(value)
