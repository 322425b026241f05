"""What viewers show of a shot file: the impact in volts, and the whole record."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import lru_cache

import h5py
import numpy as np
from numpy.typing import NDArray

from impactd.storage.nexus import group, put
from impactd.storage.shot_metadata import Recording

DATA_PATH = "entry/instrument/digitizer/data"
TIME_PATH = "entry/record/time"
VIEW_LINKS = {"/entry/record/data": "/" + DATA_PATH}
"""The one soft link of a shot file: the whole record is drawn from the raw samples."""
CHUNK_SAMPLES = 65536
VIEW_BEFORE_S = 0.5e-3
VIEW_AFTER_S = 2e-3


def write_views(entry: h5py.Group, title: str, recording: Recording) -> None:
    """Write ``impact`` and ``record``, each of which plots by itself, beside the samples."""
    rate_hz, trigger = recording.sample_rate_hz, recording.trigger_index
    first = max(0, trigger - round(VIEW_BEFORE_S * rate_hz))
    view = replace(
        recording, samples=recording.samples[first : trigger + round(VIEW_AFTER_S * rate_hz)]
    )
    impact = group(entry, "impact", "NXdata", signal="signal", axes=["time"])
    put(impact, "title", f"{title}, impact")
    impact["signal"] = view.signal
    impact["signal"].attrs.update(units=recording.unit, long_name=f"signal ({recording.unit})")
    impact["time"] = _times(view.samples.size, rate_hz, trigger - first)
    impact["time"].attrs.update(units="s", long_name="time after the trigger (s)")

    record = group(entry, "record", "NXdata", signal="data", axes=["time"])
    put(record, "title", f"{title}, whole record")
    for path, target in VIEW_LINKS.items():
        entry[path] = h5py.SoftLink(target)
    time = _create_times(record, recording.samples.size)
    for offset, packed in _packed_times(recording.samples.size, rate_hz, trigger):
        time.id.write_direct_chunk(offset, packed)
    time.attrs.update(units="s", long_name="time after the trigger (s)")


def _times(samples: int, sample_rate_hz: float, trigger_index: int) -> NDArray[np.float64]:
    return (np.arange(samples) - trigger_index) / sample_rate_hz


def _create_times(parent: h5py.Group, samples: int) -> h5py.Dataset:
    return parent.create_dataset(
        "time",
        shape=(samples,),
        dtype=np.float64,
        chunks=(min(CHUNK_SAMPLES, samples),),
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
        times = _create_times(file, samples)
        times[:] = _times(samples, sample_rate_hz, trigger_index)
        file.flush()
        offsets = [
            times.id.get_chunk_info(i).chunk_offset for i in range(times.id.get_num_chunks())
        ]
        return tuple((offset, times.id.read_direct_chunk(offset)[1]) for offset in offsets)
