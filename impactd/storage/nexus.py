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
