"""The shipped units under a real systemd, in a container."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

CANNOT_RUN = 77


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.timeout(1800)
def test_the_shipped_units_keep_their_word() -> None:
    """Started, stopped on a full disk, locked, frozen, killed: nothing lost, the valve closed."""
    result = subprocess.run(
        [Path(__file__).with_name("run")], capture_output=True, text=True, check=False
    )
    if result.returncode == CANNOT_RUN:
        pytest.skip(result.stderr.strip())
    print(result.stdout)
    assert result.returncode == 0, result.stdout + result.stderr
