"""A series: a queue of planned drops in the daemon. One abort ends it all."""

from __future__ import annotations

from collections.abc import Sequence

from fastapi import APIRouter

from impactd.api.arrivals import Accepted
from impactd.api.client_keys import job_key
from impactd.api.routes.drops import environment_of, owner_name, required_key
from impactd.api.schemas import Key
from impactd.api.security import TheCaller, TheDaemon
from impactd.api.series_schemas import MoreDropsBody, OrderBody, SeriesBody, SeriesDrops
from impactd.series.run import Series
from impactd.storage.drops import DropRequest
from impactd.wire.series_answers import PlannedDropAnswer, SeriesAnswer

router = APIRouter(prefix="/v1/series", tags=["series"])
_KIND = "series"


@router.post("", status_code=202)
def begin_series(
    body: SeriesBody, daemon: TheDaemon, caller: TheCaller, accepted: Accepted, key: Key = None
) -> SeriesAnswer:
    """Begin a series of drops; the daemon makes them one after the other.

    The rig is held until the last one. A drop that brings no shot pauses the series; `POST
    /v1/abort` ends it, with every drop that is left.
    """
    stored = job_key(caller, _KIND, required_key(key, "run a series of drops"))
    assert stored is not None
    made = daemon.series.begin(
        _requests(body.drops),
        owner=owner_name(body.drops[0].operator, caller),
        note=body.note,
        key=stored,
        accepted=accepted,
    )
    return _answer(made)


@router.get("")
def show_series(daemon: TheDaemon) -> SeriesAnswer:
    """Show the series that runs, or ran last since the daemon began."""
    return _answer(daemon.series.current())


@router.post("/drops")
def add_drops(body: MoreDropsBody, daemon: TheDaemon) -> SeriesAnswer:
    """Plan more drops at the end of the series that runs."""
    return _answer(daemon.series.add(_requests(body.drops)))


@router.put("/order")
def reorder(body: OrderBody, daemon: TheDaemon) -> SeriesAnswer:
    """Make the planned drops in this order; those that are left out are not made."""
    return _answer(daemon.series.reorder(body.order))


@router.post("/pause")
def pause(daemon: TheDaemon, caller: TheCaller) -> SeriesAnswer:
    """Let no further drop begin until it is resumed; the one under way goes on."""
    return _answer(daemon.series.pause(by=caller.name))


@router.post("/resume")
def resume(daemon: TheDaemon) -> SeriesAnswer:
    """Go on with the next drop."""
    return _answer(daemon.series.resume())


@router.delete("")
def end(daemon: TheDaemon, caller: TheCaller) -> SeriesAnswer:
    """Let no further drop begin, for good; the one under way goes on."""
    return _answer(daemon.series.end(by=caller.name))


def _requests(drops: Sequence[SeriesDrops]) -> list[DropRequest]:
    return [
        DropRequest(
            one.sphere,
            one.surface,
            one.drop_height_m,
            one.operator,
            environment_of(one.environment),
        )
        for one in drops
        for _ in range(one.repeats)
    ]


def _answer(series: Series | None) -> SeriesAnswer:
    if series is None:
        return SeriesAnswer(
            state="none",
            reason="",
            owner=None,
            note="",
            done=0,
            of=0,
            remaining_s=None,
            drops=[],
        )
    return SeriesAnswer(
        state=series.state,
        reason=series.reason,
        owner=series.owner,
        note=series.note,
        done=series.done,
        of=len(series.drops),
        remaining_s=series.remaining_s,
        drops=[
            PlannedDropAnswer(
                id=one.id,
                state=one.state,
                drop=one.drop,
                sphere=one.request.sphere,
                surface=one.request.surface,
                drop_height_m=one.request.drop_height_m,
                operator=one.request.operator,
            )
            for one in series.drops
        ],
    )
