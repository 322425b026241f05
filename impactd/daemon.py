"""The daemon: every part put together once, started and stopped in the right order.

::

    settings -> materials -> rig (digitizer, valve)
                             archive -> event bus
    rig + archive            -> acquisition service -> calibration runner
    archive                  -> job runner (worker processes)

`impactd.server` puts the REST API in front of it.
"""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

import base64
import threading
import uuid
from dataclasses import asdict
from typing import Any

import structlog

from analysis.base_models import BASE_MODELS
from analysis.errors import UnknownModelError
from impactd import __version__
from impactd.acquisition.service import AcquisitionService
from impactd.alarms import Alarms
from impactd.calibration.run import CalibrationRunner
from impactd.data_lock import DataLock
from impactd.events import EventBus
from impactd.jobs.orders import request_diagnosis, request_fit
from impactd.jobs.recordings import RecordingSets
from impactd.jobs.runner import JobRunner
from impactd.jobs.worker_process import WorkerLimits, run_apart
from impactd.moduli.control_chart import PairChart
from impactd.moduli.service import ModuliAnswer, ModuliService
from impactd.rig.build import build_rig
from impactd.rig.rig import Rig
from impactd.sd_notify import notify, watchdog_interval_s
from impactd.series.run import SeriesRunner
from impactd.settings.material_book import MaterialBook, MaterialChange, Role
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage import rescue
from impactd.storage.archive import Archive, ArchiveError
from impactd.storage.jobs import Job
from impactd.storage.recording_files import RECORDINGS_NAME

_log = structlog.get_logger("impactd.daemon")
_STATUS_EVERY_S = 2.0


