"""From a job in the queue to a fit beside the shot."""

from __future__ import annotations

import importlib.util
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from impactd.jobs.orders import request_calibration_fit, request_diagnosis, request_fit
from impactd.jobs.runner import JobRunner
from impactd.storage.archive import ArchiveError, NotFoundError
from impactd.storage.campaign_folder import read_campaign

HERE = Path(__file__).parent
SHARED = Path(__file__).resolve().parents[4] / "shared"
Running = Callable[[JobRunner], JobRunner]
FIT = {"model": "kv", "calibration": None, "outcome": {"status": "converged", "message": "ok"}}


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fault_tasks", HERE / "fault_tasks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tasks = _load()


def test_a_stored_shot_is_fitted_with_every_base_model(bench: Any, running: Running) -> None:
    """A fit_shot job ends with a fit of each base model, an analysed drop and the events."""
    number = bench.store()
    runner = running(bench.runner())
    job = bench.archive.jobs.enqueue("fit_shot", {"shot": number}, f"shot {number}")

    done = bench.wait(job.id)

    assert done.state == "done", done.reason
    fits = bench.archive.fits.for_shot(number)
    assert [fit.model for fit in fits] == ["hsd", "kv", "kv2"]
    assert bench.archive.drop(number).state == "analysed"
    for fit in fits:
        result = fit.result
        assert result["file_sha256"] == [bench.archive.shot(number).sha256]
        assert result["software"].startswith("impactd ")
        assert result["calibration"] is None
        assert result["outcome"]["status"] in ("converged", "not_converged", "not_evaluable")
        assert 0.5 < result["restitution_prior"]["value"] < 0.8
    assert runner.alive()
    assert bench.kinds(5) == [
        "job.started",
        "fit.done",
        "fit.done",
        "fit.done",
        "drop.analysed",
    ]


