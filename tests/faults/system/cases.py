"""What the shipped units promise, tried inside the container that `run` has booted.

``cases.py [CASE]...``: one line a case with its figure. Exit code 1 when one of them is not well.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable

from board_outside import frozen_daemon, killed_daemon, locked_index
from shipped import eaten_memory, full_disk, start_to_ready
from unit import CannotRunError, Unit

CASES: dict[str, Callable[[Unit], str]] = {
    "ready": start_to_ready,
    "full-disk": full_disk,
    "memory": eaten_memory,
    "locked-index": locked_index,
    "frozen": frozen_daemon,
    "killed": killed_daemon,
}


def main(wanted: list[str]) -> int:
    """Run the cases; return the exit code."""
    failed = 0
    for name in wanted or CASES:
        unit = Unit()
        try:
            print(f"{name}: {CASES[name](unit)}", flush=True)
        except CannotRunError as reason:
            print(f"{name}: SKIPPED, {reason}", flush=True)
        except Exception as error:
            failed += 1
            if not isinstance(error, AssertionError):
                traceback.print_exc()
            print(f"{name}: FAILED, {' '.join(str(error).split())}", flush=True)
            print(unit.log(), file=sys.stderr, flush=True)
        finally:
            unit.reset()
    return int(failed > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
