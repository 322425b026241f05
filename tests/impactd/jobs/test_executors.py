"""Workers that crash, hang and grow for real, and the others that do not notice."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from impactd.jobs.errors import (
    StoppedError,
    TaskFailedError,
    TaskMemoryError,
    TaskTimeoutError,
    WorkerCrashedError,
)
from impactd.jobs.executors import WorkerExecutor
from impactd.jobs.worker_process import WorkerLimits, spare_cores

HERE = Path(__file__).parent
LIVELINESS_S = 60.0


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fault_tasks", HERE / "fault_tasks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tasks = _load()


@pytest.fixture(scope="module")
def executor() -> Iterator[WorkerExecutor]:
    """Return one worker that may take three seconds and 300 MB."""
    made = WorkerExecutor(WorkerLimits(3.0, 300_000_000), import_paths=[HERE])
    assert made.wait_warm(LIVELINESS_S)
    yield made
    made.shutdown()


def _pid(executor: WorkerExecutor) -> int:
    found = executor.submit(tasks.well, {}).result(LIVELINESS_S)["pid"]
    assert isinstance(found, int)
    return found


def test_a_result_comes_back_from_another_process(executor: WorkerExecutor) -> None:
    """The order arrives as it was, in a process that stays warm for the next one."""
    result = executor.submit(tasks.well, {"a": [1, None, "x"]}).result(LIVELINESS_S)

    assert result["order"] == {"a": [1, None, "x"]}
    assert result["pid"] not in (os.getpid(), None)
    assert _pid(executor) == result["pid"]


@pytest.mark.parametrize("cores", [1, 2])
def test_a_task_uses_the_cores_it_may_and_one_for_linear_algebra(cores: int) -> None:
    """A fit spreads its own work over them."""
    executor = WorkerExecutor(WorkerLimits(60.0, 10**9, cores), import_paths=[HERE])
    try:
        said = executor.submit(tasks.counts_cores, {}).result(LIVELINESS_S)
    finally:
        executor.shutdown()
    assert said == {"cores": cores, "blas": "1"}


def test_one_core_is_left_to_the_sample_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers share the others, and each has one at least."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    assert [spare_cores(workers) for workers in (1, 2, 3, 7, 20)] == [7, 3, 2, 1, 1]
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert spare_cores(1) == 1


@pytest.mark.parametrize(
    ("task", "error", "words"),
    [
        ("leaves", WorkerCrashedError, "exit code 3"),
        ("segfaults", WorkerCrashedError, "SIGSEGV"),
        ("eats_in_a_leap", TaskMemoryError, "300 MB"),
        ("eats_bit_by_bit", TaskMemoryError, "300 MB"),
    ],
)
def test_a_lost_worker_is_told_and_replaced(
    executor: WorkerExecutor, task: str, error: type[Exception], words: str
) -> None:
    """The future says how it ended; a task that waited behind it is done by a new process."""
    before = _pid(executor)

    bad = executor.submit(getattr(tasks, task), {})
    behind = executor.submit(tasks.well, {"number": 2})

    with pytest.raises(error, match=words):
        bad.result(LIVELINESS_S)
    result = behind.result(LIVELINESS_S)
    assert result["order"] == {"number": 2}
    assert result["pid"] != before


def test_a_hanging_task_is_killed_with_its_children(
    executor: WorkerExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the time limit neither the worker nor what it started is there any more."""
    monkeypatch.setenv("FAULT_TASKS_CHILD", str(tmp_path / "pid"))
    with pytest.raises(WorkerCrashedError):  # a new worker sees the new environment
        executor.submit(tasks.leaves, {}).result(LIVELINESS_S)

    with pytest.raises(TaskTimeoutError, match="3 s"):
        executor.submit(tasks.hangs, {}).result(LIVELINESS_S)

    child = int((tmp_path / "pid").read_text())
    deadline = time.monotonic() + LIVELINESS_S
    while _runs(child) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not _runs(child)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_an_ordinary_error_costs_no_worker(executor: WorkerExecutor) -> None:
    """A task that raises tells its kind and words; the process lives on."""
    before = _pid(executor)

    with pytest.raises(TaskFailedError, match="the sphere has no mass") as caught:
        executor.submit(tasks.raises, {}).result(LIVELINESS_S)

    assert caught.value.kind == "ValueError"
    with pytest.raises(TaskFailedError, match="JSON"):
        executor.submit(tasks.no_json, {}).result(LIVELINESS_S)
    assert _pid(executor) == before


def test_what_a_task_prints_does_not_disturb(executor: WorkerExecutor) -> None:
    """Output of libraries does not end up between the answers."""
    assert executor.submit(tasks.prints, {"a": 1}).result(LIVELINESS_S) == {"a": 1}


def test_two_workers_work_at_once_and_one_crash_harms_no_other() -> None:
    """While one worker dies, the other finishes what it was doing."""
    heard: list[str] = []
    executor = WorkerExecutor(
        WorkerLimits(20.0, 300_000_000),
        workers=2,
        import_paths=[HERE],
        on_progress=lambda _future, text, _share: heard.append(text),
    )
    try:
        going = executor.submit(tasks.slow, {"number": 1})
        crashing = executor.submit(tasks.segfaults, {})

        with pytest.raises(WorkerCrashedError):
            crashing.result(LIVELINESS_S)
        assert going.result(LIVELINESS_S) == {"number": 1}
        assert heard
    finally:
        executor.shutdown()


def test_what_is_new_is_told_at_once_and_how_far_it_is_now_and_then() -> None:
    """A short step does not hide the one behind it, which may take minutes."""
    heard: list[str] = []
    executor = WorkerExecutor(
        WorkerLimits(20.0, 300_000_000),
        import_paths=[HERE],
        on_progress=lambda _future, text, _share: heard.append(text),
    )
    try:
        executor.submit(tasks.hurries, {}).result(LIVELINESS_S)
    finally:
        executor.shutdown()
    assert list(dict.fromkeys(heard)) == ["first", "second", "third"]
    assert len(heard) < 100


def test_a_shutdown_ends_running_and_waiting_tasks() -> None:
    """Both say that they were stopped, no process is left, and nothing more is taken."""
    executor = WorkerExecutor(WorkerLimits(60.0, 300_000_000), import_paths=[HERE])
    running, waiting = executor.submit(tasks.slow, {}), executor.submit(tasks.slow, {})
    while not running.running():
        time.sleep(0.01)

    executor.shutdown()

    for future in (running, waiting):
        with pytest.raises(StoppedError):
            future.result(0)
    assert executor.pids() == []
    with pytest.raises(StoppedError):
        executor.submit(tasks.well, {})


def test_a_worker_dies_with_a_killed_daemon(tmp_path: Path) -> None:
    """When the daemon is killed in the middle of a fit, no worker goes on without it."""
    script = tmp_path / "daemon.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import sys, time
            from pathlib import Path
            sys.path.insert(0, {str(HERE)!r})
            import fault_tasks
            from impactd.jobs.executors import WorkerExecutor
            from impactd.jobs.worker_process import WorkerLimits, spare_cores
            executor = WorkerExecutor(WorkerLimits(60.0, 10**9), import_paths=[Path({str(HERE)!r})])
            print(executor.submit(fault_tasks.well, {{}}).result()["pid"], flush=True)
            executor.submit(fault_tasks.slow, {{}})
            time.sleep(600)
            """
        )
    )
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        process.kill()

    deadline = time.monotonic() + LIVELINESS_S
    while _runs(pid) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not _runs(pid)