@pytest.mark.parametrize(
    ("task", "reason", "kinds"),
    [
        ("leaves", "exit code 3", ["job.started", "job.retried", "job.started", "job.failed"]),
        ("raises", "the sphere has no mass", ["job.started", "job.failed"]),
        ("hangs", "3 s", ["job.started", "job.retried", "job.started", "job.failed"]),
    ],
)
def test_a_job_that_cannot_be_done_fails_with_the_reason(
    bench: Any,
    running: Running,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    task: str,
    reason: str,
    kinds: list[str],
) -> None:
    """Lost workers are tried once more, errors are not; the shot stays stored and says why."""
    monkeypatch.setenv("FAULT_TASKS_CHILD", str(tmp_path / "pid"))
    number = bench.store()
    running(
        bench.runner(
            tasks={"fit_shot": getattr(tasks, task), "fit_campaign": tasks.well},
            import_paths=[HERE],
        )
    )

    job = bench.wait(bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1").id)

    assert job.state == "failed"
    assert reason in str(job.reason)
    assert bench.kinds(len(kinds)) == kinds
    drop = bench.archive.drop(number)
    assert (drop.state, drop.problem.type) == ("stored", "fit-failed")
    assert reason in drop.problem.detail


def test_a_crash_that_happens_once_is_mended_by_the_second_try(
    bench: Any, running: Running, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The retried job is done, and its result is written."""
    monkeypatch.setattr(
        "impactd.jobs.runner.order_for",
        lambda *_: {"mark": str(tmp_path / "mark"), "fits": []},
    )
    number = bench.store()
    running(bench.runner(tasks={"fit_shot": tasks.crashes_once}, import_paths=[HERE]))

    job = bench.wait(bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1").id)

    assert (job.state, job.attempts) == ("done", 2)


def test_a_job_of_an_unknown_kind_or_shot_fails_and_the_queue_goes_on(
    bench: Any, running: Running
) -> None:
    """Jobs that cannot even be started are failed with a sentence."""
    running(bench.runner(tasks={"fit_shot": tasks.well}, import_paths=[HERE]))

    unknown = bench.wait(bench.archive.jobs.enqueue("dance", {}, "x").id)
    missing = bench.wait(bench.archive.jobs.enqueue("fit_shot", {"shot": 99}, "shot 99").id)

    assert "dance" in str(unknown.reason)
    assert "shot 99" in str(missing.reason)


def test_stopping_gives_a_running_job_back(bench: Any) -> None:
    """A job that runs when the daemon stops waits again, without losing an attempt."""
    number = bench.store()
    runner = bench.runner(tasks={"fit_shot": tasks.slow}, import_paths=[HERE])
    runner.start()
    job = bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1")
    while "job.progress" not in [kind for kind, _ in bench.events]:
        time.sleep(0.01)

    runner.stop()

    given_back = bench.archive.jobs.get(job.id)
    assert (given_back.state, given_back.attempts) == ("queued", 0)
    assert not runner.alive()


def test_a_corrupt_shot_fails_its_fit_by_name(bench: Any, running: Running) -> None:
    """The worker checks the SHA-256 of what it reads."""
    number = bench.store()
    path = bench.archive.shot_path(number)
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    running(bench.runner())

    job = bench.wait(bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1").id)

    assert job.state == "failed"
    assert "SHA-256" in str(job.reason)


def test_a_request_without_shots_or_with_unknown_ones_is_refused(bench: Any) -> None:
    """Such a request never becomes a job."""
    with pytest.raises(ArchiveError):
        request_fit(bench.archive, [], "kv")
    with pytest.raises(NotFoundError):
        request_fit(bench.archive, [7], "kv")
    assert bench.archive.jobs.waiting() == 0


def test_the_shared_campaign_is_fitted_from_the_archive(bench: Any, running: Running) -> None:
    """Imported shots of a real campaign give the specimen's modulus, with its own load cell."""
    folder = SHARED / "campaigns" / "clean"
    if not folder.exists():
        pytest.skip(f"{folder} is not here")
    numbers = bench.archive.import_campaign(folder).numbers
    running(
        JobRunner(
            bench.archive,
            bench.settings.model_copy(
                update={"jobs": bench.settings.jobs.model_copy(update={"fit_time_limit_s": 100.0})}
            ),
            lambda *_: None,
            materials=bench.materials,
        )
    )

    job = bench.wait(request_fit(bench.archive, list(numbers), "kv").id)

    assert job.state == "done", job.reason
    (fit,) = bench.archive.fits.of_job(job.id)
    assert fit.result["outcome"]["status"] == "converged"
    assert fit.result["moduli"]["specimen"]["status"] == "fitted"
    assert len(fit.result["shots"]) == len(read_campaign(folder).shots)


def test_a_calibration_without_shots_fails_with_a_sentence(bench: Any, running: Running) -> None:
    """A run whose drops all failed is a failed calibration, not a hanging one."""
    bench.archive.calibrations.begin(None, [], "timer")
    running(bench.runner(tasks={"calibrate": tasks.well}, import_paths=[HERE]))

    job = bench.wait(request_calibration_fit(bench.archive, 1).id)

    assert job.state == "failed"
    calibration = bench.archive.calibrations.get(1)
    assert calibration.state == "failed"
    assert "no stored shot" in calibration.problem.detail


def test_a_calibration_is_written_with_its_end(bench: Any, running: Running) -> None:
    """Drops of reference pairs end in a calibration with a validity, or in a stated failure."""
    bench.archive.calibrations.begin(None, [], "timer")
    for surface in ("aluminium", "polycarbonate"):
        bench.store(surface=surface, calibration=1)
    running(bench.runner())

    job = bench.wait(request_calibration_fit(bench.archive, 1).id)

    calibration = bench.archive.calibrations.get(1)
    if job.state == "done":
        assert calibration.state == "done"
        assert calibration.valid_until_utc > calibration.finished_utc
        assert (bench.archive.directory / "calibrations" / "000001.json").is_file()
        assert bench.archive.calibrations.current() == calibration
    else:
        assert calibration.state == "failed"
        assert calibration.problem.detail == job.reason


def test_a_running_job_is_ended_when_nobody_wants_it_any_more(
    bench: Any, running: Running, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cancelled while it hangs, never tried again; the next job finds a worker."""
    monkeypatch.setenv("FAULT_TASKS_CHILD", str(tmp_path / "pid"))
    runner = running(
        bench.runner(tasks={"diagnose": tasks.hangs, "fit_shot": tasks.raises}, import_paths=[HERE])
    )
    number = bench.store()
    job = request_diagnosis(bench.archive, [number], "kv")
    bench.kinds(1)  # it has started

    runner.cancel(job.id)

    ended = bench.wait(job.id)
    assert (ended.state, ended.attempts) == ("cancelled", 1)
    assert bench.kinds(2) == ["job.started", "job.cancelled"]
    assert runner.cancel(job.id).state == "cancelled"
    after = bench.wait(request_fit(bench.archive, [number], "kv").id)
    assert "the sphere has no mass" in after.reason


def test_a_waiting_job_is_cancelled_without_being_started(bench: Any) -> None:
    """Nothing runs yet, so nothing has to be ended."""
    runner = bench.runner(tasks={"diagnose": tasks.well}, import_paths=[HERE])
    job = request_diagnosis(bench.archive, [bench.store()], "kv")
    assert runner.cancel(job.id).state == "cancelled"
    assert bench.archive.jobs.claim() is None


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an archive that is opened afterwards wait for its index only this long."""
    monkeypatch.setattr("impactd.storage.index.BUSY_TIMEOUT_S", 0.1)


@contextmanager
def locked(bench: Any) -> Iterator[None]:
    """Hold the index's write lock from another connection, as `impactd token create` could."""
    with closing(sqlite3.connect(bench.archive.directory / "index.sqlite")) as other:
        other.isolation_level = None
        other.execute("BEGIN IMMEDIATE")
        yield
        other.execute("ROLLBACK")


def _until_stuck(runner: JobRunner) -> None:
    deadline = time.monotonic() + 60
    while not runner._writes.stuck:
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("task", "state", "kinds"),
    [
        ("well", "done", ["job.started", "fit.done", "drop.analysed"]),
        ("raises", "failed", ["job.started", "job.failed"]),
    ],
)
@pytest.mark.usefixtures("impatient")
def test_the_end_of_a_job_is_written_once_the_index_takes_it(
    bench: Any, running: Running, *, task: str, state: str, kinds: list[str]
) -> None:
    """An index locked for longer than its timeout delays a job's end, and tells it once."""
    number = bench.store()
    gate = bench.archive.directory / "gate"
    runner = running(
        bench.runner(
            tasks={"fit_shot": tasks.at_the_gate, "fit_campaign": tasks.well}, import_paths=[HERE]
        )
    )
    order = {"gate": str(gate), "then": task, "fits": [{**FIT, "shot": number}]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("impactd.jobs.runner.order_for", lambda *_: order)
        job = bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1")
        bench.kinds(1)
        with locked(bench):
            gate.touch()
            _until_stuck(runner)
            assert bench.archive.jobs.get(job.id).state == "running"
            assert runner.alive()
        done = bench.wait(job.id)

    assert done.state == state, done.reason
    assert bench.kinds(len(kinds)) == kinds
    assert len(bench.archive.fits.of_job(job.id)) == (state == "done")


@pytest.mark.usefixtures("impatient")
def test_an_end_that_cannot_be_written_until_the_stop_lets_the_job_wait_again(
    bench: Any, running: Running
) -> None:
    """The next process that opens the archive finds the job queued; the runner ends nonetheless."""
    number = bench.store()
    gate = bench.archive.directory / "gate"
    runner = running(bench.runner(tasks={"fit_shot": tasks.at_the_gate}, import_paths=[HERE]))
    order = {"gate": str(gate), "then": "well", "fits": [{**FIT, "shot": number}]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("impactd.jobs.runner.order_for", lambda *_: order)
        job = bench.archive.jobs.enqueue("fit_shot", {"shot": number}, "shot 1")
        bench.kinds(1)
        with locked(bench):
            gate.touch()
            _until_stuck(runner)
            runner.stop()
    assert bench.archive.jobs.get(job.id).state == "running"

    with bench.archive.transaction():  # as it is for a process that is not ours
        bench.archive._index.write("UPDATE jobs SET runner='1:1'")
    bench.archive.jobs.requeue_abandoned()

    assert bench.archive.jobs.get(job.id).state == "queued"
