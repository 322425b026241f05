"""The results of finished jobs: fits and calibrations are written, drops get their next state.

Everything of one job that belongs together is one transaction: a drop is ``analysed`` only when its
fits can be read. The events come back to the caller: what is written is never undone because
somebody could not be told, and nobody is told twice because a write was tried again.
"""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

from impactd.aliases import Json
from impactd.jobs.orders import CALIBRATE, FIT_SHOT
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, Problem
from impactd.storage.drops import Drop
from impactd.storage.errors import NotFoundError
from impactd.storage.jobs import COMPARE, DIAGNOSE, Job
from impactd.storage.timestamp import utc_after

CANCELLED = "It was cancelled."
Told = tuple[str, Json]
"""Kind and data of an event."""


class ResultWriter:
    """Writes the results of jobs."""

    def __init__(self, archive: Archive, settings: Settings) -> None:
        self._archive = archive
        self._settings = settings

    def finish(self, job: Job, result: Json) -> list[Told]:
        """Write the result of a job; return the events of it."""
        if job.kind == CALIBRATE:
            return self._finish_calibration(job, result["calibration"])
        if job.kind == DIAGNOSE:
            return self._finish_diagnosis(job, result)
        if job.kind == COMPARE:
            return self._finish_comparison(job, result["comparison"])
        shot = job.payload["shot"] if job.kind == FIT_SHOT else None
        results = result["fits"] if job.kind == FIT_SHOT else [result["fit"]]
        with self._archive.transaction():
            fits = [
                self._archive.fits.add(shot, one["model"], one["calibration"], one, job=job.id)
                for one in results
            ]
            self._archive.jobs.finish(job.id, {"fits": [fit.id for fit in fits]})
            drop = self._drop(shot)
            if drop is not None and drop.state == "stored":
                self._archive.set_drop_state(drop.number, "analysed")
        events: list[Told] = []
        for fit in fits:
            told = {"id": fit.id, "job": job.id, "shot": shot, "model": fit.model}
            events.append(("fit.done", {**told, "outcome": fit.result["outcome"]["status"]}))
        if drop is not None:
            events.append(("drop.analysed", {"number": drop.number, "shot": shot}))
        return events

    def fail(self, job: Job, reason: str, *, retry: bool) -> list[Told]:
        """Write why a job gave no result; with ``retry`` it is tried once more."""
        # One transaction: whoever sees the job failed sees what waited for it failed, and a process
        # that dies here leaves no calibration fitting for ever.
        with self._archive.transaction():
            failed = self._archive.jobs.fail(job.id, reason, retry=retry)
            if failed.state != "queued":
                self._fail_what_waits(job, reason)
        told = {"job": job.id, "kind": job.kind, "subject": job.subject, "reason": reason}
        if failed.state == "queued":
            return [("job.retried", told)]
        if job.kind != CALIBRATE:
            return [("job.failed", told)]
        number = job.payload["calibration"]
        return [
            ("calibration.failed", {"number": number, "reason": reason}),
            ("job.failed", told),
        ]

    def _fail_what_waits(self, job: Job, reason: str) -> None:
        problem = Problem(
            type="fit-failed",
            title="Fit failed",
            status=500,
            detail=reason,
            remedy="The shot is safe. Look at its trace, then request another fit.",
        )
        if job.kind == CALIBRATE:
            self._archive.calibrations.fail(job.payload["calibration"], problem)
        elif job.kind == FIT_SHOT:
            drop = self._drop(job.payload["shot"])
            if drop is not None:
                self._archive.set_drop_state(drop.number, drop.state, problem)

    def _drop(self, shot: int | None) -> Drop | None:
        if shot is None:
            return None
        try:
            return self._archive.drop(shot)
        except NotFoundError:  # an import has no drop
            return None

    def _finish_diagnosis(self, job: Job, result: Json) -> list[Told]:
        found = result["diagnosis"]
        model, named = None, None
        with self._archive.transaction():
            # Recordings of another instrument name no model of this rig.
            if found["accepted_model"] is not None and found["shot_numbers"]:
                provenance = {
                    "diagnosis": job.id,
                    "verdict": found["verdict"],
                    "shots": found["shot_numbers"],
                    "file_sha256": found["file_sha256"],
                    "software": found["software"],
                }
                named = self._archive.models.add(found["accepted_model"], provenance)
                model = {"name": named.name, "version": named.version}
            done = self._archive.jobs.finish(job.id, {**result, "model": model})
            self._archive.diagnoses.publish(done, named)
        told = {"id": job.id, "verdict": found["verdict"], "sentence": found["sentence"]}
        return [("diagnosis.done", {**told, "model": model})]

    def _finish_comparison(self, job: Job, found: Json) -> list[Told]:
        shot = job.payload["shot"]
        with self._archive.transaction():
            self._archive.comparisons.add(shot, found)
            self._archive.jobs.finish(job.id, found)
        told = {key: found[key] for key in ("shots", "sentence", "likely")}
        return [("shot.unlike", {"number": shot, **told})] if found["unlike"] else []

    def cancel(self, job: Job) -> list[Told]:
        """Write that a running job was cancelled."""
        self._archive.jobs.cancelled(job.id, CANCELLED)
        return [("job.cancelled", {"job": job.id, "kind": job.kind, "subject": job.subject})]

    def _finish_calibration(self, job: Job, result: Json) -> list[Told]:
        number = job.payload["calibration"]
        outcome = result["outcome"]
        if outcome["status"] != "converged":
            return self.fail(
                job, f"The calibration {outcome['status']}: {outcome['message']}", retry=False
            )
        previous = self._archive.calibrations.current()
        if previous is not None and previous.result is not None:
            from analysis.cell_drift import drift

            moved = drift(previous.result, result)
            result = {**result, "drift": {**moved, "against": previous.number}}
        valid_until = utc_after(self._settings.calibration.validity_days)
        with self._archive.transaction():
            self._archive.calibrations.finish(number, result, valid_until)
            self._archive.jobs.finish(job.id, {"calibration": number})
        return [("calibration.done", {"number": number, "valid_until_utc": valid_until})]
