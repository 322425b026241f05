"""A series: a queue of planned drops that the daemon makes one after the other.

::

    POST /v1/series ──> reserve the rig, own thread
        while something is planned: request_drop ──> wait for its end ──> the next
        pause, reorder, add and end change the plan between two drops

The queue is kept by the daemon, not by a browser: a page that is loaded again finds it. Each of its
drops carries the abort epoch at which the series was asked for, so an abort voids all that are
left, wherever they wait. A series does not outlive the daemon: nothing falls because of a restart.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import structlog

from impactd.acquisition.errors import RequestAbortedError, RequestRefusedError
from impactd.acquisition.failures import failure_of
from impactd.acquisition.reservation import Reservation
from impactd.acquisition.service import AcquisitionService
from impactd.settings.materials import UnknownMaterialError
from impactd.settings.settings import Settings
from impactd.storage.archive import DropRequest
from impactd.storage.request_key import RequestKey

MOST_DROPS = 500

State = Literal["running", "paused", "ended"]
DropState = Literal["planned", "under way", "done", "failed"]
_log = structlog.get_logger("impactd.series")


class SeriesRefusedError(RequestRefusedError):
    """A series cannot be begun, or be changed so; the message says why, and what to do."""

    def __init__(self, what: str) -> None:
        self.what = what
        super().__init__(what)


@dataclass(frozen=True)
class Planned:
    """One drop of a series."""

    id: int
    """From 1, in the order of planning."""
    request: DropRequest
    state: DropState = "planned"
    drop: int | None = None
    """Its number, once it was asked for."""


@dataclass(frozen=True)
class Series:
    """The present state of a series."""

    key: str
    """The client's idempotency key, as stored."""
    owner: str
    """Who asked for it."""
    note: str
    state: State
    reason: str
    """Why it is paused or ended; empty while it runs."""
    drops: tuple[Planned, ...]
    """In the order in which they are made."""
    remaining_s: float | None = None
    """From the drops so far; ``None`` before the first. [s]"""

    @property
    def done(self) -> int:
        """Number of drops that brought a shot."""
        return sum(one.state == "done" for one in self.drops)


