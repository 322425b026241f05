"""A minimal Debian for tests that install the project: made once by debootstrap, then kept.

It is in ``/var/tmp/impactd-deb``, or where ``$IMPACTD_DEB_TREE`` says.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

_KEPT = Path(os.environ.get("IMPACTD_DEB_TREE", "/var/tmp/impactd-deb"))


def debian_tree() -> Path:
    """Return its folder, which nobody may change; skip the test where none can be made."""
    if os.geteuid() != 0:
        pytest.skip("needs root, for chroot")
    tree = _KEPT / "tree"
    if (_KEPT / "complete").exists():
        return tree
    if shutil.which("debootstrap") is None:
        pytest.skip("needs debootstrap (Debian: apt install debootstrap)")
    shutil.rmtree(_KEPT, ignore_errors=True)
    _KEPT.mkdir(parents=True)
    include = "--include=python3,libusb-1.0-0,adduser"
    made = subprocess.run(
        ["debootstrap", "--variant=minbase", include, "bookworm", tree],
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode:
        pytest.skip(f"debootstrap failed: {made.stdout[-200:]}")
    (_KEPT / "complete").touch()
    return tree
