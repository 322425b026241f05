"""A re-fit on a real Dask scheduler and workers, some of which are killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from impactd.bench import study
from impactd.bench.cluster import SCHEDULER, Cluster
from impactd.jobs import executors
from impactd.jobs.errors import ClusterError, WorkerCrashedError
from impactd.settings.settings import find_config, load_settings
from impactd.storage.archive import Archive

pytestmark = [pytest.mark.integration, pytest.mark.timeout(900)]
WORKERS = 2
LIVELINESS_S = 300.0


def test_a_killed_worker_and_a_restarted_scheduler_cost_no_shot_and_fit_none_twice(
    tmp_path: Path,
) -> None:
    """The same process goes on when its scheduler is back; its memory does not grow."""
    settings = load_settings(find_config("simulated.toml"), data=tmp_path / "archive")
    study.copy_campaign(settings, 8 * study.CAMPAIGN)
    with (
        Archive.open(settings.storage.directory, reserve_bytes=0) as archive,
        Cluster(tmp_path, WORKERS) as cluster,
        executors.dask_executor(scheduler=cluster.address) as executor,
    ):
        study.wait_for_workers(executor, WORKERS)
        figures = study.interrupted(archive, settings, cluster, executor)
    assert [one.name for one in figures if not one.met] == []
    logs = {path.stem: path.read_text() for path in tmp_path.glob("*.log")}
    starts = {name: text.count("Start worker at") for name, text in logs.items()}
    assert starts["worker-1"] >= 3, starts  # at first, after its own end, after the scheduler's
    assert starts["worker-2"] >= 2, starts


def test_a_scheduler_that_stays_away_ends_the_study_which_goes_on_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sentence says what to do; the command then does what is left, and nothing twice."""
    monkeypatch.setattr(executors, "CONNECT_LIMIT_S", 20.0)
    settings = load_settings(find_config("simulated.toml"), data=tmp_path / "archive")
    shots = 4 * study.CAMPAIGN
    study.copy_campaign(settings, shots)
    with (
        Archive.open(settings.storage.directory, reserve_bytes=0) as archive,
        Cluster(tmp_path, WORKERS) as cluster,
        executors.dask_executor(scheduler=cluster.address) as executor,
    ):
        study.wait_for_workers(executor, WORKERS)

        def kill(done: int, total: int) -> None:
            if 3 * done >= total and cluster.processes[SCHEDULER].poll() is None:
                cluster.stop_keeping()
                cluster.kill(SCHEDULER)

        with pytest.raises(ClusterError, match="run the same command again"):
            study.watched(archive, settings, executor, kill, label="")

    words = [sys.executable, "-m", "impactd", "refit", "--executor", "dask", "--model", "kv"]
    words += ["--config", str(find_config("simulated.toml")), "--data", str(tmp_path / "archive")]
    with Cluster(tmp_path, WORKERS) as cluster:
        words += ["--scheduler", cluster.address, "--json"]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
    report = json.loads(done.stdout)
    assert 0 < report["before"] < shots
    assert report["before"] + report["fitted"] == shots
    with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
        assert archive.fits.rows_in_run(report["run"]) == shots


def test_a_task_that_kills_its_workers_ends_as_a_lost_worker_and_the_next_one_is_done() -> None:
    """Dask tries four workers; then the re-fit hears the same error as from a process here."""
    with executors.dask_executor(workers=1) as executor:
        assert executor.workers == 1
        bad = executor.submit(os._exit, 3)
        with pytest.raises(WorkerCrashedError, match="4 workers"):
            bad.result(LIVELINESS_S)
        assert executor.submit(abs, -1).result(LIVELINESS_S) == 1
