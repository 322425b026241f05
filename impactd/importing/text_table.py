"""Tables as text: any delimiter, decimal point or comma, with header or without.

Not ``csv.Sniffer``: it does not know decimal commas, and takes a tab table with one stray field for
a table of something else. Here every reading of the lines is tried, and the one that makes most of
them numbers is taken.
"""

from __future__ import annotations

import csv
import gzip
import itertools
import re
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.written_numbers import counted
from impactd.importing.errors import RecordingError
from impactd.importing.recording import Channel, Recording
from impactd.importing.times import counts_samples, rate_of_times
from impactd.importing.units import find_time_unit, find_unit, is_time_name, split_name

LIMIT_BYTES = 4 * 1024**3
"""Of a text: 10^8 samples of two numbers, the most that a shot may have. [B]"""
_GZIP = b"\x1f\x8b"
"""What such a file begins with (RFC 1952)."""
_LOOKED_AT = 400
"""Lines from which the form is told; stray fields and headers stand in the first ones."""
_MOSTLY = 0.9
"""Of the lines: a column with numbers in fewer is no column of a record."""
_FORMS = (
    ("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), (",", ","),
    ("|", "."), (None, "."), (None, ","),
)  # fmt: skip
"""Delimiter (``None`` is blanks) and decimal mark."""
_NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", None: "blanks"}
_RATE = re.compile(r"^(sampl\w*[ _]*(rate|freq\w*)|fs|abtastrate)\b", re.IGNORECASE)
_INTERVAL = re.compile(
    r"^(sampl\w*[ _]*(interval|period|time)|(delta|d)[ _]?[tx]|time[ _]?(step|base|interval)"
    r"|(x[ _]?)?incr(ement)?)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class _Form:
    """The delimiter and the decimal sign of the lines."""

    delimiter: str | None
    decimal: str

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line."""
        if self.delimiter is None:
            return line.split()
        if '"' in line:
            try:
                return next(csv.reader([line], delimiter=self.delimiter), [])
            except csv.Error:  # e.g. a page with a picture in it: no line of a table
                return []
        return line.split(self.delimiter)

    def number(self, field: str) -> float:
        """Return a number; NaN where the field is none."""
        text = field.strip()
        if self.decimal == ",":
            if "." in text:
                return np.nan
            text = text.replace(",", ".")
        try:
            return float(text) if text[-1:].isdigit() or text[-1:] == "." else np.nan
        except ValueError:
            return np.nan

    def numbers(self, line: str) -> list[float]:
        """Return the fields of a line as numbers."""
        return [self.number(field) for field in self.fields(line)]


def read_text(path: Path) -> Recording:
    """Return the columns of a text file, a channel for each column of numbers but the time.

    Raises RecordingError if it is no table of numbers.
    """
    lines = [line for line in decode(path).splitlines() if line.strip(" ,;\t|")]
    if not lines:
        raise RecordingError(path.name, "is empty.", "Export the recording again.")
    form = _find_form(path.name, lines)
    begin, columns, strays = _find_columns(path.name, lines, form)
    table = _table(path.name, lines[begin:], form, columns)
    names, units = _names(lines[:begin], form, columns)
    assumed = [_form_said(path.name, form, begin)]
    assumed += [
        f"{path.name}: column {at + 1} is filled in {count} of {len(lines) - begin} rows only and "
        "is left out."
        for at, count in strays
    ]
    return _recording(
        path.name,
        table,
        columns,
        names=names,
        units=units,
        header=lines[:begin],
        form=form,
        assumed=assumed,
    )


def decode(path: Path) -> str:
    """Return a file as text, unzipped if it is gzip: UTF-8, UTF-16 with its mark, or Latin-1.

    Raises RecordingError if it is too long, or no text.
    """
    if path.stat().st_size > LIMIT_BYTES:
        raise RecordingError(path.name, f"has more than {LIMIT_BYTES / 1e9:.1f} GB.")
    content = path.read_bytes()
    if content[:2] == _GZIP:
        content = _unzipped(path)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    if b"\0" in content[:4096]:
        raise RecordingError(
            path.name,
            "is not a text file, and its ending is unknown.",
            "Give it the ending of its format: .npy, .npz, .mat, .wav, .uff, .tdms, .lvm, .h5, "
            ".csv.",
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _unzipped(path: Path) -> bytes:
    """Return what a gzip holds. Raise RecordingError if it is damaged, or unpacks to too much."""
    try:
        with gzip.open(path) as file:
            content = file.read(LIMIT_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(
            path.name, f"is a damaged gzip file: {error}.", "Copy it from the instrument again."
        ) from error
    if len(content) > LIMIT_BYTES:
        raise RecordingError(path.name, f"unpacks to more than {LIMIT_BYTES / 1e9:.1f} GB.")
    return content


def _form_said(file: str, form: _Form, begin: int) -> str:
    lines = counted(begin, "line")
    head = f"{lines} before the numbers" if begin else "no header"
    comma = ", decimal commas" if form.decimal == "," else ""
    return f"{file}: columns separated by {_NAMES[form.delimiter]}{comma}; {head}."


def _find_form(file: str, lines: list[str]) -> _Form:
    """Return the form in which most of the later lines are numbers, and then most columns."""
    # Headers and strays stand in front: the end of the file tells the form.
    tail = lines[-_LOOKED_AT:] if len(lines) > 2 * _LOOKED_AT else lines[len(lines) // 2 :]
    best, score = None, (0.0, 0)
    for delimiter, decimal in _FORMS:
        form = _Form(delimiter, decimal)
        whole, widths = 0, Counter[int]()
        for line in tail:
            filled = [field for field in form.fields(line) if field.strip()]
            good = sum(not np.isnan(form.number(field)) for field in filled)
            whole += good == len(filled) and good > 0
            widths[good] += 1
        common, times = widths.most_common(1)[0]
        found = (round((whole + 0.5 * times) / (1.5 * len(tail)), 3), common)
        if common and found > score:
            best, score = form, found
    if best is None:
        raise RecordingError(
            file,
            f"holds no table of numbers; its first line is {lines[0][:60]!r}.",
            "Export it as a table: time and signal, one sample a line.",
        )
    if best == _Form(",", ".") and _is_one_decimal(tail):
        return _Form(None, ",")
    return best


def _is_one_decimal(lines: list[str]) -> bool:
    """Return whether ``0,05`` is one number: nobody writes the whole number five as 05."""
    parts = [line.strip().split(",") for line in lines]
    if not all(len(one) == 2 and one[1].isdigit() for one in parts):
        return False
    return any(len(one[1]) > 1 and one[1][0] == "0" for one in parts)


def _find_columns(
    file: str, lines: list[str], form: _Form
) -> tuple[int, list[int], list[tuple[int, int]]]:
    """Return where the numbers begin, the columns that hold them, and strays with their count."""
    sample = lines[-_LOOKED_AT:] if len(lines) > 2 * _LOOKED_AT else lines[len(lines) // 2 :]
    counts = Counter(
        at for line in sample for at, x in enumerate(form.numbers(line)) if not np.isnan(x)
    )
    columns = sorted(at for at, count in counts.items() if count >= _MOSTLY * len(sample))
    if not columns:
        raise RecordingError(file, "holds no column that is numbers from top to bottom.")

    def is_row(line: str) -> bool:
        """Return whether all wanted columns of a line are numbers."""
        numbers = form.numbers(line)
        return all(at < len(numbers) and not np.isnan(numbers[at]) for at in columns)

    last = len(lines) - len(sample)
    begin = next((at for at, line in enumerate(lines) if is_row(line)), last)
    # A number in a header ("Record length, 2500") is followed by more of the header.
    headers = [at for at in range(begin, min(begin + 200, last)) if not is_row(lines[at])]
    if headers and headers[-1] - begin < 100:
        begin = headers[-1] + 1
    rows = lines[begin : begin + _LOOKED_AT]
    filled = Counter(
        at
        for line in rows
        for at, x in enumerate(form.numbers(line))
        if at not in columns and not np.isnan(x)
    )
    return begin, columns, sorted(filled.items())


def _table(file: str, lines: list[str], form: _Form, columns: list[int]) -> NDArray[np.float64]:
    """Return the wanted columns, shape (rows, columns)."""
    quick = lines
    if form.decimal == ",":
        quick = [line.replace(",", ".") for line in lines]
    try:
        return np.loadtxt(
            quick,
            delimiter=form.delimiter,
            usecols=columns,
            ndmin=2,
            comments=None,
            quotechar='"' if form.delimiter is not None else None,
        )
    except ValueError:
        pass  # a gap, a note at the end, a decimal comma within quotes: line by line
    rows = np.full((len(lines), len(columns)), np.nan)
    for row, line in enumerate(lines):
        numbers = form.numbers(line)
        rows[row] = [numbers[at] if at < len(numbers) else np.nan for at in columns]
    good = np.flatnonzero(~np.isnan(rows).any(axis=1))
    if good.size < 2:
        raise RecordingError(file, "holds fewer than two rows of numbers.")
    rows = rows[good[0] : good[-1] + 1]  # a note below the table is no gap in it
    bad = np.flatnonzero(np.isnan(rows).any(axis=1))
    if bad.size:
        at = int(good[0] + bad[0])
        raise RecordingError(
            file,
            f"has a gap in its numbers: {lines[at][:60]!r}.",
            "Cut the file there, or fill the gap: a fit needs every sample.",
        )
    return rows


def _names(
    header: list[str], form: _Form, columns: list[int]
) -> tuple[dict[int, str], dict[int, str]]:
    """Return names and units of columns, from the last lines before the numbers."""
    names: dict[int, str] = {}
    units: dict[int, str] = {}
    for line in reversed(header[-3:]):
        fields = [field.strip().strip('"').strip() for field in form.fields(line.lstrip("#% "))]
        told = {at: fields[at] for at in columns if at < len(fields) and fields[at]}
        if len(told) < len(columns) or not any(re.search(r"[^\W\d]", one) for one in told.values()):
            continue
        is_units = [
            find_unit(one) is not None or find_time_unit(one) is not None for one in told.values()
        ]
        bracketed = any(mark in one for one in told.values() for mark in "([")
        below_names = line is not header[0] and len(told) > 1
        if all(is_units) and not units and (bracketed or below_names):
            units = told
        else:
            names = told
            break
    for at, name in list(names.items()):
        short, unit = split_name(name)
        names[at] = short
        if unit is not None:
            units.setdefault(at, unit)
    return names, units


def _recording(
    file: str,
    table: NDArray[np.float64],
    columns: list[int],
    *,
    names: dict[int, str],
    units: dict[int, str],
    header: list[str],
    form: _Form,
    assumed: list[str],
) -> Recording:
    """Return the columns as channels, with the units and times that names and header state."""
    rate, u_rate, time_unit, time_at = None, 0.0, None, None
    named = [place for place, at in enumerate(columns) if _is_time(names.get(at), units.get(at))]
    if named:
        time_at = named[0]
    elif len(columns) > 1:
        first = table[:, 0]
        if counts_samples(first):
            assumed.append(f"{file}: column {columns[0] + 1} counts the samples; it is not a time.")
            table, columns = table[:, 1:], columns[1:]
        elif _rises(first):
            time_at = 0
            assumed.append(
                f"{file}: column {columns[0] + 1} rises evenly and is taken for the time."
            )
    has_times = time_at is not None
    if time_at is not None:
        time_unit = find_time_unit(units.get(columns[time_at]))
        times = table[:, time_at] * 1.0
        even = rate_of_times(file, times, time_unit)
        rate, u_rate = even.rate_hz, even.u_rate_hz
        assumed += even.said
    else:
        rate = _stated_rate(header, form)
        if rate is not None:
            assumed.append(f"{file}: its header states {rate:g} samples a second.")
    channels = tuple(
        Channel(
            names.get(at, f"column {at + 1}"),
            at + 1,
            (np.ascontiguousarray(table[:, place]),),
            units.get(at),
        )
        for place, at in enumerate(columns)
        if place != time_at
    )
    if not channels:
        raise RecordingError(file, "holds times and no signal.", "Export the signal beside them.")
    return Recording(file, channels, rate, u_rate, time_unit, has_times, tuple(assumed))


def _is_time(name: str | None, unit: str | None) -> bool:
    if name is None:
        return False
    return is_time_name(name) or (find_time_unit(unit) is not None and find_unit(unit) is None)


def _rises(values: NDArray[np.float64]) -> bool:
    return bool(values[-1] > values[0] and np.all(np.diff(values) >= 0.0))


def _stated_rate(header: list[str], form: _Form) -> float | None:
    """Return the rate that a line of the header states. [Hz]"""
    for name, text in _statements(header, form):
        key, unit = split_name(name.lstrip("#% "))
        value = re.match(r"\s*([-+.\deE]+)\s*(\w*)", text)
        if value is None:
            continue
        number = form.number(value[1])
        said = (value[2] or unit or "").lower()
        if not number > 0:
            continue
        if _RATE.match(key):
            return number * {"khz": 1e3, "mhz": 1e6}.get(said, 1.0)
        if _INTERVAL.match(key):
            factor = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(said, 1.0)
            return 1 / (number * factor)
    return None


def _statements(header: list[str], form: _Form) -> Iterator[tuple[str, str]]:
    """Yield names and values of a header: side by side, then each above its value."""
    for line in header:
        for fields in (form.fields(line), re.split(r"[:=]", line, maxsplit=1)):
            if len(fields) > 1:
                yield fields[0], fields[1]
    for above, below in itertools.pairwise(header):
        yield from zip(form.fields(above), form.fields(below), strict=False)
