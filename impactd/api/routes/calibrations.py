"""Calibrations of the load cell: asking for a run, its history, the one in force."""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from impactd.api.answers import calibration_answer, next_page
from impactd.api.arrivals import Accepted
from impactd.api.client_keys import CALIBRATION, job_key
from impactd.api.problems import ProblemError
from impactd.api.routes.drops import required_key
from impactd.api.schemas import Before, CalibrationBody, Key, Limit, Number
from impactd.api.security import TheCaller, TheDaemon
from impactd.storage.calibrations import DROPS, Calibration
from impactd.wire.rig_answers import CalibrationAnswer, CalibrationPage

router = APIRouter(prefix="/v1/calibrations", tags=["calibrations"])


@router.post("", status_code=202)
def request_calibration(  # noqa: PLR0917 - the framework fills them by name
    body: CalibrationBody,
    response: Response,
    daemon: TheDaemon,
    caller: TheCaller,
    accepted: Accepted,
    key: Key = None,
) -> CalibrationAnswer:
    """Ask for a calibration run: a series of drops of reference spheres, then a joint fit.

    The same slot never runs twice. Unattended runs are refused unless the rig is declared safe.
    With `static_weights` nothing moves: the readings give the gain at once, as a record of its
    own kind that never takes the place of a calibration with drops.
    """
    if body.method == "static_weights":
        from analysis.static_calibration import Reading
        from impactd.calibration.weights import Weighing, calibrate_with_weights

        assert body.readings is not None, "the body was checked"
        assert body.hold_time_s is not None, "the body was checked"
        weighed = calibrate_with_weights(
            daemon.archive,
            daemon.settings,
            Weighing(
                tuple(Reading(r.mass_kg, r.volts, r.u_volts) for r in body.readings),
                body.hold_time_s,
                body.discharge_time_constant_s,
            ),
            slot=body.slot or job_key(caller, CALIBRATION, key),
            owner=caller.name,
        )
        response.headers["Location"] = f"/v1/calibrations/{weighed.number}"
        return calibration_answer(weighed)
    slot = body.slot or job_key(caller, CALIBRATION, required_key(key, "run a series of drops"))
    plan = None if body.plan is None else [item.model_dump() for item in body.plan]
    calibration = daemon.calibrations.request(
        plan, slot=slot, owner=caller.name, unattended=body.unattended, accepted=accepted
    )
    response.headers["Location"] = f"/v1/calibrations/{calibration.number}"
    return calibration_answer(calibration)


@router.get("")
def list_calibrations(
    daemon: TheDaemon, limit: Limit = 50, before: Before = None
) -> CalibrationPage:
    """List calibrations, newest first."""
    found = daemon.archive.calibrations.list(limit=limit, before=before)
    numbers = [calibration.number for calibration in found]
    return CalibrationPage(
        items=[calibration_answer(calibration) for calibration in found],
        series=_series(found),
        next=next_page("/v1/calibrations", numbers, limit, {}),
    )


def _series(newest_first: list[Calibration]) -> list[dict[str, Any]]:
    done = [
        one
        for one in reversed(newest_first)
        if one.kind == DROPS and one.result and not one.problem
    ]
    results = [one.result for one in done if one.result is not None]
    from analysis.cell_drift import drift_series

    return [
        {
            "number": one.number,
            "finished_utc": one.finished_utc,
            "valid_until_utc": one.valid_until_utc,
            **entry,
        }
        for one, entry in zip(done, drift_series(results), strict=True)
    ]


@router.get("/current")
def current_calibration(daemon: TheDaemon) -> CalibrationAnswer:
    """Show the calibration in force; `valid_until_utc` says when the next one is due."""
    calibration = daemon.archive.calibrations.current()
    if calibration is None:
        raise ProblemError(
            "not-found",
            "The load cell has not been calibrated on this rig yet.",
            remedy="Run `impactd calibrate`.",
        )
    return calibration_answer(calibration)


@router.get("/{calibration_id}")
def show_calibration(calibration_id: Number, daemon: TheDaemon) -> CalibrationAnswer:
    """Show one calibration run."""
    return calibration_answer(daemon.archive.calibrations.get(calibration_id))
