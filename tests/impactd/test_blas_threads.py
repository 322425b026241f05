"""BLAS is told to keep to one thread before numpy can be imported."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from impactd.blas_threads import VARIABLES


@pytest.mark.parametrize(
    ("asked", "expected"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")], ids=["unset", "set"]
)
def test_the_command_line_keeps_blas_to_one_thread_unless_told_otherwise(
    asked: dict[str, str], expected: str
) -> None:
    """The variable is there before numpy is, and a person's own value wins."""
    code = (
        "import os, sys, impactd.cli as cli, impactd.console.daemon_commands\n"
        "assert 'numpy' not in sys.modules\n"
        "sys.argv = ['impactd', '--version']\n"
        "try: cli.main()\n"
        "except SystemExit: pass\n"
        "assert 'numpy' not in sys.modules\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    clean = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    answer = subprocess.run(
        [sys.executable, "-c", code],
        env=clean | asked,
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.split()[-1] == expected
