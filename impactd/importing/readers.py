"""The choice of a reader for a file: by its ending, and for a text by its content."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from impactd.importing.array_files import read_hdf5, read_mat, read_npy, read_npz
from impactd.importing.errors import RecordingError
from impactd.importing.instrument_files import read_lvm, read_tdms, read_uff, read_wav
from impactd.importing.recording import Recording
from impactd.storage.recording_files import HDF5_ENDINGS

_READERS: dict[str, Callable[[Path], Recording]] = {
    ".npy": read_npy,
    ".npz": read_npz,
    ".mat": read_mat,
    ".wav": read_wav,
    ".wave": read_wav,
    ".uff": read_uff,
    ".unv": read_uff,
    ".tdms": read_tdms,
    ".lvm": read_lvm,
}


def split_inside(name: str) -> tuple[Path, str | None]:
    """Return the file, and the path inside it that ``FILE.h5:/path`` names."""
    found = re.match(r"^(.*\.(?:h5|hdf5|hdf|nxs|mat)):(.+)$", name, re.IGNORECASE)
    return (Path(found[1]), found[2]) if found else (Path(name), None)


def read_recording(name: str) -> Recording:
    """Return a file of any kind that is known; an unknown ending is tried as text.

    ``:/path`` behind the name is a dataset of an HDF5 file. Raises RecordingError if the file is
    not there, or cannot be read.
    """
    path, inside = split_inside(name)
    if path.is_dir():
        raise RecordingError(
            str(path), "is a folder.", f"Name the files in it: impactd new {path}/*.csv"
        )
    if not path.is_file():
        raise RecordingError(str(path), "does not exist.")
    ending = path.suffix.lower()
    if inside is not None or ending in HDF5_ENDINGS:
        return read_hdf5(path, inside)
    return _READERS.get(ending, read_lvm)(path)
