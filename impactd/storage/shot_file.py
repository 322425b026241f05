"""A shot as a NeXus HDF5 file: built whole in memory, published whole, never changed.

Layout (``@`` = attribute)::

    /entry                NXentry       @default="impact"; title, start_time, entry_identifier, ...
      user                NXuser        the operator
      sample              NXsample      the coupon: name, mass, thickness
      sphere              NXcollection  the sphere: name, radius, mass
      release             NXcollection  height, gravity, speed of a free fall, valve
      instrument          NXinstrument
        digitizer         NXdetector    data = raw codes, never corrected; identity
        acquisition       NXcollection  all that turns codes into volts and samples into seconds
        load_cell         NXsensor      what was known of the cell
      impact              NXdata        the milliseconds around the impact, in volts
      record              NXdata        the whole record: a link to the raw codes, over time
      process             NXprocess     program and version; NXnotes: circumstances, configuration

``impact`` and ``record/time`` are derived, for viewers: whoever opens the file sees the pulse. The
truth is ``instrument/digitizer/data`` with ``process/circumstances``, from which `read_shot_file`
rebuilds every value of `Recording` and `ShotAbout`.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import Record
from impactd.storage.circumstances import circumstances, decoded
from impactd.storage.clipping import is_clipped
from impactd.storage.drops import Drop
from impactd.storage.errors import CampaignError, CorruptShotError
from impactd.storage.shot_about import VOLTAGE, Recording, ShotAbout

CHUNK_SAMPLES = 65536
VIEW_BEFORE_S = 0.5e-3
VIEW_AFTER_S = 2e-3
_DATA = "entry/instrument/digitizer/data"
_CIRCUMSTANCES = "entry/process/circumstances/data"


def recording_of(record: Record) -> Recording:
    """Return a digitizer's record as the archive keeps it, looked at for clipping."""
    codes = np.ascontiguousarray(record.codes, dtype=np.int16)
    return Recording(
        samples=codes,
        per_code=record.volts_per_code,
        offset=record.offset_v,
        quantity=VOLTAGE,
        sample_rate_hz=record.sample_rate_hz,
        sample_rate_u_hz=record.sample_rate_u_hz,
        trigger_index=record.trigger_index,
        range_v=record.range_v,
        calibrated=record.calibrated,
        clipped=is_clipped(codes, quantum=1.0),
        first_sample_index=record.first_sample_index,
        samples_streamed=record.samples_streamed,
        trigger_monotonic_ns=record.trigger_monotonic_ns,
        status_words=record.status_words,
    )


