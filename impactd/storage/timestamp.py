"""The one form of a timestamp in this archive: ISO 8601, UTC, microseconds, ``Z``.

Text of this form sorts as time does, which the index relies on.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

_FORM = "%Y-%m-%dT%H:%M:%S.%fZ"


def utc_now() -> str:
    """Return the present time, e.g. ``2026-03-01T12:00:00.000000Z``."""
    return datetime.now(UTC).strftime(_FORM)


def utc_after(days: float) -> str:
    """Return the time so many days from now, in the form of `utc_now`."""
    return (datetime.now(UTC) + timedelta(days=days)).strftime(_FORM)


def utc_at(epoch_s: float) -> str:
    """Return a time of the host's clock [s], e.g. of a file, in the form of `utc_now`."""
    return datetime.fromtimestamp(epoch_s, UTC).strftime(_FORM)


def as_utc(text: str) -> str:
    """Return any ISO 8601 date or time in the form of `utc_now`, so that texts compare as times.

    Without a zone it is UTC. Raises ValueError if the text is no such time.
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return moment.astimezone(UTC).strftime(_FORM)
