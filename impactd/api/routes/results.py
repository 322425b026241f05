"""Results: moduli, the mean and scatter of every pair, control charts, and selections to take away.

``GET /v1/moduli`` says what all shots together tell of each material. Here is what stands behind
it, pair by pair, in an answer that stays small however many shots there are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import HTMLResponse, StreamingResponse

from impactd.api.answers import timestamp
from impactd.api.finite import without_nan
from impactd.api.problems import ProblemError
from impactd.api.schemas import Moment
from impactd.api.security import TheDaemon
from impactd.daemon import Daemon
from impactd.moduli.control_chart import PairChart, trend
from impactd.reports import selection
from impactd.reports.campaign import campaign_page
from impactd.reports.charts import REPORT_POLICY
from impactd.storage.version import software
from impactd.wire.results_answers import (
    ChartAnswer,
    ControlLimits,
    PairResult,
    RelativeChange,
    ResultsAnswer,
)

router = APIRouter(prefix="/v1/results", tags=["results"])
MOST_SHOTS = 20_000
"""In a table of a selection: 4 MB of CSV."""
MOST_FILES = 500
"""In a zip of files: at 0.8 MB a shot 400 MB, which a browser takes in a minute."""
_SHARED = (
    "model",
    "moduli",
    "network",
    "calibration",
    "warnings",
    "since",
    "until",
    "software",
)
"""What the answer has in common with ``GET /v1/moduli``."""
_TOLD_OUTSIDE = 20
_REPORTED_POINTS = 400
_Text = Annotated[str | None, Query(min_length=1, max_length=200)]


@router.get("")
def results(
    daemon: TheDaemon, since: Moment = None, until: Moment = None, model: _Text = None
) -> ResultsAnswer:
    """Show moduli by material with their network, and mean and scatter of every pair.

    `model` is the active one unless it is given; `since` and `until` choose shots by their time.
    """
    chosen = {
        "since": timestamp("since", since),
        "until": timestamp("until", until),
        "model": model,
    }
    head = daemon.moduli(specimen=None, **chosen).head
    charts = daemon.charts(**chosen)
    means = {(one["sphere"], one["surface"]): one for one in head["pairs"].values()}
    return ResultsAnswer(
        **without_nan({key: head[key] for key in _SHARED}),
        shots=sum(len(chart.numbers) for chart in charts.values()),
        pairs=[
            _pair(sphere, surface, chart, means.get((sphere, surface), {}))
            for (sphere, surface), chart in charts.items()
        ],
    )


@router.get("/chart")
def chart(  # noqa: PLR0917 - the framework fills them by name
    daemon: TheDaemon,
    sphere: Annotated[str, Query(min_length=1, max_length=64)],
    surface: Annotated[str, Query(min_length=1, max_length=64)],
    since: Moment = None,
    until: Moment = None,
    model: _Text = None,
    points: Annotated[int, Query(ge=10, le=4000)] = 1000,
) -> ChartAnswer:
    """Show a pair's control chart: each shot's reduced modulus between limits (ISO 7870-2).

    Of more shots than `points` the extremes of even stretches are given, and every one that is
    outside the limits.
    """
    charts = daemon.charts(
        since=timestamp("since", since), until=timestamp("until", until), model=model
    )
    found = charts.get((sphere, surface))
    if found is None:
        raise ProblemError(
            "not-found", f"No shot of {sphere!r} on {surface!r} takes part in the results."
        )
    places = found.places(points)
    value = [math.exp(one) for one in found.log_modulus[places]]
    return ChartAnswer(
        sphere=sphere,
        surface=surface,
        shots=len(found.numbers),
        decimated=len(places) < len(found.numbers),
        numbers=[found.numbers[place] for place in places],
        started_utc=[found.started_utc[place] for place in places],
        reduced_modulus_Pa=value,
        u_Pa=[one * u for one, u in zip(value, found.u_random[places].tolist(), strict=True)],
        control=_control(found),
    )


@router.get("/report.html", response_class=HTMLResponse)
def report(
    daemon: TheDaemon, since: Moment = None, until: Moment = None, model: _Text = None
) -> HTMLResponse:
    """Show all results of a period as one page: moduli, network, pairs, control charts, budgets.

    The parameters are those of `GET /v1/results`.
    """
    found = results(daemon, since, until, model)
    charts = [
        chart(daemon, one.sphere, one.surface, since, until, model, _REPORTED_POINTS)
        for one in found.pairs
    ]
    budget = daemon.moduli_budget(
        specimen=None,
        since=timestamp("since", since),
        until=timestamp("until", until),
        model=model,
    )
    page = campaign_page(
        found.model_dump(), [one.model_dump() for one in charts], without_nan(budget)
    )
    return HTMLResponse(page, headers={"Content-Security-Policy": REPORT_POLICY})


@router.get("/export", response_class=Response)
def export(  # noqa: PLR0917 - the framework fills them by name
    daemon: TheDaemon,
    format: Annotated[Literal["csv", "csv.gz", "json", "parquet", "hdf5"], Query()] = "csv",
    shots: Annotated[
        str | None, Query(min_length=1, max_length=4000, description="For example 3, 5, 8-19.")
    ] = None,
    sphere: _Text = None,
    surface: _Text = None,
    since: Moment = None,
    until: Moment = None,
) -> Response:
    """Download a selection: numbers as CSV, JSON or Parquet, or a zip of files with the CSV."""
    by = {
        "sphere": sphere,
        "surface": surface,
        "since": timestamp("since", since),
        "until": timestamp("until", until),
    }
    chosen = _selection(daemon, shots, by)
    name = f"impactd-{datetime.now(UTC):%Y%m%d-%H%M%S}"
    if format == "hdf5":
        if len(chosen.shots) > MOST_FILES:
            raise ProblemError(
                "invalid",
                f"These are {len(chosen.shots)} shots; a zip holds {MOST_FILES} at most.",
                remedy="Select fewer, by time or by numbers, or use the CSV.",
            )
        return StreamingResponse(
            selection.as_zip(daemon.archive, chosen),
            media_type="application/zip",
            headers=_attached(f"{name}.zip"),
        )
    if format == "parquet":
        return Response(
            _parquet(daemon, chosen),
            media_type="application/vnd.apache.parquet",
            headers=_attached(f"{name}.parquet"),
        )
    made, media_type = {
        "csv": (selection.as_csv, "text/csv; charset=utf-8"),
        "csv.gz": (selection.as_gzip, "application/gzip"),
        "json": (selection.as_json, "application/json"),
    }[format]
    return Response(
        made(daemon.archive, chosen), media_type=media_type, headers=_attached(f"{name}.{format}")
    )


def _parquet(daemon: Daemon, chosen: selection.Selection) -> bytes:
    try:
        return selection.as_parquet(daemon.archive, chosen)
    except selection.NoParquetError as error:
        raise ProblemError(
            "invalid",
            "The daemon cannot write Parquet: its extra `parquet` is not installed.",
            remedy="Take the CSV, or install impactd[parquet] where the daemon runs.",
        ) from error


def _attached(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}


def _selection(
    daemon: Daemon, numbers: str | None, by: dict[str, str | None]
) -> selection.Selection:
    wanted = None if numbers is None else selection.numbers_of(numbers)
    if numbers is not None and wanted is None:
        raise ProblemError(
            "invalid",
            (f"shots is {numbers!r}, which is not a list of numbers."),
            remedy="Write 3, 5, 8-19.",
        )
    before, limit = _range_of(wanted)
    found = daemon.archive.shots(
        sphere=by["sphere"],
        surface=by["surface"],
        since=by["since"],
        until=by["until"],
        before=before,
        limit=limit,
    )
    named = None if wanted is None else set(wanted)
    kept = [one for one in reversed(found) if named is None or one.number in named]
    if not kept:
        raise ProblemError("not-found", "No stored shot is in this selection.")
    if len(kept) > MOST_SHOTS:
        raise ProblemError(
            "invalid",
            f"More than {MOST_SHOTS} shots are in this selection.",
            remedy="Select fewer, by pair or by time.",
        )
    return selection.Selection(tuple(kept), {**by, "numbers": numbers}, software())


def _range_of(numbers: Sequence[int] | None) -> tuple[int | None, int]:
    """Return below which number to look, and at how many shots; one more than a table may hold."""
    if numbers is None:
        return None, MOST_SHOTS + 1
    return numbers[-1] + 1, numbers[-1] - numbers[0] + 1


def _pair(sphere: str, surface: str, chart: PairChart, mean: dict[str, object]) -> PairResult:
    change = trend(chart)
    return PairResult(
        sphere=sphere,
        surface=surface,
        shots=len(chart.numbers),
        first_utc=min(chart.started_utc),
        last_utc=max(chart.started_utc),
        reduced_modulus_Pa=without_nan(mean.get("reduced_modulus_Pa")),
        score=without_nan(mean.get("score")),
        scatter_relative=chart.scatter,
        expected_scatter_relative=math.sqrt(float((chart.u_random**2).mean())),
        trend=None if change is None else RelativeChange(**change),
        control=_control(chart),
    )


def _control(chart: PairChart) -> ControlLimits | None:
    limits = chart.limits
    if limits is None:
        return None
    outside = chart.outside()
    return ControlLimits(
        centre_Pa=math.exp(chart.centre),
        lower_Pa=math.exp(limits[0]),
        upper_Pa=math.exp(limits[1]),
        outside=[chart.numbers[place] for place in outside[-_TOLD_OUTSIDE:]],
        outside_count=len(outside),
    )