def build_shot_file(
    number: int, recording: Recording, about: ShotAbout, drop: Drop | None
) -> bytes:
    """Return the bytes of a shot file.

    Parameters
    ----------
    number : int
        The shot.
    recording : Recording
        The record.
    about : ShotAbout
        The circumstances.
    drop : Drop or None
        The drop it belongs to, ``None`` for an import.

    Returns
    -------
    bytes
        A whole HDF5 file.
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("earliest", "v110")) as file:
        file.attrs.update(NX_class="NXroot", default="entry", creator=about.software or "impactd")
        entry = _group(file, "entry", "NXentry", default="impact")
        _write_entry(entry, number, about)
        _write_people_and_things(entry, about)
        _write_release(entry, recording, about)
        _write_instrument(entry, recording, about)
        _write_views(entry, _title(number, about), recording)
        _write_process(entry, recording, about, drop)
    return buffer.getvalue()


def read_shot_file(content: bytes, path: str) -> tuple[int, Recording, ShotAbout, Drop | None]:
    """Return what a shot file holds.

    Parameters
    ----------
    content : bytes
        The whole file, as `build_shot_file` made it.
    path : str
        Named in messages.

    Returns
    -------
    tuple of int, Recording, ShotAbout and (Drop or None)
        Number, record, circumstances and drop.

    Raises
    ------
    CorruptShotError
        If it is no shot file or a checksum inside does not agree.
    """
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            samples = file[_DATA][()]
            facts = json.loads(file[_CIRCUMSTANCES][()])
        return facts["number"], *decoded(facts, samples, path)
    except (OSError, KeyError, TypeError, ValueError, CampaignError) as error:
        raise CorruptShotError(path, f"it does not read as a shot ({error})") from error


def _group(parent: h5py.Group, name: str, nx_class: str, **attributes: object) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        group.attrs[key] = value
    return group


def _put(group: h5py.Group, name: str, value: object, units: str | None = None) -> None:
    """Write a field; what is unknown is left out rather than invented."""
    if value is None or value == "":
        return
    group[name] = value
    if units is not None:
        group[name].attrs["units"] = units


def _write_entry(entry: h5py.Group, number: int, about: ShotAbout) -> None:
    _put(entry, "title", _title(number, about))
    _put(entry, "entry_identifier", str(number))
    _put(entry, "start_time", about.started_utc)


def _title(number: int, about: ShotAbout) -> str:
    pair = " on ".join(part.name for part in (about.sphere, about.surface) if part is not None)
    height = "" if about.drop_height_m is None else f" from {about.drop_height_m * 1e3:.1f} mm"
    return f"Shot {number}: {pair or about.origin or 'unknown pair'}{height}"


def _write_people_and_things(entry: h5py.Group, about: ShotAbout) -> None:
    if about.operator:
        _put(_group(entry, "user", "NXuser"), "name", about.operator)
    if about.surface is not None:
        sample = _group(entry, "sample", "NXsample")
        _put(sample, "name", about.surface.name)
        _put(sample, "description", "coupon taped to the strike cap of the load cell")
        _put(sample, "mass", about.surface.coupon_mass_kg, "kg")
        _put(sample, "thickness", about.surface.coupon_thickness_m, "m")
    if about.sphere is not None:
        sphere = _group(entry, "sphere", "NXcollection")
        _put(sphere, "name", about.sphere.name)
        _put(sphere, "radius", about.sphere.radius_m, "m")
        _put(sphere, "mass", about.sphere.mass_kg, "kg")


def _write_release(entry: h5py.Group, recording: Recording, about: ShotAbout) -> None:
    release = _group(entry, "release", "NXcollection")
    _put(release, "drop_height", about.drop_height_m, "m")
    _put(release, "gravity", about.gravity_m_per_s2, "m/s^2")
    _put(release, "free_fall_speed", about.impact_speed_m_per_s, "m/s")
    _put(release, "speed_repeatability", about.speed_repeatability, "")
    _put(release, "valve", about.valve_identity)
    _put(release, "valve_confirmed", about.valve_confirmed)
    _put(release, "vacuum", about.vacuum_v, "V")
    _put(release, "started_host_clock", about.started_monotonic_ns, "ns")
    _put(release, "valve_host_clock", about.valve_monotonic_ns, "ns")
    _put(release, "trigger_host_clock", recording.trigger_monotonic_ns, "ns")


def _write_instrument(entry: h5py.Group, recording: Recording, about: ShotAbout) -> None:
    instrument = _group(entry, "instrument", "NXinstrument")
    _put(instrument, "name", str(about.configuration.get("rig", {}).get("name", "impact rig")))
    digitizer = _group(instrument, "digitizer", "NXdetector")
    data = _create_packed(digitizer, "data", recording.samples.shape, recording.samples.dtype)
    data[:] = recording.samples
    is_code = recording.samples.dtype.kind in "iu"
    data.attrs["units"] = "counts" if is_code else recording.unit
    data.attrs["long_name"] = "converter code" if is_code else recording.quantity
    if about.digitizer is not None:
        _put(digitizer, "local_name", about.digitizer.model)
        _put(digitizer, "serial_number", about.digitizer.serial_number)
        _put(digitizer, "description", about.digitizer.note)
    settings = _group(instrument, "acquisition", "NXcollection")
    _put(settings, "formula", "signal = code * signal_per_code + signal_offset")
    _put(settings, "signal_per_code", recording.per_code, recording.unit)
    _put(settings, "signal_offset", recording.offset, recording.unit)
    _put(settings, "calibrated", recording.calibrated)
    _put(settings, "clipped", recording.clipped)
    _put(settings, "sample_rate", recording.sample_rate_hz, "Hz")
    _put(settings, "sample_rate_uncertainty", recording.sample_rate_u_hz, "Hz")
    _put(settings, "input_range", recording.range_v, "V")
    _put(settings, "trigger_index", recording.trigger_index)
    if about.trigger is not None:
        _put(settings, "pre_trigger_samples", about.trigger.pre_trigger_samples)
        _put(settings, "trigger_level", about.trigger.level_v, "V")
        _put(settings, "trigger_hysteresis", about.trigger.hysteresis_v, "V")
    if recording.status_words:
        settings["status_words"] = np.array(recording.status_words, dtype=np.uint32)
    if about.digitizer is not None:
        for key, value in asdict(about.digitizer).items():
            _put(settings, f"digitizer_{key}", value)
    if about.sensor is not None:
        cell = _group(instrument, "load_cell", "NXsensor")
        _put(cell, "name", "piezoelectric load cell")
        _put(cell, "attached_to", "strike cap under the coupon")


def _write_views(entry: h5py.Group, title: str, recording: Recording) -> None:
    rate_hz, trigger = recording.sample_rate_hz, recording.trigger_index
    first = max(0, trigger - round(VIEW_BEFORE_S * rate_hz))
    view = replace(
        recording, samples=recording.samples[first : trigger + round(VIEW_AFTER_S * rate_hz)]
    )
    impact = _group(entry, "impact", "NXdata", signal="signal", axes=["time"])
    _put(impact, "title", f"{title}, impact")
    impact["signal"] = view.signal
    impact["signal"].attrs.update(units=recording.unit, long_name=f"signal ({recording.unit})")
    impact["time"] = _times(view.samples.size, rate_hz, trigger - first)
    impact["time"].attrs.update(units="s", long_name="time after the trigger (s)")

    record = _group(entry, "record", "NXdata", signal="data", axes=["time"])
    _put(record, "title", f"{title}, whole record")
    record["data"] = h5py.SoftLink("/" + _DATA)
    clock = (recording.samples.size, rate_hz, trigger)
    _create_packed(record, "time", (clock[0],), np.dtype(np.float64))
    for offset, packed in _packed_times(*clock):
        record["time"].id.write_direct_chunk(offset, packed)
    record["time"].attrs.update(units="s", long_name="time after the trigger (s)")


def _times(samples: int, sample_rate_hz: float, trigger_index: int) -> NDArray[np.float64]:
    return (np.arange(samples) - trigger_index) / sample_rate_hz


def _create_packed(
    group: h5py.Group, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]
) -> h5py.Dataset:
    # fletcher32 catches a flipped bit inside the data, which a contiguous data set never would.
    return group.create_dataset(
        name,
        shape=shape,
        dtype=dtype,
        chunks=(min(CHUNK_SAMPLES, shape[0]),),
        shuffle=True,
        fletcher32=True,
        compression="gzip",
        compression_opts=1,
    )


@lru_cache(maxsize=4)
def _packed_times(
    samples: int, sample_rate_hz: float, trigger_index: int
) -> tuple[tuple[tuple[int, ...], bytes], ...]:
    """Return the compressed chunks of a time axis.

    All shots of a rig share one time axis, and packing it takes longer than all the rest of a file.
    """
    with h5py.File(io.BytesIO(), "w") as file:
        times = _create_packed(file, "time", (samples,), np.dtype(np.float64))
        times[:] = _times(samples, sample_rate_hz, trigger_index)
        file.flush()
        offsets = [
            times.id.get_chunk_info(i).chunk_offset for i in range(times.id.get_num_chunks())
        ]
        return tuple((offset, times.id.read_direct_chunk(offset)[1]) for offset in offsets)


def _write_process(
    entry: h5py.Group, recording: Recording, about: ShotAbout, drop: Drop | None
) -> None:
    process = _group(entry, "process", "NXprocess")
    program, _, version = (about.software or "impactd").partition(" ")
    _put(process, "program", program)
    _put(process, "version", version)
    number = int(entry["entry_identifier"][()])
    for name, description, value in (
        ("circumstances", "all values of this shot", circumstances(number, recording, about, drop)),
        ("configuration", "settings of the rig", about.configuration),
    ):
        note = _group(process, name, "NXnote")
        _put(note, "type", "application/json")
        _put(note, "description", description)
        note["data"] = json.dumps(value, allow_nan=False)
