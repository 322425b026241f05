"""Work in processes: the same results, errors that come through, and nothing left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosing import diagnose
from analysis.fit import joint, over_shots
from analysis.fit.cores import OneCore
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from impactd.diagnosis.processes import Processes
from impactd.storage.campaign_folder import read_campaign

CORES = 3
LIVELINESS_S = 60.0


def _is_alive(pid: int) -> bool:
    """Return whether a process runs; one that has ended may wait for somebody to ask how."""
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def _until(true: Callable[[], bool]) -> None:
    """Wait until something is true; fail where it never is."""
    deadline = time.monotonic() + LIVELINESS_S
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.fixture(autouse=True)
def three_cores(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Work as on three cores, whatever the machine has, and leave no process."""
    begun: list[int] = []
    fork = os.fork

    def noted() -> int:
        """Return what forking does, and note it."""
        begun.append(fork())
        return begun[-1]

    monkeypatch.setattr(over_shots, "CORES", CORES)
    monkeypatch.setattr(os, "fork", noted)
    yield
    for pid in begun:
        with pytest.raises(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)


def test_pieces_come_in_their_order_from_other_processes() -> None:
    """However many there are."""
    found = list(Processes().each(lambda i: (i * i, os.getpid()), range(7), ()))
    assert [square for square, _ in found] == [i * i for i in range(7)]
    assert os.getpid() not in {pid for _, pid in found}


def test_a_helper_does_one_piece_after_the_other() -> None:
    """Every fork costs a copy of what either side writes to."""
    workers = set(Processes().each(lambda _: os.getpid(), range(12), []))
    assert len(workers) <= CORES
    assert os.getpid() not in workers


def test_a_helper_keeps_to_one_core() -> None:
    """Else helpers would have helpers."""
    assert list(Processes().each(lambda _: over_shots.CORES, range(2), ())) == [1, 1]


def test_one_piece_needs_no_process() -> None:
    """Nor do none."""
    assert list(Processes().each(lambda _: os.getpid(), [0], ())) == [os.getpid()]
    assert list(Processes().each(lambda _: os.getpid(), [], ())) == []


def test_what_a_piece_raises_is_raised_here() -> None:
    """In its turn: what comes before it is there."""
    found = Processes().each(lambda i: 1 // (i - 2), range(5), ())
    assert [next(found), next(found)] == [-1, -1]
    with pytest.raises(ZeroDivisionError):
        next(found)


def test_a_piece_whose_process_is_killed_is_done_here() -> None:
    """As where its memory was too much for the machine."""
    here = os.getpid()

    def work(i: int) -> int:
        """Return a square, but die elsewhere."""
        if i == 1 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return i * i

    assert list(Processes().each(work, range(4), ())) == [0, 1, 4, 9]


def test_what_cannot_be_sent_is_made_here() -> None:
    """A function without a name, say."""
    found = list(Processes().each(lambda i: lambda: i, range(3), ()))
    assert [each() for each in found] == [0, 1, 2]


def test_what_was_there_before_comes_back_as_itself() -> None:
    """Even where it cannot be sent."""
    shared = [lambda: 1, lambda: 2]
    found = list(Processes().each(lambda i: {"it": shared[i]}, range(2), shared))
    assert [one["it"] for one in found] == shared


def test_what_nobody_asks_for_any_more_is_ended() -> None:
    """The fixture looks for what is left."""
    with closing(Processes().each(lambda i: i or signal.pause(), [1, 0, 0, 0], ())) as found:
        assert next(found) == 1


def test_helpers_end_with_the_process_that_is_killed(tmp_path: Path) -> None:
    """Whoever kills a worker ends its helpers, in the middle of their work, too."""
    program = """
import os, sys, time
from pathlib import Path
from analysis.fit import over_shots
from impactd.diagnosis.processes import Processes

def work(name):
    Path(name).with_suffix(".part").write_text(str(os.getpid()))
    os.rename(Path(name).with_suffix(".part"), name)
    time.sleep(600)

over_shots.CORES = 2
list(Processes().each(work, sys.argv[1:], ()))
"""
    names = [tmp_path / "one", tmp_path / "other"]
    killed = subprocess.Popen([sys.executable, "-c", program, *map(str, names)])
    try:
        _until(lambda: all(name.exists() for name in names))
    finally:
        killed.kill()
        killed.wait()
    helpers = [int(name.read_text()) for name in names]
    _until(lambda: not any(map(_is_alive, helpers)))


def test_a_team_answers_in_the_order_of_its_members() -> None:
    """Each in a process of its own, which stays for the next question."""
    with Processes().team(lambda member, members, q: (member, members, q, os.getpid())) as ask:
        first, second = ask("a"), ask("b")
    assert [one[:3] for one in first] == [(m, CORES, "a") for m in range(CORES)]
    assert [one[2] for one in second] == ["b"] * CORES
    assert [one[3] for one in first] == [one[3] for one in second]
    assert first[0][3] == os.getpid()
    assert len({one[3] for one in first}) == CORES


def test_this_process_stands_in_for_a_member_that_has_gone() -> None:
    """And raises what that has raised."""
    here = os.getpid()

    def work(member: int, members: int, question: int) -> int:
        """Return a share, but die elsewhere when asked for the second time."""
        del members
        if question == 2 and os.getpid() != here:
            os._exit(3)
        return question // (3 - question) + member

    with Processes().team(work) as ask:
        assert [ask(q) for q in (1, 2, 2)] == [[0, 1, 2], [2, 3, 4], [2, 3, 4]]
    with pytest.raises(ZeroDivisionError), Processes().team(work) as ask:
        ask(3)


def test_a_fit_is_the_same_to_the_last_bit(
    leaky_campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In processes and in one, with steps that are refused among those that are not."""
    monkeypatch.setattr(joint, "LEAST_OF_A_TEAM", 4)
    campaign = read_campaign(leaky_campaign)
    problem, nuisances = with_start(build(campaign, model_named("kv2+plastic_yield")))
    alone = joint.fit(problem, nuisances, max_iterations=12)
    problem.cores = Processes()
    together = joint.fit(problem, nuisances, max_iterations=12)
    assert np.array_equal(alone.theta, together.theta)
    assert np.array_equal(alone.nuisances, together.nuisances)
    assert alone.cost == together.cost
    assert all(
        np.array_equal(one.matrix, other.matrix)
        for one, other in zip(alone.blocks, together.blocks, strict=True)
    )


def test_a_diagnosis_is_the_same_on_any_number_of_cores(leaky_campaign: Path) -> None:
    """All that it says, names and numbers, where there is a search."""
    campaign = read_campaign(leaky_campaign)
    alone, together = (diagnose(campaign, cores=cores) for cores in (OneCore(), Processes()))
    assert alone == together
    assert alone["verdict"] == "identified"
