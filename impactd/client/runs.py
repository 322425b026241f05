"""A series of drops and a calibration, as blocks that clean up after an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from types import TracebackType

from impactd.aliases import Json
from impactd.client import talk
from impactd.client.connection import Connection
from impactd.client.errors import RigError
from impactd.client.shot import Shot
from impactd.client.talk import Tell
from impactd.wire.rig_answers import CalibrationAnswer

Telling = Callable[[str], AbstractContextManager[Tell]]
"""Gives what is to be told how far a wait is, with what is said before it."""
READY_WITHIN_S = 60.0
"""A rig that is well is READY again within seconds of a shot."""


class Series:
    """Drops of one sphere on one surface from one height.

    An error in the block, or Ctrl-C, aborts the drop that is under way. With a ``key`` of your
    own a script that was cut short can be run again: what has fallen is read, not dropped.

    Parameters
    ----------
    connection : Connection
        To the daemon.
    telling : callable
        Gives what is told how far a wait is.
    body : dict
        Of each drop.
    repeats : int
        How many.
    key : str
        What the idempotency keys of its drops begin with.
    """

    def __init__(
        self, connection: Connection, telling: Telling, body: Json, *, repeats: int, key: str
    ) -> None:
        self._connection = connection
        self._telling = telling
        self._body = body
        self._key = key
        self._under_way: int | None = None
        self.repeats = repeats
        self.shots: list[Shot] = []

    def __enter__(self) -> Series:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None and self._under_way is not None:
            with suppress(RigError):  # it may just have ended
                self._connection.send("DELETE", f"/v1/drops/{self._under_way}")

    def __iter__(self) -> Iterator[Shot]:
        """Make the drops one by one."""
        while len(self.shots) < self.repeats:
            yield self.drop()

    def drop(self) -> Shot:
        """Make the next drop and return its shot."""
        connection, count = self._connection, len(self.shots) + 1
        with self._telling(f"{count} of {self.repeats}, ") as tell:
            connection.run(talk.wait_until_ready(READY_WITHIN_S))
            begun = connection.send("POST", "/v1/drops", self._body, key=f"{self._key} {count}")
            self._under_way = int(begun["number"])
            answer = connection.run(talk.shot_of_drop(self._under_way, tell))
        self._under_way = None
        self.shots.append(Shot.of(answer, connection))
        return self.shots[-1]


class Calibration:
    """A calibration run; leaving the block waits for its end, an error in it aborts the run.

    Parameters
    ----------
    connection : Connection
        To the daemon.
    telling : callable
        Gives what is told how far a wait is.
    begun : dict
        The run as the API told it.

    Attributes
    ----------
    answer : CalibrationAnswer
        The run as it was seen last.
    """

    def __init__(self, connection: Connection, telling: Telling, begun: Json) -> None:
        self._connection = connection
        self._telling = telling
        self.answer = CalibrationAnswer.model_validate(begun)

    def __enter__(self) -> Calibration:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.wait()
        else:
            with suppress(RigError):  # the error of the block is the one to be told
                self._connection.run(talk.abort_calibration(self.answer.number))

    def wait(self) -> CalibrationAnswer:
        """Return the calibration once it is done.

        Raises
        ------
        EndedError
            If it failed.
        """
        if self.answer.state != "done":
            with self._telling("") as tell:
                found = self._connection.run(talk.calibration_of(self.answer.number, tell))
            self.answer = CalibrationAnswer.model_validate(found)
        return self.answer
