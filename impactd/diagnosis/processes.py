"""Work of a diagnosis in processes, as many at once as this one may use cores.

A helper is a fork of this process, so that the work need not be sent to it. It does one piece after
the other: every fork has each page copied that either writes to. It sends its results
through a pipe, pickled; an object that existed before the fork is sent as a reference. Work that a
helper did not finish, or whose result cannot be pickled, is done in this process instead. Threads
would not do: half of a fit's time is spent under the interpreter's lock.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, NoReturn

from analysis.fit import over_shots
from analysis.fit.cores import OneCore, R, T
from impactd.parent_death import end_with_parent

PROTOCOL = pickle.HIGHEST_PROTOCOL
NOTHING = b""
"""No answer: the caller does the work itself."""


class Processes:
    """Spreads work over processes; see `analysis.fit.cores.Cores`."""

    @property
    def count(self) -> int:
        """How many there are for this process."""
        return over_shots.CORES

    def each(
        self, work: Callable[[T], R], pieces: Sequence[T], shared: Sequence[object]
    ) -> Iterator[R]:
        """Yield what the work makes of each piece, in their order.

        What has begun and is not asked for any more is ended.
        """
        if self.count < 2 or len(pieces) < 2:
            yield from OneCore().each(work, pieces, shared)
            return
        known = {id(one): one for one in shared}
        waiting = deque(range(len(pieces)))
        free: list[_Helper] = []
        busy: dict[Connection, tuple[int, _Helper]] = {}
        answers: dict[int, bytes] = {}

        def serve(line: Connection) -> None:
            """Send what the work makes of each piece that is asked for."""
            while True:
                line.send_bytes(_pickled(work(pieces[line.recv()]), known))

        try:
            for place, piece in enumerate(pieces):
                while place not in answers:
                    while waiting and len(busy) < self.count:
                        helper = free.pop() if free else _Helper.begun(serve)
                        busy[helper.line] = waiting[0], helper
                        helper.ask(pickle.dumps(waiting.popleft(), PROTOCOL))
                    ready = wait(list(busy))
                    for line in [line for line in busy if line in ready]:
                        at, helper = busy.pop(line)
                        answers[at] = helper.answer()
                        if answers[at]:
                            free.append(helper)
                        else:
                            helper.end()
                answer = answers.pop(place)
                yield _unpickled(answer, known) if answer else work(piece)
        finally:
            for helper in (*free, *(helper for _, helper in busy.values())):
                helper.end()

    @contextlib.contextmanager
    def team(self, work: Callable[[int, int, T], R]) -> Iterator[Callable[[T], list[R]]]:
        """Return a team of this process and one more for each core, from the first question on."""
        others: list[_Helper] = []
        count = self.count

        def serve(member: int, line: Connection) -> None:
            """Answer questions until nobody asks."""
            while True:
                question = pickle.loads(line.recv_bytes())  # noqa: S301 - from the same program
                line.send_bytes(pickle.dumps(work(member, count, question), PROTOCOL))

        def ask(question: T) -> list[R]:
            """Return what all members make of a question."""
            for member in range(len(others) + 1, count):
                others.append(_Helper.begun(partial(serve, member)))  # noqa: PERF401 - may raise
            sent = pickle.dumps(question, PROTOCOL) if others else NOTHING
            for helper in others:
                helper.ask(sent)
            found = [work(0, count, question)]
            for member, helper in enumerate(others, start=1):
                answer = helper.answer()
                done = pickle.loads(answer) if answer else work(member, count, question)  # noqa: S301 - as above
                found.append(done)
            return found

        try:
            yield ask
        finally:
            for helper in others:
                helper.end()


@dataclass(frozen=True)
class _Helper:
    """A process that helps this one."""

    pid: int
    line: Connection

    @classmethod
    def begun(cls, serve: Callable[[Connection], None]) -> _Helper:
        """Return a copy of this process that serves at its end of the line, then ends."""
        here, there = Pipe()
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            here.close()
            _serve(serve, there, parent)
        there.close()
        return cls(pid, here)

    def ask(self, question: bytes) -> None:
        """Send a question; one that has ended will not answer."""
        with contextlib.suppress(OSError):
            self.line.send_bytes(question)

    def answer(self) -> bytes:
        """Return the next answer, or nothing where it has ended without."""
        try:
            return self.line.recv_bytes()
        except (EOFError, OSError):
            return NOTHING

    def end(self) -> None:
        """End it, whatever it is doing."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        self.line.close()


def _serve(serve: Callable[[Connection], None], line: Connection, parent: int) -> NoReturn:
    """Serve and end this process, whatever happens."""
    try:
        end_with_parent(parent)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # who waits for it ends it
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        over_shots.CORES = 1
        gc.disable()  # it would write to, and so copy, all that this process has
        serve(line)
    finally:
        os._exit(0)


class _Pickler(pickle.Pickler):
    """Pickles the objects that both processes have as references."""

    def __init__(self, file: io.BytesIO, known: dict[int, object]) -> None:
        super().__init__(file, protocol=PROTOCOL)
        self._known = known

    def persistent_id(self, obj: object) -> int | None:
        """Return the reference of an object that both have, else None."""
        return id(obj) if id(obj) in self._known else None


class _Unpickler(pickle.Unpickler):
    """Resolves these references."""

    def __init__(self, file: io.BytesIO, known: dict[int, object]) -> None:
        super().__init__(file)
        self._known = known

    def persistent_load(self, pid: int) -> object:
        """Return the object."""
        return self._known[pid]


def _pickled(answer: object, known: dict[int, object]) -> bytes:
    out = io.BytesIO()
    _Pickler(out, known).dump(answer)
    return out.getvalue()


def _unpickled(answer: bytes, known: dict[int, object]) -> Any:
    return _Unpickler(io.BytesIO(answer), known).load()
