"""Many trials on several processes, one line each as it ends; stopped and started again at will."""

from __future__ import annotations

import json
import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from drivers.simulated.rig_model import DEFAULT_RIG
from impactd import blas_threads
from impactd.bench.blind.trial import Trial, run_trial


class Task(NamedTuple):
    """One trial to be run.

    Attributes
    ----------
    rig : str
        Which physics its rig obeys.
    """

    kind: str
    seed: int
    rig: str = DEFAULT_RIG


def run(
    tasks: Sequence[Task], *, workers: int = 1, budget_s: float | None = None
) -> Iterator[Trial]:
    """Yield trials as they end.

    Parameters
    ----------
    budget_s : float, optional
        How long each diagnosis may search. [s]

    Yields
    ------
    Trial
        One a task, in no order where there are several workers.
    """
    blas_threads.keep_to_one()
    if workers == 1:
        for task in tasks:
            yield run_trial(*task, budget_s=budget_s)
        return
    with ProcessPoolExecutor(workers, initializer=_leave_stopping_to_parent) as pool:
        waiting = {pool.submit(run_trial, *task, budget_s=budget_s) for task in tasks}
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:  # stopped, or whoever asked has gone
            # the pool would wait for minutes of trials that nobody writes down any more
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def _leave_stopping_to_parent() -> None:
    """Have Ctrl-C reach the parent only, which then ends its workers itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def run_into(
    path: Path, tasks: Sequence[Task], *, workers: int = 1, budget_s: float | None = None
) -> Iterator[Trial]:
    """Run what a file does not hold yet, and append each trial as it ends.

    Parameters
    ----------
    path : Path
        JSON lines; created if need be. A last line that a kill cut short is dropped.
    budget_s : float, optional
        How long each diagnosis may search. [s]

    Yields
    ------
    Trial
        The new ones.

    Raises
    ------
    ValueError
        If a line of the file is no trial.
    """
    done = {(t.kind, t.seed, t.rig) for t in _resume(path)}
    waiting = [t for t in tasks if tuple(t) not in done]
    with path.open("a") as out:
        for trial in run(waiting, workers=workers, budget_s=budget_s):
            out.write(json.dumps(trial.to_json(), allow_nan=False) + "\n")
            out.flush()
            yield trial


def read(paths: Sequence[Path]) -> list[Trial]:
    """Return the trials of some files, each kind, seed and rig once.

    Parameters
    ----------
    paths : sequence of Path
        JSON lines.

    Returns
    -------
    list of Trial
        By kind, seed and rig; of two with the same, the one read last.

    Raises
    ------
    ValueError
        If a line is no trial.
    OSError
        If a file cannot be read.
    """
    found = {(t.kind, t.seed, t.rig): t for path in paths for t in _lines(path)}
    return [found[key] for key in sorted(found)]


def _lines(path: Path) -> Iterator[Trial]:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        try:
            yield Trial.from_json(json.loads(line))
        except (ValueError, TypeError) as error:
            raise ValueError(
                f"{path}, line {number} is no trial ({error}). It was cut short or comes from "
                "another program; take the line out, and the trial will be run again."
            ) from error


def _resume(path: Path) -> list[Trial]:
    """Return what a file holds already, its torn last line cut off."""
    if not path.exists():
        return []
    text = path.read_text()
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole)
    return list(_lines(path))
