"""From a job of the queue to an order that a worker can carry out without the archive.

An order is JSON: paths and hashes of the shots, and everything that is known today of materials,
load cell and release. It is made when the job is started, so a fit always uses the calibration in
force at that moment and says which.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from analysis.base_models import BASE_MODELS, DEFAULT_BASE
from analysis.calibration_document import sensor_from_json
from analysis.campaign import Sensor
from impactd.aliases import Json
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError, Calibration, Shot
from impactd.storage.errors import NotFoundError
from impactd.storage.jobs import COMPARE, DIAGNOSE, Job
from impactd.storage.materials_json import sensor_to_json, sphere_to_json, surface_to_json
from impactd.storage.timestamp import utc_after

FIT_SHOT = "fit_shot"
FIT_CAMPAIGN = "fit_campaign"
CALIBRATE = "calibrate"
SHOT_MODELS = tuple(BASE_MODELS)
"""All three are fitted to every shot: what a rigid cell and the paper's ringing one make of it, and
the closed model that moduli are stated with."""

SESSION_DAYS = 0.5
"""What is older is of another session: a cell set up anew, a room of another temperature."""
SESSION_SHOTS, REPETITIONS = 120, 8
"""The newest that a shot is held against, in all and of one condition: more tell little more."""


def request_fit(archive: Archive, shots: list[int], model: str, *, key: str | None = None) -> Job:
    """Ask for a fit: one shot by itself, several together.

    The caller has checked that the analysis knows the ``model``. A known idempotency ``key`` gives
    the old job.

    Raises
    ------
    NotFoundError
        If a shot does not exist.
    ArchiveError
        If there is no shot in the list.
    IdempotencyConflictError
        If the key belongs to another request.
    """
    if not shots:
        raise ArchiveError("A fit needs at least one shot.")
    for number in shots:
        archive.shot(number)
    if len(shots) == 1:
        payload: Json = {"shot": shots[0], "models": [model]}
        return archive.jobs.enqueue(FIT_SHOT, payload, f"shot {shots[0]}", key=key)
    payload = {"shots": shots, "model": model}
    subject = f"shots {', '.join(map(str, shots[:5]))}{' ...' if len(shots) > 5 else ''}"
    return archive.jobs.enqueue(FIT_CAMPAIGN, payload, subject, key=key)


def request_diagnosis(
    archive: Archive,
    shots: list[int],
    base: str,
    *,
    budget_s: float | None = None,
    key: str | None = None,
) -> Job:
    """Ask why a model does not fit.

    It may search for ``budget_s`` once it runs. A known idempotency ``key`` gives the old job.

    Raises
    ------
    NotFoundError
        If a shot does not exist.
    IdempotencyConflictError
        If the key belongs to another request.
    """
    for number in shots:
        archive.shot(number)
    subject = f"{len(shots)} shot{'s' * (len(shots) > 1)} from the base {base}"
    payload: Json = {"shots": shots, "base": base}
    if budget_s is not None:
        payload["budget_s"] = budget_s
    return archive.jobs.enqueue(DIAGNOSE, payload, subject, key=key)


def request_calibration_fit(archive: Archive, calibration: int) -> Job:
    """Ask for the joint fit of a calibration run whose drops are all stored."""
    payload = {"calibration": calibration}
    return archive.jobs.enqueue(CALIBRATE, payload, f"calibration {calibration}")


def order_for(job: Job, archive: Archive, settings: Settings, materials: Materials) -> Json:
    """Return what the worker needs for a job, JSON-ready.

    Raises ArchiveError if a shot is not there, or there is nothing to fit.
    """
    if job.kind == COMPARE:
        return _comparison_order(archive.shot(job.payload["shot"]), archive, settings)
    if "campaign" in job.payload:
        given = {key: job.payload.get(key) for key in ("base", "budget_s")}
        return {**given, "campaign": str((archive.directory / job.payload["campaign"]).resolve())}
    numbers = _numbers(job, archive)
    if not numbers:
        raise ArchiveError(f"{job.subject}: there is no stored shot to fit.")
    models = list(job.payload.get("models") or shot_models(archive))
    model = job.payload.get("model") or _calibration_model(job, archive)
    # A diagnosis starts from the certificate too: a calibration made under the model in question
    # would vouch for it.
    calibrated = job.kind not in (CALIBRATE, DIAGNOSE)
    return {
        **_knowledge(archive, settings, materials, with_calibration=calibrated),
        "shots": [_where(archive, archive.shot(number)) for number in numbers],
        "models": models,
        "model": model,
        "base": job.payload.get("base", DEFAULT_BASE),
        "budget_s": job.payload.get("budget_s"),
        "definitions": _definitions(archive, [*models, model]),
        # For drawing. A re-fit of a whole archive keeps none: they would double its size.
        "with_curves": True,
    }


def _comparison_order(shot: Shot, archive: Archive, settings: Settings) -> Json:
    """Return a new shot and its repetitions, without the materials."""
    since = utc_after(-SESSION_DAYS)
    session = archive.shots(since=since, before=shot.number, limit=SESSION_SHOTS)
    by_condition: dict[Any, list[Shot]] = {}
    for one in session:
        if one.source == shot.source:
            condition = one.sphere, one.surface, one.drop_height_m
            by_condition.setdefault(condition, []).append(one)
    earlier = [one for group in by_condition.values() for one in _alike(archive, group)]
    return {
        "shot": _compared(archive, shot),
        "earlier": [_compared(archive, one) for one in sorted(earlier, key=lambda one: one.number)],
        "speed_repeatability": settings.release.speed_repeatability,
    }


def _alike(archive: Archive, group: Sequence[Shot]) -> list[Shot]:
    """Return the newest shots of one condition, without the odd ones unless these are many."""
    unlike = {
        one.number for one in group if (archive.comparisons.get(one.number) or {}).get("unlike")
    }
    few = 2 * len(unlike) < len(group)
    return [one for one in group if not few or one.number not in unlike][:REPETITIONS]


def _compared(archive: Archive, shot: Shot) -> Json:
    path = (archive.directory / shot.file).resolve()
    place = {"number": shot.number, "path": str(path), "sha256": shot.sha256}
    return {**place, "drop_height_m": shot.drop_height_m}


def shot_models(archive: Archive) -> tuple[str, ...]:
    """Return the models that every shot is fitted with, in order: the bases, the active one."""
    active = archive.models.active()
    return SHOT_MODELS if active in SHOT_MODELS else (*SHOT_MODELS, active)


def _calibration_model(job: Job, archive: Archive) -> str:
    """Return the active model where it has a crystal to calibrate, else the default base."""
    active = archive.models.active()
    has_crystal = active.split("+")[0] != "hsd"
    return active if job.kind == CALIBRATE and has_crystal else DEFAULT_BASE


def _definitions(archive: Archive, names: Sequence[str]) -> Json:
    """Return the definitions of the named models among these, by name."""
    found = {}
    for name in set(names) - set(SHOT_MODELS):
        version = archive.models.active_version() if name == archive.models.active() else None
        try:
            model = archive.models.named(name, version)
        except NotFoundError:  # made up of library effects by whoever asked: fitted without priors
            continue
        found[name] = {**model.definition, "version": model.version}
    return found


def order_without_shots(
    archive: Archive, settings: Settings, materials: Materials, models: Sequence[str]
) -> Json:
    """Return an order for single-shot fits that lacks only ``shots``; see `shot_places`.

    Equal knowledge gives equal orders.
    """
    known = _knowledge(archive, settings, materials, with_calibration=True)
    return {**known, "models": list(models), "definitions": _definitions(archive, models)}


def shot_places(archive: Archive, numbers: Sequence[int]) -> list[Json]:
    """Return an order's ``shots``: the path of each file and the SHA-256 it must have."""
    return [_where(archive, archive.shot(number)) for number in numbers]


