"""Blind trials of diagnoses: one side draws and seals, the other diagnoses, both are opened.

The diagnosis sees what a campaign folder holds and nothing else. A trial is known by its kind and
its seed; a table belongs to the seeds it was made with, so tune on some and report on others.

``plan`` draws, ``trial`` runs one, ``runs`` runs many and can be stopped, ``outcome`` judges one,
``questions`` asks and ``counting`` counts, ``table`` prints.
"""

from __future__ import annotations

import os

from impactd.bench.figure import Figure

FIRST_SEED = 90_000
"""Seeds of `measure`; the page's table names its own."""
EACH = 4
"""Trials of each kind in `measure`."""


def measure() -> list[Figure]:
    """Run a few trials of each kind and count, as a benchmark among others.

    Returns
    -------
    list of Figure
        One a question that has any trial; shares of so few trials scatter widely.
    """
    # not at the top: numpy must not be loaded before `__main__` has told BLAS to start no threads
    from impactd.bench.blind.plan import KINDS  # noqa: PLC0415 - see above
    from impactd.bench.blind.questions import answers  # noqa: PLC0415 - see above
    from impactd.bench.blind.runs import Task, run  # noqa: PLC0415 - see above

    tasks = [Task(kind, FIRST_SEED + i) for i in range(EACH) for kind in KINDS]
    return [
        Figure(
            name=f"{answer.question} ({answer.count})",
            value=answer.value,
            unit=answer.unit,
            reference=None,
            goal=answer.goal,
            met=answer.met,
        )
        for answer in answers(list(run(tasks, workers=os.cpu_count() or 1)))
    ]
