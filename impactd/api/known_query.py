"""Query parameters that a route does not know are refused: a misspelt filter must not be "all"."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Any

from fastapi import Request

from impactd.api.problems import ProblemError


async def refuse_unknown_query(request: Request) -> None:
    """Raise `ProblemError` 422 when the query holds a name that the route does not know."""
    if not request.url.query:
        return
    route = request.scope["route"]
    known = _known(route)
    unknown = [name for name in request.query_params if name not in known]
    if not unknown:
        return
    close = difflib.get_close_matches(unknown[0], known, n=1)
    hint = f"Did you mean {close[0]!r}? " if close else ""
    listed = f"It knows {', '.join(sorted(known))}." if known else "It knows none."
    raise ProblemError(
        "invalid",
        f"{request.method} {route.path} has no query parameter {unknown[0]!r}.",
        remedy=f"{hint}{listed}",
        errors=[
            {"in": "query", "parameter": name, "reason": "unknown parameter"} for name in unknown
        ],
    )


def _known(route: Any) -> frozenset[str]:
    return frozenset(_names(route.dependant))


def _names(dependant: Any) -> Iterator[str]:
    for one in dependant.query_params:
        yield one.alias
    for inner in dependant.dependencies:
        yield from _names(inner)
