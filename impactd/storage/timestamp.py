"""The one form in which this archive writes a moment: ISO 8601, UTC, microseconds, ``Z``.

Text of this form sorts as time does, which the index relies on.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

_FORM = "%Y-%m-%dT%H:%M:%S.%fZ"


def utc_now() -> str:
    """Return the present moment.

    Returns
    -------
    str
        E.g. ``2026-03-01T12:00:00.000000Z``.
    """
    return datetime.now(UTC).strftime(_FORM)


def utc_after(days: float) -> str:
    """Return the moment so many days from now.

    Parameters
    ----------
    days : float
        [d]

    Returns
    -------
    str
        In the same form as `utc_now`.
    """
    return (datetime.now(UTC) + timedelta(days=days)).strftime(_FORM)


def utc_at(epoch_s: float) -> str:
    """Return a moment of the host's clock, e.g. of a file, in the same form as `utc_now`. [s]"""
    return datetime.fromtimestamp(epoch_s, UTC).strftime(_FORM)


def as_utc(text: str) -> str:
    """Return any ISO 8601 moment in the archive's form, so that texts compare as times.

    Parameters
    ----------
    text : str
        A date or a moment; without a zone it is UTC.

    Returns
    -------
    str
        In the same form as `utc_now`.

    Raises
    ------
    ValueError
        If the text is no moment.
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return moment.astimezone(UTC).strftime(_FORM)