def _knowledge(
    archive: Archive, settings: Settings, materials: Materials, *, with_calibration: bool
) -> Json:
    """Return what is known today of the cell, the release and the materials."""
    # A calibration starts from the certificate, not from the last calibration: were that a prior,
    # a drifting cell would hide its own drift.
    calibration = archive.calibrations.current() if with_calibration else None
    return knowledge(calibration, settings, materials)


def knowledge(calibration: Calibration | None, settings: Settings, materials: Materials) -> Json:
    """Return what a fit is told of the cell, the release and the materials, as part of an order.

    Without a calibration the cell is that of the certificate.
    """
    known = settings.sensor.sensor()
    if calibration is not None and calibration.result is not None:
        known = calibrated(calibration.result, known)
    return {
        "sensor": sensor_to_json(known),
        "calibration": None if calibration is None else calibration.number,
        "gravity_m_per_s2": settings.release.gravity_m_per_s2,
        "speed_repeatability": settings.release.speed_repeatability,
        "height_offset_u_m": settings.release.height_offset_u_m,
        "materials_version": materials.version,
        "spheres": {name: sphere_to_json(one) for name, one in materials.spheres.items()},
        "surfaces": {name: surface_to_json(one) for name, one in materials.surfaces.items()},
    }


def calibrated(result: Json, certificate: Sensor) -> Sensor:
    """Return the cell of a calibration; values it did not fit are the certificate's."""
    found = sensor_from_json(result)
    if found.hsd_n_per_v is not None or certificate.hsd_n_per_v is None:
        return found
    return Sensor(
        compliance_m_per_v=found.compliance_m_per_v,
        crystal_mass_kg=found.crystal_mass_kg,
        crystal_stiffness_n_per_m=found.crystal_stiffness_n_per_m,
        crystal_damping_n_s_per_m=found.crystal_damping_n_s_per_m,
        hsd_n_per_v=certificate.hsd_n_per_v,
        covariance=found.covariance,
        inputs=found.inputs,
    )


def _numbers(job: Job, archive: Archive) -> list[int]:
    if job.kind == CALIBRATE:
        calibration = archive.calibrations.get(job.payload["calibration"])
        drops = [archive.drop(number) for number in calibration.drops]
        return [drop.shot for drop in drops if drop.shot is not None]
    if job.kind == FIT_SHOT:
        return [job.payload["shot"]]
    return list(job.payload["shots"])


def _where(archive: Archive, shot: Shot) -> Json:
    path = archive.directory / shot.file
    found: Json = {"number": shot.number, "path": str(path.resolve()), "sha256": shot.sha256}
    try:
        drop = archive.drop(shot.number)
    except NotFoundError:  # an import has no drop
        return found
    if drop.rebound_height_m is not None:
        found["rebound_height_m"] = {"value": drop.rebound_height_m, "u": drop.u_rebound_height_m}
    return found