class SeriesRunner:
    """Runs series, one at a time. Thread safe.

    ``publish`` gets kind and data of each event: ``series.changed``.
    """

    def __init__(
        self,
        service: AcquisitionService,
        settings: Settings,
        publish: Callable[[str, dict[str, Any]], None],
    ) -> None:
        self._service = service
        self._settings = settings
        self._publish = publish
        self._changed = threading.Condition()
        self._begin_lock = threading.Lock()
        self._series: Series | None = None
        self._end_asked = ""
        self._stopping = False
        self._thread: threading.Thread | None = None

    def current(self) -> Series | None:
        """Return the series that runs or ran last."""
        with self._changed:
            return self._series

    def begin(
        self,
        requests: Sequence[DropRequest],
        *,
        owner: str,
        note: str,
        key: str,
        accepted: int,
    ) -> Series:
        """Reserve the rig and begin, or return the series of the same key.

        ``key`` is the idempotency key as stored, ``accepted`` the abort epoch at which the request
        was received.

        Raises
        ------
        SeriesRefusedError
            If there are too many drops.
        UnknownMaterialError, DropHeightError, BusyError, NotReadyError, RequestAbortedError
            As for a drop.
        """
        with self._begin_lock:
            known = self.current()
            if known is not None and known.key == key:
                return known
            self._check(requests, already=0)
            reservation = self._service.reserve(f"a series of {owner}", accepted=accepted)
            drops = tuple(Planned(at, one) for at, one in enumerate(requests, start=1))
            with self._changed:
                self._end_asked = ""
                self._series = Series(key, owner, note, "running", "", drops)
                made = self._series
            self._thread = threading.Thread(
                target=self._run, args=(reservation,), name="series", daemon=True
            )
            self._thread.start()
        self._tell()
        return made

    def add(self, requests: Sequence[DropRequest]) -> Series:
        """Plan more drops at the end of the series that runs; raise as `begin`."""
        series = self._alive()
        self._check(requests, already=len(series.drops))
        with self._changed:
            series = self._alive()
            first = max(one.id for one in series.drops) + 1
            more = tuple(Planned(at, one) for at, one in enumerate(requests, start=first))
            return self._set(replace(series, drops=(*series.drops, *more)))

    def reorder(self, ids: Sequence[int]) -> Series:
        """Make the planned drops in this order; those that are not named are taken out.

        Raises SeriesRefusedError if an id is named twice, or is no drop that is still planned.
        """
        with self._changed:
            series = self._alive()
            planned = {one.id: one for one in series.drops if one.state == "planned"}
            wrong = [one for one in ids if one not in planned]
            if wrong or len(set(ids)) != len(ids):
                raise SeriesRefusedError(
                    f"Drop {wrong[0]} of the series is no longer planned; read the series again."
                    if wrong
                    else "A drop appears twice in the order."
                )
            begun = tuple(one for one in series.drops if one.state != "planned")
            return self._set(replace(series, drops=(*begun, *(planned[one] for one in ids))))

    def pause(self, *, by: str) -> Series:
        """Let no further drop begin until `resume`; the one under way goes on."""
        with self._changed:
            return self._set(replace(self._alive(), state="paused", reason=f"{by} paused it."))

    def resume(self) -> Series:
        """Continue with the next drop."""
        with self._changed:
            return self._set(replace(self._alive(), state="running", reason=""))

    def end(self, *, by: str) -> Series:
        """Let no further drop begin, for good; the one under way goes on."""
        with self._changed:
            series = self._alive()
            self._end_asked = f"{by} ended it."
            self._changed.notify_all()
            return series

    def stop(self) -> None:
        """Let no further drop begin and wait for the end; the service aborts the one under way."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(timeout=30.0)

    # The run

    def _check(self, requests: Sequence[DropRequest], *, already: int) -> None:
        if not requests or already + len(requests) > MOST_DROPS:
            raise SeriesRefusedError(f"A series has 1 to {MOST_DROPS} drops.")
        for one in requests:
            self._service.materials.check(one.sphere, one.surface)
            self._service.check_height(one.drop_height_m)

    def _alive(self) -> Series:
        series = self._series
        if series is None or series.state == "ended":
            raise SeriesRefusedError("No series is under way.")
        return series

    def _run(self, reservation: Reservation) -> None:
        began_s, reason = time.monotonic(), "a defect of the daemon"
        try:
            reason = self._make_all(reservation, began_s)
        except RequestAbortedError as error:
            reason = str(error)
        except Exception as error:  # the series ends with a reason, whatever it was
            reason = failure_of(error).problem.detail
            _log.exception("a series ended by an error")
        finally:
            self._service.give_back(reservation)
            with self._changed:
                assert self._series is not None
                self._set(replace(self._series, state="ended", reason=reason, remaining_s=None))

    def _make_all(self, reservation: Reservation, began_s: float) -> str:
        while True:
            planned = self._next(reservation)
            if isinstance(planned, str):
                return planned
            self._mark(planned.id, state="under way")
            try:
                drop = self._service.request_drop(
                    planned.request,
                    owner=reservation.owner,
                    # Of client and place: not even a second run could make this drop again.
                    idempotency_key=RequestKey("series", f"{self._key()} {planned.id}").text,
                    # Of the series: an abort between two drops voids all that are left.
                    accepted=reservation.accepted,
                    series=reservation,
                )
            except (RequestRefusedError, UnknownMaterialError) as error:
                if isinstance(error, RequestAbortedError):
                    raise
                self._mark(planned.id, state="failed")
                self._pause_for(str(error))
                continue
            self._mark(planned.id, drop=drop.number)
            drop = self._service.wait_for_end(drop.number)
            good = drop.state in ("stored", "analysed")
            self._mark(planned.id, state="done" if good else "failed", began_s=began_s)
            if drop.state == "aborted" or reservation.aborted.is_set():
                return f"{reservation.aborted_by or 'somebody'} aborted it."
            if not good:
                detail = drop.problem.detail if drop.problem else f"it is {drop.state}."
                self._pause_for(f"Drop {drop.number} gave no shot: {detail}")
            self._service.wait_ready(self._settings.timeouts.recover_every_s + 5.0)

    def _next(self, reservation: Reservation) -> Planned | str:
        """Return the next planned drop, or why there is none; wait while it is paused."""
        with self._changed:
            while True:
                if reservation.aborted.is_set():
                    return f"{reservation.aborted_by} aborted it."
                if self._stopping:
                    return "the daemon ended."
                if self._end_asked:
                    return self._end_asked
                series = self._alive()
                if series.state == "running":
                    left = [one for one in series.drops if one.state == "planned"]
                    return left[0] if left else _all_done(series)
                self._changed.wait(0.2)  # an abort tells only the reservation

    def _pause_for(self, reason: str) -> None:
        with self._changed:
            self._set(replace(self._alive(), state="paused", reason=reason))

    def _mark(
        self,
        which: int,
        *,
        state: DropState | None = None,
        drop: int | None = None,
        began_s: float | None = None,
    ) -> None:
        with self._changed:
            series = self._alive()
            drops = tuple(
                replace(one, state=state or one.state, drop=drop or one.drop)
                if one.id == which
                else one
                for one in series.drops
            )
            series = replace(series, drops=drops)
            if began_s is not None and series.done:
                left = sum(one.state == "planned" for one in drops)
                each_s = (time.monotonic() - began_s) / series.done
                series = replace(series, remaining_s=each_s * left)
            self._set(series)

    def _key(self) -> str:
        series = self.current()
        return "" if series is None else series.key

    def _set(self, series: Series) -> Series:
        """Replace the state of the series; the caller holds the condition."""
        self._series = series
        self._changed.notify_all()
        self._tell()
        return series

    def _tell(self) -> None:
        series = self._series
        if series is not None:
            told = {"state": series.state, "done": series.done, "of": len(series.drops)}
            self._publish("series.changed", {**told, "reason": series.reason})


def _all_done(series: Series) -> str:
    many = len(series.drops)
    if series.done == many:
        return f"All {many} drops are done."
    return f"{series.done} of {many} drops gave a shot."
