"""Results as pandas tables and xarray datasets, with their units in ``attrs``."""

# ruff: noqa: PLC0415 - the packages of the extra `client` are needed here and nowhere else

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from impactd.client.errors import RigError
from impactd.wire.answers import ShotAnswer

if TYPE_CHECKING:
    import h5py
    import pandas
    import xarray

_MODULI = ("youngs_modulus_Pa", "plane_strain_modulus_Pa")
_NO_PANDAS = "a table needs pandas: pip install 'impactd[client]'"
_NO_XARRAY = "a dataset needs xarray: pip install 'impactd[client]'"


def _measured(name: str, quantity: Mapping[str, Any] | None) -> dict[str, float]:
    """Return value, standard uncertainty and 95 % interval; not-a-number where withheld."""
    nan = float("nan")
    found = quantity or {}
    low, high = found.get("interval95") or (nan, nan)
    members = {
        name: found.get("value"),
        f"u_{name}": found.get("u"),
        f"low95_{name}": low,
        f"high95_{name}": high,
    }
    return {key: nan if value is None else float(value) for key, value in members.items()}


def _with_units(frame: pandas.DataFrame) -> pandas.DataFrame:
    ends = {"_Pa": "Pa", "_m": "m", "_hz": "Hz"}
    frame.attrs["units"] = {
        column: unit
        for column in frame.columns
        for end, unit in ends.items()
        if str(column).endswith(end)
    }
    return frame


def moduli_frame(answer: Mapping[str, Any]) -> pandas.DataFrame:
    """Return the moduli of ``GET /v1/moduli``, one material a row.

    Parameters
    ----------
    answer : mapping
        Of the API.

    Returns
    -------
    pandas.DataFrame
        By material; ``attrs`` hold ``units``, ``model``, ``calibrations`` and ``warnings``.
    """
    try:
        import pandas
    except ImportError as error:
        raise RigError(_NO_PANDAS) from error
    rows = {
        material: {"side": found["side"], "status": found["status"]}
        | {key: value for name in _MODULI for key, value in _measured(name, found[name]).items()}
        for material, found in answer["moduli"].items()
    }
    frame = pandas.DataFrame.from_dict(rows, orient="index")
    frame.index.name = "material"
    for name in ("model", "calibrations", "warnings", "software"):
        frame.attrs[name] = answer.get(name)
    return _with_units(frame)


def shots_frame(shots: Iterable[ShotAnswer]) -> pandas.DataFrame:
    """Return shots, one a row, by number.

    Parameters
    ----------
    shots : iterable of ShotAnswer
        As a list with ``summary`` gives them.

    Returns
    -------
    pandas.DataFrame
        ``attrs`` hold ``units``; ``peak`` is in the unit of each shot's ``quantity``.
    """
    try:
        import pandas
    except ImportError as error:
        raise RigError(_NO_PANDAS) from error
    rows = [
        {
            "number": shot.number,
            "started_utc": shot.started_utc,
            "sphere": shot.sphere,
            "surface": shot.surface,
            "drop_height_m": shot.drop_height_m,
            "quantity": shot.quantity,
            "peak": shot.peak,
            "clipped": shot.clipped,
            "advice": shot.advice,
            "model": shot.model,
            **_measured("reduced_modulus_Pa", shot.reduced_modulus_Pa),
        }
        for shot in shots
    ]
    frame = pandas.DataFrame(rows)
    if rows:
        frame["started_utc"] = pandas.to_datetime(frame["started_utc"], utc=True)
        frame = frame.set_index("number")
    return _with_units(frame)


def record_dataset(
    file: h5py.File, start_s: float | None = None, stop_s: float | None = None
) -> xarray.Dataset:
    """Return a shot's record, or a stretch of it; only that stretch is read.

    Parameters
    ----------
    file : h5py.File
        The shot's.
    start_s, stop_s : float, optional
        First and last moment, from the trigger. [s]

    Returns
    -------
    xarray.Dataset
        ``signal`` over ``time``, each with ``units``.
    """
    try:
        import numpy as np
        import xarray
    except ImportError as error:
        raise RigError(_NO_XARRAY) from error
    entry, acquisition = file["entry"], file["entry/instrument/acquisition"]
    rate_hz = float(acquisition["sample_rate"][()])
    trigger = int(acquisition["trigger_index"][()])
    codes = entry["instrument/digitizer/data"]
    first = 0 if start_s is None else round(start_s * rate_hz) + trigger
    stop = codes.shape[0] if stop_s is None else round(stop_s * rate_hz) + trigger + 1
    first, stop = max(first, 0), min(stop, codes.shape[0])
    if first >= stop:
        raise RigError(
            f"the record has no samples between {start_s} s and {stop_s} s; it lasts from "
            f"{-trigger / rate_hz:g} s to {(codes.shape[0] - 1 - trigger) / rate_hz:g} s."
        )
    per_code, offset = acquisition["signal_per_code"], acquisition["signal_offset"]
    signal = codes[first:stop] * float(per_code[()]) + float(offset[()])
    time_s = (np.arange(first, stop) - trigger) / rate_hz
    unit = str(per_code.attrs["units"])
    title = entry["title"].asstr()[()]
    return xarray.Dataset(
        {"signal": ("time", signal, {"units": unit, "long_name": f"signal ({unit})"})},
        {"time": ("time", time_s, {"units": "s", "long_name": "time after the trigger (s)"})},
        {
            "title": title,
            "started_utc": entry["start_time"].asstr()[()],
            "sample_rate_hz": rate_hz,
            "sphere": entry["sphere/name"].asstr()[()] if "sphere/name" in entry else "",
            "surface": entry["sample/name"].asstr()[()] if "sample/name" in entry else "",
        },
    )
