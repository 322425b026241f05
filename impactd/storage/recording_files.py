"""Recordings are told from campaigns by the names of their files."""

from __future__ import annotations

from pathlib import Path

RECORDINGS_NAME = "recordings"
"""Folder of the archive for what somebody uploaded; see `impactd.jobs.recordings`."""
HDF5_ENDINGS = (".h5", ".hdf5", ".hdf", ".nxs")
RECORDING_ENDINGS = (
    ".csv",
    ".txt",
    ".tsv",
    ".dat",
    ".asc",
    ".npy",
    ".npz",
    ".mat",
    ".wav",
    ".uff",
    ".unv",
    ".tdms",
    ".lvm",
    *HDF5_ENDINGS,
)
"""Endings of files that ``impactd new`` reads."""


def find_recordings(folder: Path) -> list[Path]:
    """Return the files of a folder that are recordings by their ending, sorted."""
    return sorted(one for one in folder.iterdir() if one.suffix.lower() in RECORDING_ENDINGS)
