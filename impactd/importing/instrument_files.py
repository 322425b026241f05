"""WAV, UFF 58, TDMS and LVM files, by the libraries made for them."""

from __future__ import annotations

import importlib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io.wavfile

from impactd.importing.errors import RecordingError
from impactd.importing.recording import Channel, Recording
from impactd.importing.text_table import decode, read_text

_TIME_RESPONSE = 1
"""Function type of a UFF 58 data set that is a signal over time."""
_LVM_FIRST_LINE = "LabVIEW Measurement"


def _library(name: str, distribution: str, path: Path) -> Any:
    """Return an optional library; raise RecordingError with the way to install it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise RecordingError(
            path.name,
            f"needs the package {distribution}, which is not installed.",
            f"Install it with: pip install {distribution} (or all readers: "
            "pip install 'impactd[importers]').",
        ) from error


def read_wav(path: Path) -> Recording:
    """Return the channels of a WAV file, full scale as 1."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # chunks that scipy does not know: notes, time codes
            rate, values = scipy.io.wavfile.read(path)
    except Exception as error:  # scipy raises what it stumbles on
        raise RecordingError(
            path.name, "is no WAV file that can be read.", "Export it as PCM."
        ) from error
    values = np.atleast_2d(np.asarray(values).T)
    step, middle = None, 0.0
    if values.dtype.kind in "iu":
        bits = 8 * values.dtype.itemsize
        step = 2.0 ** (1 - bits)
        middle = 128.0 if values.dtype.kind == "u" else 0.0  # 8-bit WAV counts from 0 to 255
    scaled = (values.astype(np.float64) - middle) * (1.0 if step is None else step)
    channels = tuple(
        Channel(f"channel {at + 1}", at + 1, (np.ascontiguousarray(row),), None, step)
        for at, row in enumerate(scaled)
    )
    said = (
        f"{path.name}: WAV states no unit; full scale counts as 1 of the unit (--scale sets "
        "another value).",
    )
    return Recording(path.name, channels, float(rate), assumed=said if step is not None else ())


def read_uff(path: Path) -> Recording:
    """Return the time responses of a universal file (data set 58)."""
    pyuff = _library("pyuff", "pyuff", path)
    try:
        content = pyuff.UFF(str(path))
        sets = [
            content.read_sets(at) for at, kind in enumerate(content.get_set_types()) if kind == 58
        ]
    except Exception as error:  # pyuff raises what it stumbles on
        raise RecordingError(
            path.name, "is no universal file that can be read.", "Export data set 58 again."
        ) from error
    signals = [one for one in sets if one.get("func_type") == _TIME_RESPONSE]
    if not signals:
        raise RecordingError(
            path.name,
            f"holds no signal over time ({len(sets)} data sets 58 of other functions).",
            "Export the time history, not a spectrum or a frequency response.",
        )
    channels, rates = [], []
    for number, one in enumerate(signals, start=1):
        name = f"{one.get('id1', '') or ''}".strip()
        name = name if name and name.upper() != "NONE" else f"set {number}"
        channels.append(
            Channel(
                name,
                number,
                (np.real(np.asarray(one["data"])).astype(np.float64),),
                _stated(one.get("ordinate_axis_units_lab")),
            )
        )
        rates.append(_spacing(one))
    return _one_rate(path, channels, rates)


def _spacing(one: dict[str, Any]) -> float | None:
    """Return the time between two samples of a data set 58. [s]"""
    x = np.asarray(one.get("x", ()), dtype=np.float64)
    if x.size > 1 and x[-1] > x[0]:
        return float((x[-1] - x[0]) / (x.size - 1))
    return float(one["abscissa_inc"]) if one.get("abscissa_inc") else None


def read_tdms(path: Path) -> Recording:
    """Return the channels of a TDMS file, named ``group/channel``."""
    nptdms = _library("nptdms", "npTDMS", path)
    channels: list[Channel] = []
    rates: list[Any] = []
    try:
        with nptdms.TdmsFile.open(str(path)) as content:
            for group in content.groups():
                for one in group.channels():
                    values = np.asarray(one[:])
                    if values.dtype.kind not in "iuf" or values.size < 2:
                        continue
                    unit = one.properties.get("unit_string") or one.properties.get(
                        "NI_UnitDescription"
                    )
                    step = 1.0 if values.dtype.kind in "iu" else None
                    channels.append(
                        Channel(
                            f"{group.name}/{one.name}",
                            len(channels) + 1,
                            (values.astype(np.float64),),
                            _stated(unit),
                            step,
                        )
                    )
                    rates.append(one.properties.get("wf_increment"))
    except Exception as error:  # npTDMS raises what it stumbles on
        raise RecordingError(
            path.name, "is no TDMS file that can be read.", "It may be cut short: copy it again."
        ) from error
    if not channels:
        raise RecordingError(path.name, "holds no channel of numbers.")
    return _one_rate(path, channels, rates)


def read_lvm(path: Path) -> Recording:
    """Return a LabVIEW text file; without LabVIEW's header it is an ordinary table."""
    text = decode(path)
    if not text.lstrip().startswith(_LVM_FIRST_LINE):
        return read_text(path)
    lvm_read = _library("lvm_read", "lvm_read", path)
    try:
        # not lvm_read.read: that unpickles a file of the same name and .pkl, which may be anyone's
        content = lvm_read.read_str(text)
    except Exception as error:  # lvm_read raises what it stumbles on
        raise RecordingError(
            path.name, "is no LabVIEW file that can be read.", "Export it as text again."
        ) from error
    channels: list[Channel] = []
    rates: list[Any] = []
    for segment in range(content["Segments"]):
        block = content[segment]
        for at, name in enumerate(block["Channel names"]):
            if name in ("X_Value", "Comment"):
                continue
            place = at - (block["Channel names"][0] == "X_Value")
            values = np.asarray(block["data"])[:, at]
            values = values[np.isfinite(values)]
            if values.size < 2:
                continue
            label = f"{name}, segment {segment + 1}" if content["Segments"] > 1 else name
            units = block.get("Y_Unit_Label") or []
            unit = units[place] if place < len(units) else None
            channels.append(Channel(label, len(channels) + 1, (values,), _stated(unit)))
            steps = block.get("Delta_X") or []
            rates.append(steps[place] if place < len(steps) else None)
    if not channels:
        raise RecordingError(path.name, "holds no channel of numbers.")
    return _one_rate(path, channels, rates)


def _stated(unit: object) -> str | None:
    text = str(unit or "").strip()
    return text if text and text.upper() != "NONE" else None


def _one_rate(path: Path, channels: list[Channel], steps: list[Any]) -> Recording:
    """Return a recording of channels that share a sampling interval."""
    told = [float(step) for step in steps if step is not None and float(step) > 0]
    rate = float(f"{1 / told[0]:.9g}") if told else None
    said: tuple[str, ...] = ()
    if told and max(told) > 1.000001 * min(told):
        # one clock has one rate: channels of another are left out, and that is said
        kept = [
            one
            for one, step in zip(channels, steps, strict=True)
            if step is not None and abs(float(step) / told[0] - 1) < 1e-6
        ]
        said = (
            f"{path.name}: {len(channels) - len(kept)} channels have another rate and are left "
            "out.",
        )
        channels = kept
    return Recording(path.name, tuple(channels), rate, assumed=said)
