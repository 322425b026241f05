"""A shot as a NeXus HDF5 file: built whole in memory, published whole, never changed.

Layout (``@`` = attribute)::

    /entry                NXentry       @default="impact"; title, start_time, entry_identifier, ...
      user                NXuser        the operator
      sample              NXsample      the coupon: name, mass, thickness
      sphere              NXcollection  the sphere: name, radius, mass
      release             NXcollection  height, gravity, speed of a free fall, valve
      environment         NXcollection  temperature and relative humidity, where they are known
      instrument          NXinstrument
        digitizer         NXdetector    data = raw codes, never corrected; identity
        acquisition       NXcollection  all that turns codes into volts and samples into seconds
        load_cell         NXsensor      what was known of the cell
      impact              NXdata        the milliseconds around the impact, in volts
      record              NXdata        the whole record: a link to the raw codes, over time
      process             NXprocess     program and version; NXnotes: circumstances, configuration

``impact`` and ``record/time`` are derived, for viewers: whoever opens the file sees the pulse. The
truth is ``instrument/digitizer/data`` with ``process/circumstances``, from which `read_shot_file`
rebuilds every value of `Recording` and `ShotMetadata`.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict

import h5py
import numpy as np

from analysis.campaign import Environment
from drivers.digitizer import Record
from impactd.storage.clipping import is_clipped
from impactd.storage.drops import Drop
from impactd.storage.errors import CampaignError, CorruptShotError
from impactd.storage.metadata_json import metadata_from_json, metadata_to_json
from impactd.storage.nexus import group, plain, put, refuse_foreign
from impactd.storage.shot_metadata import VOLTAGE, Recording, ShotMetadata
from impactd.storage.shot_views import CHUNK_SAMPLES, DATA_PATH, TIME_PATH, VIEW_LINKS, write_views

_METADATA = "entry/process/circumstances/data"


def recording_of(record: Record) -> Recording:
    """Return a digitizer's record as the archive keeps it, checked for clipping."""
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
    number: int, recording: Recording, metadata: ShotMetadata, drop: Drop | None
) -> bytes:
    """Return the bytes of a whole shot file; ``drop`` is ``None`` for an import."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("earliest", "v110")) as file:
        file.attrs.update(
            NX_class="NXroot", default="entry", creator=metadata.software or "impactd"
        )
        entry = group(file, "entry", "NXentry", default="impact")
        _write_entry(entry, number, metadata)
        _write_people_and_things(entry, metadata)
        _write_release(entry, recording, metadata)
        _write_environment(entry, metadata.environment)
        _write_instrument(entry, recording, metadata)
        write_views(entry, _title(number, metadata), recording)
        _write_process(entry, recording, metadata, drop)
    return buffer.getvalue()


def read_shot_file(content: bytes, path: str) -> tuple[int, Recording, ShotMetadata, Drop | None]:
    """Return what the bytes of a whole shot file hold.

    Raises CorruptShotError if it is no shot file or a checksum inside does not agree.
    """
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            refuse_foreign(
                file,
                len(content),
                soft_links=VIEW_LINKS,
                compressed=("/" + TIME_PATH,),
                chunk_values=CHUNK_SAMPLES,
            )
            samples = plain(file, DATA_PATH)[()]
            facts = json.loads(plain(file, _METADATA)[()])
        return facts["number"], *metadata_from_json(facts, samples, path)
    except (OSError, KeyError, TypeError, ValueError, RecursionError, CampaignError) as error:
        raise CorruptShotError(path, f"it does not read as a shot ({error})") from error


def _write_entry(entry: h5py.Group, number: int, metadata: ShotMetadata) -> None:
    put(entry, "title", _title(number, metadata))
    put(entry, "entry_identifier", str(number))
    put(entry, "start_time", metadata.started_utc)


def _title(number: int, metadata: ShotMetadata) -> str:
    pair = " on ".join(
        part.name for part in (metadata.sphere, metadata.surface) if part is not None
    )
    height = (
        "" if metadata.drop_height_m is None else f" from {metadata.drop_height_m * 1e3:.1f} mm"
    )
    return f"Shot {number}: {pair or metadata.origin or 'unknown pair'}{height}"


def _write_people_and_things(entry: h5py.Group, metadata: ShotMetadata) -> None:
    if metadata.operator:
        put(group(entry, "user", "NXuser"), "name", metadata.operator)
    if metadata.surface is not None:
        sample = group(entry, "sample", "NXsample")
        put(sample, "name", metadata.surface.name)
        put(sample, "description", "coupon taped to the strike cap of the load cell")
        put(sample, "mass", metadata.surface.coupon_mass_kg, "kg")
        put(sample, "thickness", metadata.surface.coupon_thickness_m, "m")
    if metadata.sphere is not None:
        sphere = group(entry, "sphere", "NXcollection")
        put(sphere, "name", metadata.sphere.name)
        put(sphere, "radius", metadata.sphere.radius_m, "m")
        put(sphere, "mass", metadata.sphere.mass_kg, "kg")


def _write_release(entry: h5py.Group, recording: Recording, metadata: ShotMetadata) -> None:
    release = group(entry, "release", "NXcollection")
    put(release, "drop_height", metadata.drop_height_m, "m")
    put(release, "gravity", metadata.gravity_m_per_s2, "m/s^2")
    put(release, "free_fall_speed", metadata.impact_speed_m_per_s, "m/s")
    put(release, "speed_repeatability", metadata.speed_repeatability, "")
    put(release, "valve", metadata.valve_identity)
    put(release, "valve_confirmed", metadata.valve_confirmed)
    put(release, "vacuum", metadata.vacuum_v, "V")
    put(release, "started_host_clock", metadata.started_monotonic_ns, "ns")
    put(release, "valve_host_clock", metadata.valve_monotonic_ns, "ns")
    put(release, "trigger_host_clock", recording.trigger_monotonic_ns, "ns")


def _write_environment(entry: h5py.Group, environment: Environment | None) -> None:
    if environment is None:
        return
    around = group(entry, "environment", "NXcollection")
    for name, unit, known in (
        ("temperature", "degC", environment.temperature_c),
        ("relative_humidity", "", environment.relative_humidity),
    ):
        if known is not None:
            put(around, name, known.value, unit)
            put(around, f"{name}_uncertainty", known.u, unit)


def _write_instrument(entry: h5py.Group, recording: Recording, metadata: ShotMetadata) -> None:
    instrument = group(entry, "instrument", "NXinstrument")
    put(instrument, "name", str(metadata.configuration.get("rig", {}).get("name", "impact rig")))
    digitizer = group(instrument, "digitizer", "NXdetector")
    # Not compressed: gzip would take half of the time between impact and durable file.
    data = digitizer.create_dataset(
        "data",
        data=recording.samples,
        chunks=(min(CHUNK_SAMPLES, recording.samples.size),),
        fletcher32=True,  # a flipped bit is an error, which in a contiguous data set it never is
    )
    is_code = recording.samples.dtype.kind in "iu"
    data.attrs["units"] = "counts" if is_code else recording.unit
    data.attrs["long_name"] = "converter code" if is_code else recording.quantity
    if metadata.digitizer is not None:
        put(digitizer, "local_name", metadata.digitizer.model)
        put(digitizer, "serial_number", metadata.digitizer.serial_number)
        put(digitizer, "description", metadata.digitizer.note)
    settings = group(instrument, "acquisition", "NXcollection")
    put(settings, "formula", "signal = code * signal_per_code + signal_offset")
    put(settings, "signal_per_code", recording.per_code, recording.unit)
    put(settings, "signal_offset", recording.offset, recording.unit)
    put(settings, "calibrated", recording.calibrated)
    put(settings, "clipped", recording.clipped)
    put(settings, "sample_rate", recording.sample_rate_hz, "Hz")
    put(settings, "sample_rate_uncertainty", recording.sample_rate_u_hz, "Hz")
    put(settings, "input_range", recording.range_v, "V")
    put(settings, "trigger_index", recording.trigger_index)
    if metadata.trigger is not None:
        put(settings, "pre_trigger_samples", metadata.trigger.pre_trigger_samples)
        put(settings, "trigger_level", metadata.trigger.level_v, "V")
        put(settings, "trigger_hysteresis", metadata.trigger.hysteresis_v, "V")
    if recording.status_words:
        settings["status_words"] = np.array(recording.status_words, dtype=np.uint32)
    if metadata.digitizer is not None:
        for key, value in asdict(metadata.digitizer).items():
            put(settings, f"digitizer_{key}", value)
    if metadata.sensor is not None:
        cell = group(instrument, "load_cell", "NXsensor")
        put(cell, "name", "piezoelectric load cell")
        put(cell, "attached_to", "strike cap under the coupon")


def _write_process(
    entry: h5py.Group, recording: Recording, metadata: ShotMetadata, drop: Drop | None
) -> None:
    process = group(entry, "process", "NXprocess")
    program, _, version = (metadata.software or "impactd").partition(" ")
    put(process, "program", program)
    put(process, "version", version)
    number = int(entry["entry_identifier"][()])
    for name, description, value in (
        (
            "circumstances",
            "all values of this shot",
            metadata_to_json(number, recording, metadata, drop),
        ),
        ("configuration", "settings of the rig", metadata.configuration),
    ):
        note = group(process, name, "NXnote")
        put(note, "type", "application/json")
        put(note, "description", description)
        note["data"] = json.dumps(value, allow_nan=False)
