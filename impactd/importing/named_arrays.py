"""Arrays with names, as npy, npz, MAT and HDF5 files hold them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactd.importing.errors import RecordingError
from impactd.importing.recording import Channel, Recording
from impactd.importing.times import counts_samples, rate_of_times
from impactd.importing.units import find_time_unit, find_unit, is_time_name, split_name
from impactd.storage.campaign_shot import MIN_SAMPLES

_RATE = re.compile(r"^(fs|f_s|sr|rate|fsamp|(sampl\w*|sampling)[_ ]?(rate|freq\w*))(_?hz)?$", re.I)
_INTERVAL = re.compile(
    r"^(dt|delta_?[tx]|ts|(sampl\w*)[_ ]?(interval|period|time)|increment|wf_increment)$", re.I
)
_TABLE_COLUMNS = 64
"""A matrix of more columns is no table of channels."""


def recording_of(
    file: str,
    arrays: Mapping[str, NDArray[Any]],
    *,
    units: Mapping[str, str] | None = None,
    only: str | None = None,
) -> Recording:
    """Return named arrays as a recording, with a channel for each that is long enough for a record.

    Parameters
    ----------
    arrays : mapping
        Signals, a column of times, the sampling rate or interval as a single number.
    units : mapping, optional
        Units that the file states, by name.
    only : str, optional
        The array that is meant; others give rate and times only.

    Raises
    ------
    RecordingError
        If none is long enough.
    """
    units = dict(units or {})
    numeric = {
        name: _real(file, name, value) for name, value in arrays.items() if _is_numeric(value)
    }
    rate = _single(numeric)
    assumed: list[str] = []
    if rate is not None:
        assumed.append(f"{file}: {rate[0]} is taken for the sampling {rate[1]}.")
    times = {name: v for name, v in numeric.items() if v.size >= MIN_SAMPLES and _is_time(name)}
    u_rate, time_unit = 0.0, None
    rate_hz = None if rate is None else rate[2]
    has_times = False
    channels: list[Channel] = []
    for name, value in numeric.items():
        if name in times or value.size < MIN_SAMPLES or (only is not None and name != only):
            continue
        table = _columns(value)
        if table is None:
            made = _traces(file, name, value, assumed)
            channels.append(_channel(name, len(channels) + 1, made, value, units))
            continue
        assumed.append(
            f"{file}: the first column of {name or 'the array'} rises evenly and is taken for the "
            "time."
        )
        even = rate_of_times(file, table[0], None)
        rate_hz, u_rate, has_times = even.rate_hz, even.u_rate_hz, True
        assumed += even.said
        channels += [
            _channel(f"{name} column {at + 1}".strip(), at + 1, (column,), value, units)
            for at, column in enumerate(table)
            if at
        ]
    if not channels:
        listed = ", ".join(f"{n or 'array'} {np.shape(v)}" for n, v in arrays.items()) or "nothing"
        raise RecordingError(
            file,
            f"holds no array of {MIN_SAMPLES} numbers or more (there: {listed[:200]}).",
            "Save the signal as one array, or as one row for each hit.",
        )
    if rate_hz is None and times:
        name, value = next(iter(times.items()))
        time_unit = find_time_unit(units.get(name)) or find_time_unit(split_name(name)[1])
        even = rate_of_times(file, np.ravel(value).astype(np.float64), time_unit)
        rate_hz, u_rate, has_times = even.rate_hz, even.u_rate_hz, True
        assumed += [f"{file}: {name} is taken for the time.", *even.said]
    return Recording(file, tuple(channels), rate_hz, u_rate, time_unit, has_times, tuple(assumed))


def _is_numeric(value: NDArray[Any]) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.size > 0


def _real(file: str, name: str, value: NDArray[Any]) -> NDArray[Any]:
    """Return an array without the dimensions of length 1."""
    found = np.squeeze(value)
    if found.ndim > 2:
        raise RecordingError(
            file,
            f"holds {name or 'an array'} of shape {value.shape}.",
            "Save it as one row for each hit: one or two dimensions are read.",
        )
    return found


def _is_time(name: str) -> bool:
    return is_time_name(split_name(name.rpartition(".")[2].rpartition("/")[2])[0])


def _single(numeric: Mapping[str, NDArray[Any]]) -> tuple[str, str, float] | None:
    """Return the name, kind and hertz of a single number that is a rate or an interval."""
    for name, value in numeric.items():
        short = name.rpartition(".")[2].rpartition("/")[2]
        if value.size != 1 or not float(value.ravel()[0]) > 0:
            continue
        number = float(value.ravel()[0])
        if _RATE.match(short):
            return name, "rate", number
        if _INTERVAL.match(short):
            return name, "interval", float(f"{1 / number:.9g}")
    return None


def _columns(value: NDArray[Any]) -> list[NDArray[np.float64]] | None:
    """Return the columns of a table whose first column is the time, else ``None``."""
    if value.ndim != 2:
        return None
    table = value if value.shape[0] > value.shape[1] else value.T
    if not 2 <= table.shape[1] <= _TABLE_COLUMNS or table.shape[0] < MIN_SAMPLES:
        return None
    first = np.asarray(table[:, 0], dtype=np.float64)
    steps = np.diff(first)
    rises = first[-1] > first[0] and bool(np.all(steps >= 0)) and not counts_samples(first)
    if not rises or np.ptp(steps) > 2 * np.median(steps):
        return None
    return [np.ascontiguousarray(column, dtype=np.float64) for column in table.T]


def _traces(
    file: str, name: str, value: NDArray[Any], assumed: list[str]
) -> tuple[NDArray[np.float64], ...]:
    """Return a row for each recording."""
    if value.ndim == 1:
        return (np.asarray(value, dtype=np.float64),)
    rows = value
    what = name or "the array"
    if value.shape[0] > value.shape[1]:
        rows = value.T
        assumed.append(
            f"{file}: {what} has {value.shape[0]} rows and {value.shape[1]} columns; each column "
            "is taken for a recording."
        )
    else:
        assumed.append(f"{file}: each of the {value.shape[0]} rows of {what} is a recording.")
    return tuple(np.ascontiguousarray(row, dtype=np.float64) for row in rows)


def _channel(
    name: str,
    number: int,
    traces: tuple[NDArray[np.float64], ...],
    value: NDArray[Any],
    units: Mapping[str, str],
) -> Channel:
    short, unit = split_name(name)
    stated = units.get(name) or (unit if find_unit(unit) is not None else None)
    step = 1.0 if value.dtype.kind in "iu" else None
    return Channel(short or "signal", number, traces, stated, step)
