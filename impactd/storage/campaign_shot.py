"""One shot of a campaign folder: every field validated, codes kept as they are.

``volts_per_code`` is the step of the converter in the unit of the shot's ``quantity``. Integer
samples need it; beside float samples, which are in their unit already, it only states the step.
``sample_rate_u_Hz``, ``samples`` and ``volts_offset`` are this program's additions to the format.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Campaign, Shot, Uncertainty
from impactd.storage import ranges
from impactd.storage.clipping import is_clipped
from impactd.storage.json_fields import Fields
from impactd.storage.materials_json import (
    ENVIRONMENT_KEYS,
    environment_from_json,
    environment_to_json,
    measured_to_json,
    quantity_to_json,
)
from impactd.storage.ranges import Range
from impactd.storage.sample_file import SampleFileError, read_samples
from impactd.storage.shot_metadata import QUANTITIES, VOLTAGE, Recording

MIN_SAMPLES = 32
RATE_TOLERANCE = 0.01
SHOT_KEYS = (
    "file",
    "name",
    "sample_rate_Hz",
    "sample_rate_u_Hz",
    "samples",
    "volts_per_code",
    "volts_offset",
    "trigger_index",
    "quantity",
    "sphere",
    "surface",
    "drop_height_m",
    "restitution",
    "environment",
)


@dataclass(frozen=True)
class CampaignShot:
    """One shot of a folder, with its samples as they stand in the file."""

    shot: Shot
    """As the analysis sees it."""
    recording: Recording
    """As the archive keeps it."""
    file: str
    """The name of its file; the shot's own name may be another."""


def read_campaign_shot(fields: Fields, header: Campaign, folder: Path) -> CampaignShot:
    """Return one shot of a folder.

    ``fields`` is its object in ``shots``; ``header`` has the materials it may name. Raises
    CampaignError at the first field that cannot be used.
    """
    name = fields.text("file")
    if name is None:
        fields.refuse("file", "is missing.")
    quantity = fields.text("quantity") or VOLTAGE
    if quantity not in QUANTITIES:
        fields.refuse("quantity", f"is {quantity!r}; it must be one of {', '.join(QUANTITIES)}.")
    try:
        samples, file_rate_hz = read_samples(folder, name, quantity)
    except SampleFileError as error:
        fields.refuse("file", f"{name!r} {error}")
    rate_hz, u_rate = _rate(fields, file_rate_hz)
    per_code, u_per_code = fields.measured("volts_per_code", ranges.PER_CODE)
    height_m, u_height = fields.measured("drop_height_m", ranges.DROP_HEIGHT_M)
    offset = fields.number("volts_offset", ranges.SIGNAL) or 0.0
    is_code = samples.dtype.kind in "iu"
    if is_code and per_code is None:
        fields.refuse("volts_per_code", f"is missing, and {name!r} holds integer codes.")
    _refuse_unusable(fields, samples, name)
    trigger = fields.whole("trigger_index")
    if trigger is None:
        fields.refuse("trigger_index", "is missing.")
    if trigger >= samples.size:
        fields.refuse("trigger_index", f"is {trigger}; {name!r} has {samples.size} samples only.")
    recording = Recording(
        samples=samples,
        per_code=per_code if is_code and per_code is not None else 1.0,
        offset=offset if is_code else 0.0,
        quantity=quantity,
        sample_rate_hz=rate_hz,
        sample_rate_u_hz=0.0 if u_rate is None else u_rate.u,
        trigger_index=trigger,
        clipped=is_clipped(samples, quantum=None if is_code else per_code),
    )
    _refuse_extreme(fields, recording, name)
    shot = Shot(
        name=fields.text("name") or name,
        signal=recording.signal,
        sample_rate_hz=rate_hz,
        trigger_index=trigger,
        quantity=quantity,
        sphere=_member(fields, "sphere", header.spheres),
        surface=_member(fields, "surface", header.surfaces),
        drop_height_m=height_m,
        restitution=fields.quantity("restitution", ranges.RESTITUTION),
        quantum=per_code,
        clipped=recording.clipped,
        code_zero=recording.offset,
        u_drop_height_m=u_height,
        u_sample_rate_hz=u_rate,
        u_gain_relative=u_per_code.u / per_code if per_code and u_per_code else 0.0,
        environment=environment_from_json(fields.child("environment", known=ENVIRONMENT_KEYS)),
        path=fields.path,
    )
    return CampaignShot(shot, recording, name)


