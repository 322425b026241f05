"""The samples of one shot of a campaign folder: ``.npy`` (one-dimensional) or ``.csv``."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import numpy as np
from numpy.typing import NDArray

from impactd.storage.even_times import UnevenTimesError, find_rate
from impactd.storage.publish import publish
from impactd.storage.regular_file import open_regular_file

MAX_SAMPLES = 100_000_000
"""Longest record that is read: 100 s at 1 MS/s."""
_NPY_HEADER_BYTES = 64 * 1024
"""numpy writes 128 bytes for one dimension; a header of version 2.0 may claim 4 GB. [B]"""
_NPY_LIMIT_BYTES = _NPY_HEADER_BYTES + 8 * MAX_SAMPLES
_LINE_LIMIT = 200
"""Two numbers of 25 digits with blanks; a line without end would be read into memory whole."""
_CSV_LIMIT_BYTES = 64 * MAX_SAMPLES
"""Two numbers of 25 digits, comma and line end, and some blanks. [B]"""
_TIME_LIMIT_S = 1e10
"""Seconds since 1970 are 2e9; differences of larger times overflow or lose the samples. [s]"""
_COLUMNS = {
    "voltage": ("volts",),
    "force_N": ("force_N", "newtons", "volts"),
    "acceleration_m_per_s2": ("acceleration_m_per_s2", "volts"),
}
"""Headers of the second column; ``volts`` was once the only one, whatever the quantity."""


class SampleFileError(Exception):
    """A sample file cannot be used; the message continues a sentence that names the file."""


def read_samples(folder: Path, name: str, quantity: str) -> tuple[NDArray[Any], float | None]:
    """Return the samples of a file inside a campaign folder, and the rate of a csv's time column.

    Parameters
    ----------
    folder : Path
        The campaign's folder; nothing outside it is ever opened.
    quantity : str
        What the samples are of; a csv header must agree.

    Returns
    -------
    samples : ndarray, shape (n,)
        In the file's own type (integers or floats), native byte order.
    sample_rate_hz : float or None
        ``None`` without such a column. [Hz]

    Raises
    ------
    SampleFileError
        If the file is missing, lies outside the folder or does not hold such samples.
    """
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise SampleFileError("lies outside the campaign's folder.")
    if path.suffix not in _LIMITS_BYTES:
        raise SampleFileError("is neither .npy nor .csv.")
    try:
        with open_regular_file(path, _LIMITS_BYTES[path.suffix]) as file:
            return (_read_npy(file), None) if path.suffix == ".npy" else _read_csv(file, quantity)
    except FileNotFoundError as error:
        raise SampleFileError("does not exist.") from error
    except UnicodeDecodeError as error:
        raise SampleFileError("is not UTF-8 text.") from error
    except OSError as error:
        raise SampleFileError(f"cannot be read: it {error.strerror}.") from error
    except MemoryError as error:
        raise SampleFileError("is larger than the free memory.") from error


_LIMITS_BYTES = {".npy": _NPY_LIMIT_BYTES, ".csv": _CSV_LIMIT_BYTES}


def _read_npy(file: BinaryIO) -> NDArray[Any]:
    shape, dtype, start = _npy_header(file.read(_NPY_HEADER_BYTES))
    if len(shape) != 1:
        raise SampleFileError(f"has shape {shape}; it must be one-dimensional.")
    if dtype.kind not in "iuf" or dtype.itemsize > 8:
        kinds = "integers or floats of at most 64 bits"
        raise SampleFileError(f"holds {dtype}; it must hold {kinds}.")
    there = (os.fstat(file.fileno()).st_size - start) // dtype.itemsize
    if not 0 <= shape[0] <= min(there, MAX_SAMPLES):
        most = f"it has bytes for {there}, and at most {MAX_SAMPLES} are read"
        raise SampleFileError(f"claims {shape[0]} samples; {most}.")
    file.seek(start)
    samples = np.frombuffer(file.read(shape[0] * dtype.itemsize), dtype)
    return samples.astype(dtype.newbyteorder("="))


_NPY_VERSIONS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def _npy_header(head: bytes) -> tuple[tuple[int, ...], np.dtype[Any], int]:
    """Return shape, type and where the numbers begin."""
    buffer = io.BytesIO(head)
    try:
        version = np.lib.format.read_magic(buffer)
        read = _NPY_VERSIONS.get(version)
        if read is None:
            raise SampleFileError(f"is of version {version} of the .npy format; 1 and 2 are read.")
        shape, _, dtype = read(buffer)
    except (ValueError, EOFError, SyntaxError, RecursionError) as error:
        raise SampleFileError(f"is no .npy file of numbers ({_first_line(error)}).") from error
    return shape, dtype, buffer.tell()


def _read_csv(file: BinaryIO, quantity: str) -> tuple[NDArray[np.float64], float]:
    with io.TextIOWrapper(file, encoding="utf-8-sig") as text:
        lines = _lines(text)
        header = next(lines, "")
        names = [name.strip() for name in header.split(",")]
        wanted = _COLUMNS[quantity]
        if len(names) != 2 or names[0] != "time_s" or names[1] not in wanted:
            expected = " or ".join(f"'time_s,{name}'" for name in wanted)
            raise SampleFileError(f"has the header {header.strip()[:60]!r}; it must be {expected}.")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # an empty table is refused below, in our words
                table = np.loadtxt(lines, delimiter=",", ndmin=2)
        except UnicodeDecodeError:
            raise
        except ValueError as error:
            raise SampleFileError(f"is no table of numbers ({_first_line(error)}).") from error
    if table.shape[0] < 2 or table.shape[1] != 2:
        raise SampleFileError(f"holds a table of shape {table.shape}; two columns are needed.")
    return np.ascontiguousarray(table[:, 1]), _rate_hz(table[:, 0])


def _lines(text: TextIO) -> Iterator[str]:
    """Yield the lines of a table; a line or a table that is too long is refused."""
    for _ in range(MAX_SAMPLES + 1):  # the header is one of them
        line = text.readline(_LINE_LIMIT)
        if not line:
            return
        if len(line) == _LINE_LIMIT:
            raise SampleFileError(f"has a line of {_LINE_LIMIT} characters or more: no table.")
        yield line
    if text.readline(1):
        raise SampleFileError(f"has more than {MAX_SAMPLES} lines, the most that are read.")


def _rate_hz(times_s: NDArray[np.float64]) -> float:
    """Return the rate of times that rise evenly. [Hz]"""
    if not np.all(np.abs(times_s) <= _TIME_LIMIT_S):
        raise SampleFileError(f"has times beyond {_TIME_LIMIT_S:g} s, or no times at all.")
    try:
        return find_rate(times_s).rate
    except UnevenTimesError as error:
        raise SampleFileError(f"{error.reason}.") from error


def write_samples(path: Path, samples: NDArray[Any]) -> None:
    """Write codes or values of shape (n,) as a new ``.npy`` file, durably."""
    buffer = io.BytesIO()
    np.save(buffer, samples, allow_pickle=False)
    publish(path, buffer.getvalue())


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
