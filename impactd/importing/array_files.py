"""npy, npz, MAT and HDF5 files."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
from numpy.typing import NDArray

from impactd.importing.errors import RecordingError
from impactd.importing.named_arrays import recording_of
from impactd.importing.recording import Recording

_RATE_KEYS = (
    "sample_rate",
    "sample_rate_Hz",
    "sampling_rate",
    "sampling_frequency",
    "fs",
    "Fs",
    "rate",
)
_INTERVAL_KEYS = ("dt", "increment", "wf_increment", "sampling_interval")
_UNIT_KEYS = ("unit", "units", "Unit", "Units", "unit_string")
_LISTED = 20
"""Names in a message."""


def read_npy(path: Path) -> Recording:
    """Return a ``.npy`` file: one record, or one row for each hit."""
    try:
        values = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise RecordingError(
            path.name,
            "is no array of plain numbers.",
            "Save it with numpy.save, as numbers and not as Python objects.",
        ) from error
    return recording_of(path.name, {"": np.asarray(values)})


def read_npz(path: Path) -> Recording:
    """Return a ``.npz`` file: arrays by name."""
    try:
        with np.load(path, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise RecordingError(
            path.name,
            "is no archive of arrays of plain numbers.",
            "Save it with numpy.savez, as numbers and not as Python objects.",
        ) from error
    return recording_of(path.name, arrays)


def read_mat(path: Path) -> Recording:
    """Return a MATLAB file of any version; fields of structs have names with dots."""
    if h5py.is_hdf5(path):  # since version 7.3 MATLAB writes HDF5
        return read_hdf5(path, None, transposed=True)
    try:
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # scipy raises what it stumbles on
        raise RecordingError(
            path.name,
            f"is no MATLAB file that can be read ({_first_line(error)}).",
            "Save it again with save('NAME.mat', 'variables', '-v7').",
        ) from error
    arrays: dict[str, NDArray[Any]] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays)
    return recording_of(path.name, arrays)


def _flatten(name: str, value: Any, into: dict[str, NDArray[Any]]) -> None:
    """Add an array, a number, or the fields of a struct."""
    for field in getattr(value, "_fieldnames", None) or ():
        _flatten(f"{name}.{field}", getattr(value, field), into)
    if isinstance(value, np.ndarray | int | float | np.number):
        into[name] = np.asarray(value)


def read_hdf5(path: Path, inside: str | None, *, transposed: bool = False) -> Recording:
    """Return datasets of an HDF5 file, with rate and unit from attributes or datasets beside them.

    ``inside`` is the dataset that is meant; ``None`` means any. ``transposed`` matrices are in the
    order of MATLAB. Raises RecordingError if it is no HDF5 file or the dataset is not in it.
    """
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            names = _datasets(file)
            only = None if inside is None else inside.strip("/")
            if only is not None and only not in names:
                listed = ", ".join(f"/{name}" for name in names[:_LISTED]) or "none"
                raise RecordingError(
                    path.name,
                    f"has no dataset /{only} (there: {listed}).",
                    f"Write {path.name}:/NAME with one of these.",
                )
            beside = "" if only is None else only.rpartition("/")[0]
            for name in names:
                if only is None or name.rpartition("/")[0] == beside:
                    _take(file[name], name, arrays, units, transposed=transposed)
    except OSError as error:
        raise RecordingError(
            path.name, "is no HDF5 file that can be read.", "It may be cut short: copy it again."
        ) from error
    return recording_of(path.name, arrays, units=units, only=only)


def _datasets(file: h5py.File) -> list[str]:
    found: list[str] = []

    def note(name: str, item: object) -> None:
        """Append a dataset of numbers."""
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf" and item.ndim <= 2:
            found.append(name)

    file.visititems(note)
    return found


def _take(
    item: h5py.Dataset,
    name: str,
    arrays: dict[str, NDArray[Any]],
    units: dict[str, str],
    *,
    transposed: bool,
) -> None:
    values = np.asarray(item[()])
    arrays[name] = values.T if transposed else values
    for holder in (item, item.parent):
        for key in _RATE_KEYS + _INTERVAL_KEYS:
            if key in holder.attrs and np.size(holder.attrs[key]) == 1:
                arrays.setdefault(f"{name}.{key}", np.asarray(holder.attrs[key], dtype=np.float64))
    for key in _UNIT_KEYS:
        if key in item.attrs:
            told = item.attrs[key]
            units[name] = told.decode() if isinstance(told, bytes) else str(told)


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
