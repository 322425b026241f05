"""Cases under the unit exactly as it is shipped; the rig is the simulated one."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from unit import DATA, CannotRunError, Unit, memory_is_bounded, run, until

# A record of 0.4 s is 0.8 MB, the index's files grow by some tens of kB; with less than this left
# the drop is accepted and its record finds no room.
LEFT_BYTES = 320 * 1024
# What is left until the drop was accepted; the rest is filled in a moment.
ALMOST_BYTES = 20 * 1024 * 1024
FILLING = Path("/var/filling")


def start_to_ready(unit: Unit) -> str:
    """The unit starts, says READY to systemd and to the person, and a drop is analysed."""
    unit.configure()
    took_s = unit.start()
    assert unit.show("ActiveState") == "active"
    assert unit.show("StatusText").startswith("READY"), unit.show("StatusText")
    drop = unit.ended(unit.drop())
    assert drop["state"] in ("stored", "analysed"), drop
    began_s = time.monotonic()
    run("systemctl", "stop", "impactd.service")
    stopped_s = time.monotonic() - began_s
    assert unit.show("Result") == "success", unit.show("Result")
    assert unit.said("nothing to make safe"), "ExecStopPost= was not run"
    return f"READY after {took_s:.1f} s (cold), one drop stored, stopped within {stopped_s:.1f} s"


def full_disk(unit: Unit) -> str:
    """With /var full, the record of a drop outlives `systemctl stop`."""
    # 400 MB hold the compiled solver and the archive. The disk is filled while the technician hangs
    # the sphere: behind the daemon's look at the free space, before the record.
    run("mount", "-o", "remount,size=400M", "/var")
    unit.configure(storage__reserve_bytes="0", simulation__technician_delay_s="5.0")
    unit.start()
    before = _records()
    _fill(ALMOST_BYTES)
    number = unit.drop()
    try:
        _fill(LEFT_BYTES)
        state = unit.get(f"/v1/drops/{number}")["state"]
        assert state in ("requested", "arming"), f"filled too late, the drop is {state}"
        until(lambda: "memory" in unit.get("/v1/status")["sentence"], "the record found room")
        run("systemctl", "stop", "impactd.service")
        kept = sorted(_records() - before)
        said = unit.said("kept outside")
    finally:
        FILLING.unlink()
    assert kept, f"after the stop the record is nowhere; the daemon had said: {said[-1:]}"
    unit.start()
    drop = unit.ended(number)
    assert drop["state"] in ("stored", "analysed"), drop
    assert not kept[0].exists(), f"{kept[0]} was not taken in"
    return f"rescued to {kept[0]}, which a stop leaves; stored by the next start"


def _fill(left_bytes: int) -> None:
    """Leave so many bytes of /var."""
    with FILLING.open("ab") as file:
        while (more := shutil.disk_usage("/var").free - left_bytes) > 0:
            file.write(bytes(min(more, 1 << 20)))
            file.flush()


def _records() -> set[Path]:
    """Return the shot files outside the archive, in all folders that are there after a stop."""
    found = run("find", "/", "/var", "/tmp", "/dev/shm", "-xdev", "-name", "[0-9]*.h5")
    paths = {Path(line) for line in found.splitlines()}
    # A file of no bytes is a name without a record.
    return {path for path in paths if not path.is_relative_to(DATA) and path.stat().st_size}


def eaten_memory(unit: Unit) -> str:
    """A process of the unit that eats memory is ended, and the daemon goes on."""
    if not memory_is_bounded():
        raise CannotRunError(
            "the container has no memory controller (the host mounts it as cgroup v1), so "
            "MemoryMax= does nothing here"
        )
    unit.configure()
    unit.start()
    pid, used = unit.show("MainPID"), int(unit.show("MemoryCurrent"))
    limit = used + 300_000_000  # soon reached, and room for the daemon
    run("systemctl", "set-property", "--runtime", "impactd.service", f"MemoryMax={limit}")
    group = "/sys/fs/cgroup" + unit.show("ControlGroup")
    # What a worker is to the kernel: a process of the unit with the worker's own score.
    hog = (
        f"open('{group}/cgroup.procs', 'w').write('0')\n"
        "open('/proc/self/oom_score_adj', 'w').write('1000')\n"
        "held = []\nwhile True: held.append(bytearray(b'x' * 10_000_000))"
    )
    ended = subprocess.run([sys.executable, "-c", hog], check=False, timeout=120)
    assert ended.returncode == -9, ended
    kills = re.search(r"oom_kill (\d+)", Path(group, "memory.events").read_text())
    assert kills is not None
    assert int(kills[1]) > 0, "it was not the kernel that ended it"
    time.sleep(2.0)  # systemd is told of it and decides
    assert unit.show("ActiveState") == "active", unit.show("Result")
    assert unit.show("MainPID") == pid
    drop = unit.ended(unit.drop())
    assert drop["state"] in ("stored", "analysed"), drop
    return f"the kernel ended the one at {limit / 1e6:.0f} MB, the daemon made the next drop"
