"""Power cuts at any point of the daemon's writing, replayed from the trace of its system calls."""

from __future__ import annotations

import random
import re
import shutil
from pathlib import Path

import pytest

from impactd.storage.archive import Archive

from .daemon_process import DROP, ENDED, DaemonProcess, until
from .power_cut import Call, Disk, calls, settled, strace

KNOWN = re.compile(rb'"number":(\d+),"state":"')
TOLD = re.compile(rb'"number":(\d+),"state":"(?:stored|analysed)"')
SHOTS = 3
SHORT = {"record_s = 0.4": "record_s = 0.03"}


@pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace (apt install strace)")
@pytest.mark.parametrize("points", [8, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.timeout(900)
def test_no_acknowledged_shot_is_lost(tmp_path: Path, points: int) -> None:
    """At each point, nothing unsynced or any part kept: index whole, shots intact, keys known."""
    trace = tmp_path / "trace"
    daemon = DaemonProcess(tmp_path, before=strace(trace, "-D"), changes=SHORT)
    disk = Disk(daemon.data)
    with daemon:
        daemon.start()
        for number in range(1, SHOTS + 1):
            daemon.post("/v1/drops", DROP, f"drop-{number}")
            until(lambda n=number: daemon.get(f"/v1/drops/{n}")["state"], ENDED.__contains__)
            until(lambda: daemon.get("/v1/status")["ready"], bool)
        assert daemon.stop() == 0
    played = list(calls(settled(trace)))
    changing = [i for i, call in enumerate(played) if call.name != "sendto" and _here(call, disk)]
    rng = random.Random(21)
    cut_after = set(rng.sample(changing, min(points, len(changing))))
    told: set[int] = set()
    known: set[int] = set()
    lost = 0
    for place, call in enumerate(played):
        if call.name == "sendto":
            told |= {int(number) for number in TOLD.findall(b"".join(call.texts))}
            known |= {int(number) for number in KNOWN.findall(b"".join(call.texts))}
            continue
        disk.play(call)
        if place in cut_after:
            for torn in (None, rng):
                lost += _lost(tmp_path / "cut", disk, told, known, torn)
    assert told == set(range(1, SHOTS + 1))
    assert lost == 0
    print(
        f"power cut after {len(cut_after)} of {len(changing)} writes, syncs and names, twice each "
        f"(unsynced data dropped; torn): {len(told)} shots acknowledged, {lost} lost"
    )


def _here(call: Call, disk: Disk) -> bool:
    texts = [text.decode(errors="replace") for text in call.texts[-1:]]
    return any(text.startswith(disk.root) for text in (call.file, *texts))


def _lost(
    folder: Path, disk: Disk, told: set[int], known: set[int], torn: random.Random | None
) -> int:
    shutil.rmtree(folder, ignore_errors=True)
    disk.after_power_cut(folder, torn)
    with Archive.open(folder, reserve_bytes=0) as archive:
        archive.interrupt_unfinished()
        problems = [
            f"{found.subject}: {found.problem}"
            for found in archive.verify()
            if found.problem and "left by a writer" not in found.problem
        ]
        assert problems == []
        assert [token.name for token in archive.tokens.list()] == ["tester"]
        for number in known:  # the key of every drop that anybody was told of
            assert f"drop-{number}" in str(archive.drop(number).idempotency_key)
        stored = {shot.number for shot in archive.shots()}
        for number in told & stored:
            archive.read_shot(number)
            assert archive.drop(number).state in ("stored", "analysed")
        return len(told - stored)
