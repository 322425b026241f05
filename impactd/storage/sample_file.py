"""The samples of one shot of a campaign folder: ``.npy`` (one-dimensional) or ``.csv``."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactd.storage.publish import publish

MAX_SAMPLES = 100_000_000
UNEVEN_TOLERANCE = 0.05
_COLUMNS = {
    "voltage": ("volts",),
    "force_N": ("force_N", "newtons"),
    "acceleration_m_per_s2": ("acceleration_m_per_s2",),
}


class SampleFileError(Exception):
    """A sample file cannot be used; the message continues a sentence that names the file."""


def read_samples(folder: Path, name: str, quantity: str) -> tuple[NDArray[Any], float | None]:
    """Return the samples of a file inside a campaign folder.

    Parameters
    ----------
    folder : Path
        The campaign's folder; nothing outside it is ever opened.
    name : str
        As ``campaign.json`` calls the file.
    quantity : str
        What the samples are of; a csv header must agree.

    Returns
    -------
    samples : ndarray, shape (n,)
        In the file's own type (integers or floats), native byte order.
    sample_rate_hz : float or None
        As a csv's time column says. [Hz]

    Raises
    ------
    SampleFileError
        If the file is missing, lies outside the folder or does not hold such samples.
    """
    if "\0" in name:
        raise SampleFileError("is no file name.")
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise SampleFileError("lies outside the campaign's folder.")
    if not path.is_file():
        raise SampleFileError("does not exist.")
    try:
        if path.suffix == ".npy":
            return _read_npy(path), None
        if path.suffix == ".csv":
            return _read_csv(path, quantity)
    except OSError as error:
        raise SampleFileError(f"cannot be read ({error.strerror}).") from error
    raise SampleFileError("is neither .npy nor .csv.")


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        # Mapped first: the header says shape and type before anything is read into memory.
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, SyntaxError) as error:
        raise SampleFileError(f"is no .npy file of numbers ({_first_line(error)}).") from error
    if not isinstance(mapped, np.ndarray) or mapped.ndim != 1:
        shape = getattr(mapped, "shape", "unknown")
        raise SampleFileError(f"has shape {shape}; it must be one-dimensional.")
    if mapped.dtype.kind not in "iuf":
        raise SampleFileError(f"holds {mapped.dtype}; it must hold integers or floats.")
    if mapped.size > MAX_SAMPLES:
        raise SampleFileError(f"has {mapped.size} samples; at most {MAX_SAMPLES} are read.")
    return np.array(mapped, dtype=mapped.dtype.newbyteorder("="))


def _read_csv(path: Path, quantity: str) -> tuple[NDArray[np.float64], float]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise SampleFileError("is not UTF-8 text.") from error
    header, _, body = text.partition("\n")
    names = [name.strip() for name in header.split(",")]
    wanted = _COLUMNS[quantity]
    if len(names) != 2 or names[0] != "time_s" or names[1] not in wanted:
        expected = " or ".join(f"'time_s,{name}'" for name in wanted)
        raise SampleFileError(f"has the header {header.strip()[:60]!r}; it must be {expected}.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty table is refused below, in our words
            table = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2)
    except ValueError as error:
        raise SampleFileError(f"is no table of numbers ({_first_line(error)}).") from error
    if table.shape[0] < 2 or table.shape[1] != 2:
        raise SampleFileError(f"holds a table of shape {table.shape}; two columns are needed.")
    steps = np.diff(table[:, 0])
    step_s = float(np.median(steps))
    if not (np.all(np.isfinite(steps)) and step_s > 0.0):
        raise SampleFileError("has a time column that does not rise.")
    # Times are often printed with few digits: judge each against the line, not against the last.
    line = table[0, 0] + np.arange(table.shape[0]) * (
        (table[-1, 0] - table[0, 0]) / (table.shape[0] - 1)
    )
    worst = int(np.argmax(np.abs(table[:, 0] - line)))
    printed = abs(float(table[worst, 0])) * 1e-6
    if abs(table[worst, 0] - line[worst]) > max(UNEVEN_TOLERANCE * step_s, printed):
        raise SampleFileError(f"is not sampled evenly (row {worst + 1}, {table[worst, 0]:g} s).")
    rate_hz = (table.shape[0] - 1) / float(table[-1, 0] - table[0, 0])
    return np.ascontiguousarray(table[:, 1]), rate_hz


def write_samples(path: Path, samples: NDArray[Any]) -> None:
    """Write samples as ``.npy``, durably.

    Parameters
    ----------
    path : Path
        The file; it must not exist.
    samples : ndarray, shape (n,)
        Codes or values.
    """
    buffer = io.BytesIO()
    np.save(buffer, samples, allow_pickle=False)
    publish(path, buffer.getvalue())


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
