"""Diagnoses: closing the loop on stored shots. Not yet there."""

from __future__ import annotations

from typing import Any, NoReturn

from fastapi import APIRouter

from impactd.api.problems import ProblemError
from impactd.api.schemas import DiagnosisBody, Number

router = APIRouter(prefix="/v1/diagnoses", tags=["diagnoses"])


@router.post("", status_code=202)
def request_diagnosis(body: DiagnosisBody) -> dict[str, Any]:
    """Ask why a model does not fit; 501 until the loop is in."""
    raise ProblemError(
        "not-yet",
        f"Diagnosing {len(body.shots)} shot(s) from the base {body.base} is not there yet.",
    )


@router.get("/{diagnosis_id}")
def show_diagnosis(diagnosis_id: Number) -> dict[str, Any]:
    """Show a diagnosis."""
    _none(diagnosis_id)


@router.get("/{diagnosis_id}/report.html")
def report(diagnosis_id: Number) -> dict[str, Any]:
    """Show a diagnosis as a page."""
    _none(diagnosis_id)


def _none(diagnosis_id: int) -> NoReturn:
    raise ProblemError("not-found", f"There is no diagnosis {diagnosis_id}.")
