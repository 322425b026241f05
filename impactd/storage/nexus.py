"""Groups and fields of a NeXus file."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import h5py


def group(parent: h5py.Group, name: str, nx_class: str, **attributes: object) -> h5py.Group:
    """Return a new group of a NeXus class, with its attributes."""
    made = parent.create_group(name)
    made.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        made.attrs[key] = value
    return made


def put(parent: h5py.Group, name: str, value: object, units: str | None = None) -> None:
    """Write a field; an unknown value is left out."""
    if value is None or (isinstance(value, str) and not value):
        return
    field = parent.create_dataset(name, data=value)
    if units is not None:
        field.attrs["units"] = units


def plain(file: h5py.File, path: str) -> h5py.Dataset:
    """Return a dataset that lies inside its file, by a chain of hard links, safe to be read whole.

    The file was checked by `refuse_foreign`. Raises ValueError if something else is there, or
    nothing.
    """
    parts = path.split("/")
    for end in range(1, len(parts) + 1):
        link = file.get("/".join(parts[:end]), getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{path!r} leads out of the file or nowhere")  # noqa: TRY004 - of the file
    data = file[path]
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{path!r} is no dataset")  # noqa: TRY004 - of the file
    return data


def refuse_foreign(
    file: h5py.File,
    content_bytes: int,
    *,
    soft_links: Mapping[str, str],
    compressed: Collection[str],
    chunk_values: int,
) -> None:
    """Refuse a file with anything in it that this program does not write; read none of its data.

    HDF5 can make a dataset out of other files (external storage, external links, virtual datasets)
    and a huge one out of few bytes (compression, chunks that were never written).

    Parameters
    ----------
    content_bytes : int
        Size of the whole file. [B]
    soft_links : mapping of str to str
        The soft links that may be there, and where each must lead.
    compressed : collection of str
        The datasets that may be compressed. Each may hold a value for every byte of the file.

    Raises
    ------
    ValueError
        At the first thing that is foreign.
    """
    waiting: list[tuple[str, h5py.Group]] = [("", file["/"])]
    seen = {h5py.h5o.get_info(file.id).addr}
    while waiting:
        parent, members = waiting.pop()
        for name in members:
            path = f"{parent}/{name}"
            link = members.get(name, getlink=True)
            if isinstance(link, h5py.SoftLink) and soft_links.get(path) == link.path:
                continue
            if not isinstance(link, h5py.HardLink):
                raise ValueError(f"{path!r} is a link to {_target(link)!r}")  # noqa: TRY004 - of the file
            found = members[name]
            address = h5py.h5o.get_info(found.id).addr
            if address in seen:
                raise ValueError(f"{path!r} is a second name of something else")
            seen.add(address)
            if isinstance(found, h5py.Group):
                waiting.append((path, found))
            elif isinstance(found, h5py.Dataset):
                _refuse_foreign_data(found, path, content_bytes, compressed, chunk_values)
            else:
                raise ValueError(f"{path!r} is neither group nor dataset")  # noqa: TRY004 - of the file


def _target(link: object) -> str:
    return f"{getattr(link, 'filename', '')}:{getattr(link, 'path', '')}".lstrip(":")


def _refuse_foreign_data(
    data: h5py.Dataset,
    path: str,
    content_bytes: int,
    compressed: Collection[str],
    chunk_values: int,
) -> None:
    # First of all: even the shape of a virtual dataset may be looked up in another file.
    if data.is_virtual or data.external:
        raise ValueError(f"{path!r} takes its data from other files")
    filters = data.id.get_create_plist()
    used = {filters.get_filter(position)[0] for position in range(filters.get_nfilters())}
    if data.chunks is not None and math.prod(data.chunks) > chunk_values:
        raise ValueError(f"{path!r} has chunks of {data.chunks} values")
    if path in compressed:
        # What comes out of compression has no bound of its own.
        if used - _COMPRESSION or data.size > content_bytes:
            raise ValueError(f"{path!r} claims {data.shape} values in filters {sorted(used)}")
        return
    if used - {h5py.h5z.FILTER_FLETCHER32}:
        raise ValueError(f"{path!r} is compressed or filtered ({sorted(used)})")
    claimed_bytes = data.size * data.dtype.itemsize
    if claimed_bytes > content_bytes or claimed_bytes > data.id.get_storage_size():
        raise ValueError(f"{path!r} claims {data.shape} values in {content_bytes} bytes")


_COMPRESSION = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}
