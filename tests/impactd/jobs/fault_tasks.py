"""Tasks that go wrong for real; only tests know this module."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from analysis.fit import over_shots
from impactd.jobs.progress import report

Json = dict[str, Any]


def well(order: Json) -> Json:
    """Give back what came, and who did it."""
    return {"order": order, "pid": os.getpid()}


def counts_cores(_: Json) -> Json:
    """Say how many cores a fit would use."""
    return {"cores": over_shots.CORES, "blas": os.environ["OPENBLAS_NUM_THREADS"]}


def slow(order: Json) -> Json:
    """Take a moment and say how far it is."""
    for step in range(5):
        report(f"step {step}", step / 5)
        time.sleep(0.25)
    return order


def hurries(order: Json) -> Json:
    """Say three things in a row, each how far it is many times."""
    for text in ("first", "second", "third"):
        for done in range(100):
            report(text, done / 100)
    return order


def leaves(_: Json) -> Json:
    """End the process without a word."""
    os._exit(3)


def segfaults(_: Json) -> Json:
    """Read from where nothing is."""
    ctypes.string_at(8)
    return {}


def hangs(_: Json) -> Json:
    """Never come back, and leave a child behind that does not either."""
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    Path(os.environ["FAULT_TASKS_CHILD"]).write_text(str(child.pid))
    while True:
        time.sleep(1)


def eats_in_a_leap(_: Json) -> Json:
    """Ask for far too much memory at once."""
    return {"sum": float(np.ones(4_000_000_000).sum())}


def eats_bit_by_bit(_: Json) -> Json:
    """Ask for memory until somebody stops it."""
    held = []
    while True:
        held.append(np.ones(5_000_000))
        time.sleep(0.01)


def raises(_: Json) -> Json:
    """Fail in an ordinary way."""
    raise ValueError("the sphere has no mass")


def prints(order: Json) -> Json:
    """Write where the answers go."""
    print("not JSON")
    os.write(1, b"{ not JSON either\n")
    return order


def no_json(_: Json) -> Json:
    """Give back what JSON cannot say."""
    return {"value": float("nan")}


def crashes_once(order: Json) -> Json:
    """Crash at the first try only."""
    mark = Path(order["mark"])
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return order


def at_the_gate(order: Json) -> Json:
    """Wait until a file is there, then go on as the order says."""
    while not Path(order["gate"]).exists():
        time.sleep(0.01)
    return order if order["then"] == "well" else raises(order)