class Daemon:
    """All parts that the REST API uses.

    Raises
    ------
    DataLockedError
        If another daemon serves the same data directory.
    ArchiveError
        If the archive cannot be opened.
    """

    def __init__(self, settings: Settings, *, own_options: str = "") -> None:
        self.settings = settings
        self.own_options = own_options
        self.lock = DataLock(settings.storage.directory)
        try:
            self.archive = Archive.open(
                settings.storage.directory,
                reserve_bytes=settings.storage.reserve_bytes,
                rescue_directory=settings.storage.rescue_directory,
            )
        except BaseException:
            self.lock.release()
            raise
        try:
            self.book = MaterialBook(settings.materials.file, settings.storage.directory)
        except BaseException:
            self.archive.close()
            self.lock.release()
            raise
        self.bus = EventBus(self.archive.events)
        try:
            # As first stated: a label that is corrected changes no simulated sphere.
            self.rig: Rig = build_rig(settings, self.book.first_stated())
        except BaseException:
            self.archive.close()
            self.lock.release()
            raise
        self.alarms = Alarms(self.bus, self.archive.alarms)
        publish = self.alarms.publish
        self.jobs = JobRunner(self.archive, settings, publish, materials=self.materials)
        self.service = AcquisitionService(self.rig, self.archive, settings, self.materials, publish)
        self._stopping = threading.Event()
        self.recordings = RecordingSets(
            self.archive, settings.jobs.fit_memory_bytes, self._stopping
        )
        self.calibrations = CalibrationRunner(self.service, self.archive, settings)
        self.series = SeriesRunner(self.service, settings, publish)
        self._moduli = ModuliService(self.archive)
        self._heart = Heart(self)

    @property
    def materials(self) -> Materials:
        """Spheres and surfaces as they are now."""
        return self.book.current

    def change_material(
        self, role: Role, name: str, entry: dict[str, Any], *, by: str, note: str
    ) -> MaterialChange:
        """Change or add a material for all drops and fits from now on; see `MaterialBook`."""
        made = self.book.change(role, name, entry, by=by, note=note)
        self.service.use_materials(self.book.current)
        self.jobs.use_materials(self.book.current)
        self.bus.publish("material.changed", {"role": role, "name": name, "by": by, "note": note})
        return made

    def start(self) -> None:
        """Start the worker, then the acquisition; interrupted drops are marked, never repeated."""
        self.calibrations.interrupt_unfinished()
        self._leave_mark()
        self.jobs.start()
        self.service.start()
        self._moduli.start(
            self.archive.models.active(), lambda: self.materials, self.jobs.wait_warm
        )

    def _leave_mark(self) -> None:
        """Leave a mark by which `impactd doctor` sees whether the rescue directory keeps files."""
        place = self.archive.rescue_directory
        if place is None:
            return
        try:
            rescue.leave_mark(place, self.archive.directory, uuid.uuid4().hex)
        except (OSError, ArchiveError) as error:
            _log.warning("the rescue directory takes no file", reason=str(error))

    def stop(self) -> None:
        """Make the valve safe first, then end everything else; safe to call twice."""
        steps = (
            self.service.stop,
            self._heart.stop,
            self.calibrations.stop,
            self.series.stop,
            self._moduli.stop,
            self._stopping.set,
            self.jobs.stop,
            self.rig.close,
            self.archive.close,
        )
        self.bus.close()
        for step in steps:
            try:
                step()
            except Exception:  # one part that cannot stop must not keep the others from stopping
                _log.exception("could not stop", part=getattr(step, "__qualname__", str(step)))
        self.lock.release()

    def announce(self, url: str) -> None:
        """Tell systemd and other commands that requests are answered from now on."""
        self.lock.tell(url=url)
        self._heart.start()

    def status(self) -> dict[str, Any]:
        """Return the status and its reasons.

        ``series`` is how far a calibration run is, ``None`` where none makes drops.
        """
        status = asdict(self.service.status())
        status["rig"] = {"name": self.rig.name, "simulated": self.rig.simulated}
        status["jobs_waiting"] = self.archive.jobs.waiting()
        status["active_model"] = self.archive.models.active()
        status["series"] = self.calibrations.progress()
        status["version"] = __version__
        return status

    def liveness(self) -> dict[str, bool]:
        """Return which parts answered lately; the watchdog is fed only while all do."""
        return {"acquisition": self.service.alive(), "jobs": self.jobs.alive()}

    def request_fit(self, shots: list[int], model: str, *, key: str | None) -> Job:
        """Ask the worker for a fit: one shot by itself, several together.

        A known idempotency ``key`` gives the old job.

        Raises
        ------
        UnknownModelError
            If this version does not know the model.
        NotFoundError
            If a shot is not there.
        """
        check_model(model)
        return request_fit(self.archive, shots, model, key=key)

    def request_diagnosis(
        self, shots: list[int], base: str, *, budget_s: float | None, key: str | None
    ) -> Job:
        """Ask the worker what a model misses on these shots; raise NotFoundError for a shot.

        It may search for ``budget_s`` once it runs. A known idempotency ``key`` gives the old job.
        """
        return request_diagnosis(self.archive, shots, base, budget_s=budget_s, key=key)

    def result_sheet(self, job: Job) -> bytes:
        """Return a finished diagnosis on one page, a PDF; a process of its own draws it."""
        assert job.result is not None
        jobs = self.settings.jobs
        made: str = run_apart(
            "impactd.jobs.tasks:result_sheet",
            [
                job.result["diagnosis"],
                job.payload.get(RECORDINGS_NAME) or f"Diagnosis {job.id}",
                job.finished_utc,
            ],
            WorkerLimits(jobs.fit_time_limit_s, jobs.fit_memory_bytes),
            self._stopping,
        )
        return base64.b64decode(made)

    def moduli(
        self, *, specimen: str | None, since: str | None, until: str | None, model: str | None
    ) -> ModuliAnswer:
        """Return what all stored fits together say about each material: ``impactd-moduli/1``.

        ``since`` is the first timestamp of a shot that counts, ``until`` the first that does not,
        in the archive's form. ``model`` is the active one unless it is named. Raises
        UnknownModelError if this version does not know it.
        """
        name = model or self.archive.models.active()
        check_model(name)
        return self._moduli.answer(
            self.materials, specimen=specimen, since=since, until=until, model=name
        )

    def charts(
        self, *, since: str | None, until: str | None, model: str | None
    ) -> dict[tuple[str, str], PairChart]:
        """Return the control chart of every pair; parameters as for `moduli`."""
        name = model or self.archive.models.active()
        check_model(name)
        return self._moduli.charts(since=since, until=until, model=name)

    def moduli_budget(
        self, *, specimen: str | None, since: str | None, until: str | None, model: str | None
    ) -> dict[str, Any]:
        """Return the uncertainty budget of each of these moduli: ``impactd-budget/1``.

        Raises UnknownModelError if this version does not know the model.
        """
        name = model or self.archive.models.active()
        check_model(name)
        return self._moduli.budget(
            self.materials, specimen=specimen, since=since, until=until, model=name
        )

    def models(self) -> list[dict[str, Any]]:
        """Return the base models, then every version of every named one, newest first."""
        bases: list[dict[str, Any]] = [
            {"name": name, "version": None, "about": about} for name, about in BASE_MODELS.items()
        ]
        return bases + [asdict(model) for model in self.archive.models.all()]

    def choose_model(self, name: str, *, version: int | None, by: str) -> None:
        """Choose the model that later fits use and results are reported with.

        It is a base model, or one that a diagnosis has named, in its latest ``version`` unless one
        is given.

        Raises
        ------
        UnknownModelError
            If this version of the program cannot build it.
        NotFoundError
            If no diagnosis has named such a model or version.
        """
        check_model(name)
        if name not in BASE_MODELS:
            version = self.archive.models.named(name, version).version
        elif version is not None:
            raise UnknownModelError(f"The base model {name} has no versions.")
        self.archive.models.set_active(name, version)
        self.bus.publish("model.chosen", {"name": name, "version": version, "by": by})


def check_model(name: str) -> None:
    """Raise `UnknownModelError`, with the names it knows, unless this version can build a model."""
    from analysis.model.impact_model import model_named

    model_named(name)


class Heart:
    """Tells systemd how the daemon is.

    The watchdog is fed only while acquisition loop, job runner and database answer: a daemon that
    merely still answers HTTP is not alive. The status line is the sentence of the status.
    """

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._told_ready = False

    def start(self) -> None:
        """Send READY=1, then go on in a thread."""
        self._told_ready = notify(ready="1", status=self._sentence())
        self._thread = threading.Thread(target=self._beat, name="heart", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Send STOPPING=1 and end."""
        if self._thread is None or self._end.is_set():
            return
        notify(stopping="1", status="Stopping.")
        self._end.set()
        self._thread.join(timeout=5.0)

    def _sentence(self) -> str:
        return self._daemon.service.status().sentence

    def _beat(self) -> None:
        pause_s = min(_STATUS_EVERY_S, watchdog_interval_s() or _STATUS_EVERY_S)
        told = ""
        while not self._end.wait(pause_s):
            try:
                sentence = self._sentence()
                if all(self._daemon.liveness().values()):
                    notify(watchdog="1")
                if not self._told_ready:
                    self._told_ready = notify(ready="1")
                if sentence != told and notify(status=sentence):
                    told = sentence
            except Exception:  # the watchdog must not miss a beat because of one error
                _log.exception("the daemon's health could not be checked")
