"""Groups and fields of a NeXus file."""

from __future__ import annotations

import h5py


def group(parent: h5py.Group, name: str, nx_class: str, **attributes: object) -> h5py.Group:
    """Return a new group of a NeXus class, with its attributes."""
    made = parent.create_group(name)
    made.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        made.attrs[key] = value
    return made


def put(parent: h5py.Group, name: str, value: object, units: str | None = None) -> None:
    """Write a field; what is unknown is left out rather than invented."""
    if value is None or (isinstance(value, str) and not value):
        return
    field = parent.create_dataset(name, data=value)
    if units is not None:
        field.attrs["units"] = units


def plain(file: h5py.File, path: str, content_bytes: int) -> h5py.Dataset:
    """Return a dataset that lies inside its file and is as large as it looks.

    HDF5 can make a dataset out of other files (external storage, external links, virtual datasets)
    and a huge one out of few bytes (compression, chunks that were never written). Our own files
    use none of that, so a file that does is none of ours, and nothing of it is read.

    Parameters
    ----------
    file : h5py.File
        Open for reading.
    path : str
        Of the dataset.
    content_bytes : int
        Size of the whole file. [B]

    Returns
    -------
    h5py.Dataset
        Safe to be read whole.

    Raises
    ------
    ValueError
        If it is none of ours.
    KeyError
        If there is none.
    """
    parts = path.split("/")
    for end in range(1, len(parts) + 1):
        link = file.get("/".join(parts[:end]), getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{path!r} leads out of the file or nowhere")  # noqa: TRY004 - of the file
    data = file[path]
    if not isinstance(data, h5py.Dataset) or data.external or data.is_virtual:
        raise ValueError(f"{path!r} takes its data from other files")
    if data.compression is not None or data.size * data.dtype.itemsize > content_bytes:
        raise ValueError(f"{path!r} claims {data.shape} values in {content_bytes} bytes")
    return data
