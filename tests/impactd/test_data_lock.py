"""One daemon per data directory."""

from __future__ import annotations

import subprocess
import sys

import pytest

from impactd.data_lock import LOCK_NAME, DataLock, DataLockedError, read_holder


def test_a_second_holder_is_refused_and_told_who_the_first_is(tmp_path):
    """The sentence names process and address."""
    with DataLock(tmp_path) as lock:
        lock.tell(url="http://127.0.0.1:1")
        with pytest.raises(DataLockedError, match=r"process \d+ at http://127.0.0.1:1"):
            DataLock(tmp_path)
    with DataLock(tmp_path):
        assert "pid" in read_holder(tmp_path)


def test_a_killed_holder_leaves_no_lock(tmp_path):
    """The lock dies with its process, however that ends."""
    code = (
        "import os, pathlib, sys; from impactd.data_lock import DataLock; "
        "DataLock(pathlib.Path(sys.argv[1])); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    assert "pid" in read_holder(tmp_path)
    DataLock(tmp_path).release()


def test_a_deleted_note_lets_nobody_in(tmp_path):
    """What is locked is the directory: the file that names the holder may go and come."""
    with DataLock(tmp_path) as lock:
        (tmp_path / LOCK_NAME).unlink()
        with pytest.raises(DataLockedError, match="another process"):
            DataLock(tmp_path)
        (tmp_path / LOCK_NAME).write_text("")
        with pytest.raises(DataLockedError):
            DataLock(tmp_path)
        lock.tell(url="http://127.0.0.1:1")
        assert read_holder(tmp_path)["url"] == "http://127.0.0.1:1"
    DataLock(tmp_path).release()