def _rate(fields: Fields, file_rate_hz: float | None) -> tuple[float, Uncertainty | None]:
    rate_hz, known = fields.measured("sample_rate_Hz", ranges.SAMPLE_RATE_HZ)
    if rate_hz is None:
        rate_hz = file_rate_hz
    if rate_hz is None:
        fields.refuse("sample_rate_Hz", "is missing.")
    if not ranges.SAMPLE_RATE_HZ.low <= rate_hz <= ranges.SAMPLE_RATE_HZ.high:
        said = f"the file's time column says {rate_hz:g} Hz"
        fields.refuse("sample_rate_Hz", f"{said}; it must be {ranges.SAMPLE_RATE_HZ}.")
    if file_rate_hz is not None and not math.isclose(rate_hz, file_rate_hz, rel_tol=RATE_TOLERANCE):
        fields.refuse(
            "sample_rate_Hz", f"is {rate_hz:g} Hz; the file's time column says {file_rate_hz:g} Hz."
        )
    if known is None:
        u = fields.number("sample_rate_u_Hz", Range(0.0, rate_hz, "Hz")) or 0.0
        fields.refuse_unnoticeable("sample_rate_u_Hz", u, beside=rate_hz, unit="Hz")
        known = Uncertainty(u) if u else None
    return rate_hz, known


def _refuse_unusable(fields: Fields, samples: NDArray[Any], name: str) -> None:
    expected = fields.whole("samples")
    if expected is not None and expected != samples.size:
        fields.refuse("samples", f"is {expected}; {name!r} has {samples.size}.")
    if samples.size < MIN_SAMPLES:
        fields.refuse("file", f"{name!r} has {samples.size} samples; {MIN_SAMPLES} are needed.")
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        fields.refuse("file", f"{name!r} holds NaN or infinity, first at sample {bad[0]}.")
    if samples.min() == samples.max():
        fields.refuse("file", f"{name!r} is flat: every sample is {samples[0]}.")


def _refuse_extreme(fields: Fields, recording: Recording, name: str) -> None:
    low, high = sorted(
        float(extreme) * recording.per_code + recording.offset
        for extreme in (recording.samples.min(), recording.samples.max())
    )
    if low < ranges.SIGNAL.low or high > ranges.SIGNAL.high:
        limits = f"each must be {ranges.SIGNAL} ({recording.unit})"
        fields.refuse("file", f"{name!r} holds {low:g} to {high:g} {recording.unit}; {limits}.")
    if high - low < ranges.PER_CODE.low:
        spread = f"{high - low:g} {recording.unit}"
        fields.refuse("file", f"{name!r} is flat: its samples spread over {spread}.")


def _member(fields: Fields, key: str, known: dict[str, Any]) -> str | None:
    name = fields.text(key)
    if name is not None and name not in known:
        listed = ", ".join(sorted(known)) or "none"
        fields.refuse(key, f"{name!r} is not described under {key}s (there: {listed}).")
    return name


def shot_to_json(shot: Shot, name: str, recording: Recording | None) -> dict[str, Any]:
    """Return the object of a shot whose samples are in the file ``name``; unknown keys left out."""
    is_code = recording is not None and recording.samples.dtype.kind in "iu"
    per_code = recording.per_code if recording and is_code else shot.quantum
    gain = (
        Uncertainty(shot.u_gain_relative * per_code) if per_code and shot.u_gain_relative else None
    )
    found = {
        "file": name,
        "name": shot.name,
        "sample_rate_Hz": shot.sample_rate_hz,
        "sample_rate_u_Hz": None if shot.u_sample_rate_hz is None else shot.u_sample_rate_hz.u,
        "samples": shot.signal.size,
        "volts_per_code": measured_to_json(per_code, gain),
        "volts_offset": recording.offset if recording and is_code else None,
        "trigger_index": shot.trigger_index,
        "quantity": shot.quantity,
        "sphere": shot.sphere,
        "surface": shot.surface,
        "drop_height_m": measured_to_json(shot.drop_height_m, shot.u_drop_height_m),
        "restitution": quantity_to_json(shot.restitution),
        "environment": environment_to_json(shot.environment),
    }
    return {key: value for key, value in found.items() if value is not None}
