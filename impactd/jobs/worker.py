"""The worker process: ``python -m impactd.jobs.worker``.

JSON lines in on standard input, ``{"task": "module:function", "arguments": [...]}``, JSON lines
out on what was standard output: ``{"ready": ...}`` once, then any number of ``{"progress": [...]}``
and one ``{"result": ...}`` or ``{"error": [...]}`` for each task.

It knows no archive: a task gets paths and hashes and gives back JSON. It may die at any moment
without harm.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import resource
import sys
import time
import traceback
from pathlib import Path
from typing import Any, TextIO

from impactd import blas_threads
from impactd.jobs import progress
from impactd.parent_death import end_with_parent

REPORT_EVERY_S = 0.2
_NICENESS = 5


def main() -> int:
    """Run tasks until standard input ends."""
    blas_threads.keep_to_one()  # nothing has imported numpy yet
    options = _options()
    os.nice(_NICENESS)  # the sample stream goes first
    _be_ended_first()
    end_with_parent(options.parent)
    # Whatever a library prints must not end up between the answers.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    started = time.monotonic()
    _warm_up(options.warm_up)
    _limit_memory(options.memory_bytes)
    _say(answers, {"ready": time.monotonic() - started})
    progress.listen(_Reporter(answers))
    for line in sys.stdin:
        _say(answers, _run(json.loads(line)))
    return 0


def _warm_up(name: str) -> None:
    try:
        if name:
            _resolve(name)()
    except Exception:  # a cold worker is slower at its first fit, and that is all
        traceback.print_exc()


class _Reporter:
    """Progress as lines: a new text at once, else a line each `REPORT_EVERY_S` at most."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._last = 0.0
        self._text = ""

    def __call__(self, text: str, share: float) -> None:
        now = time.monotonic()
        # a step that takes minutes may be told right behind one that took none
        if text != self._text or now - self._last >= REPORT_EVERY_S:
            self._last, self._text = now, text
            _say(self._answers, {"progress": [text, share]})


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="impactd.jobs.worker")
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--warm-up", default="")
    return parser.parse_args()


def _be_ended_first() -> None:
    """Have the kernel end this process before the daemon when memory runs out."""
    try:
        Path("/proc/self/oom_score_adj").write_text("1000")  # the largest there is, proc(5)
    except OSError as error:  # no /proc, or it is not ours to write: the fit runs all the same
        print(f"impactd: the fit may take the daemon with it: {error}", file=sys.stderr)


def _limit_memory(memory_bytes: int) -> None:
    """Bound the address space; libraries reserve much at start, so only the rest counts."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _run(order: dict[str, Any]) -> dict[str, Any]:
    try:
        result = _resolve(order["task"])(*order["arguments"])
        # Encoded here: a result that is no JSON is this task's error, not the worker's end.
        json.dumps(result, allow_nan=False)
    except MemoryError:
        return {"out_of_memory": True}
    except Exception as error:  # whatever a task raises is its answer
        return {"error": [type(error).__name__, str(error)]}
    return {"result": result}


def _resolve(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def _say(answers: TextIO, value: dict[str, Any]) -> None:
    answers.write(json.dumps(value, allow_nan=False) + "\n")
    answers.flush()


if __name__ == "__main__":
    sys.exit(main())
