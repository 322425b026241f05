"""The worker process gives way to the daemon."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def test_the_kernel_ends_the_worker_before_the_daemon() -> None:
    """Where memory runs out, the worker asks to be ended first."""
    command = [sys.executable, "-m", "impactd.jobs.worker"]
    with subprocess.Popen(
        [*command, "--parent", str(os.getpid()), "--memory-bytes", "300000000"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as worker:
        assert worker.stdout is not None
        assert b"ready" in worker.stdout.readline()
        score = Path(f"/proc/{worker.pid}/oom_score_adj").read_text()
        worker.communicate()
    assert int(score) == 1000
