"""A selection of shots with their numbers, for a spreadsheet, a program or an archive elsewhere.

Every number is the one that page and terminal show: of the latest fit that speaks for the shot.
"""

# ruff: noqa: PLC0415 - the package of the extra `parquet` is needed here and nowhere else

from __future__ import annotations

import gzip
import io
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from impactd.advice import UNLIKE, advice, best_fit, in_words
from impactd.aliases import Json
from impactd.storage.archive import Archive, Shot
from impactd.storage.csv_table import csv_line

FORMAT = "impactd-selection/1"
COLUMNS = (
    "shot",
    "started_utc",
    "sphere",
    "surface",
    "drop_height_m",
    "operator",
    "peak",
    "model",
    "calibration",
    "reduced_modulus_Pa",
    "u_Pa",
    "expanded_95_Pa",
    "advice",
    "because",
    "sha256",
)
_UNITS = {
    "drop_height_m": "m",
    "peak": "V",
    "reduced_modulus_Pa": "Pa",
    "u_Pa": "Pa",
    "expanded_95_Pa": "Pa",
}
_COUNTED = ("shot", "calibration")
_ABOUT = {
    "reduced_modulus_Pa": "E* of the pair, of the latest fit that speaks for the shot",
    "u_Pa": "its standard uncertainty (k = 1)",
    "expanded_95_Pa": "its expanded uncertainty U (95 %)",
    "peak": "largest value of the record, V",
}


@dataclass(frozen=True)
class Selection:
    """Chosen shots.

    Attributes
    ----------
    shots : tuple of Shot
        In the order of their numbers.
    chosen_by : mapping
        What chose them, for the head of a file.
    """

    shots: tuple[Shot, ...]
    chosen_by: Mapping[str, object]
    software: str


def row_of(archive: Archive, shot: Shot) -> Json:
    """Return a shot's line, by `COLUMNS`."""
    fits = archive.fits.for_shot(shot.number)
    compared = archive.comparisons.get(shot.number) or {}
    unlike = bool(compared.get("unlike"))
    word, reasons = advice(shot, fits, unlike=unlike)
    best = best_fit(fits)
    modulus = None if best is None else best.result.get("reduced_modulus_Pa")
    usable = modulus if word != "repeat" else None
    return {
        "shot": shot.number,
        "started_utc": shot.started_utc,
        "sphere": shot.sphere,
        "surface": shot.surface,
        "drop_height_m": shot.drop_height_m,
        "operator": shot.operator,
        "peak": shot.peak,
        "model": None if best is None else best.model,
        "calibration": None if best is None else best.calibration,
        "reduced_modulus_Pa": None if usable is None else usable["value"],
        "u_Pa": None if usable is None else usable["u"],
        "expanded_95_Pa": None if usable is None else (usable.get("expanded") or {}).get("U"),
        "advice": word,
        "because": " ".join(
            str(compared.get("sentence")) if reason == UNLIKE and compared else in_words(reason)
            for reason in reasons
        ),
        "sha256": shot.sha256,
    }


def as_csv(archive: Archive, selection: Selection) -> str:
    """Return the selection as CSV with its metadata in a header of lines that begin with ``#``."""
    lines = [f"# {name}: {value}" for name, value in _head(selection).items()]
    lines += [f"# {name}: {about}" for name, about in _ABOUT.items()]
    text = io.StringIO()
    text.write("\r\n".join(lines) + "\r\n")
    text.write(csv_line(COLUMNS))
    for shot in selection.shots:
        row = row_of(archive, shot)
        text.write(csv_line(["" if row[name] is None else row[name] for name in COLUMNS]))
    return text.getvalue()


def as_gzip(archive: Archive, selection: Selection) -> bytes:
    """Return the same CSV, packed; the same selection gives the same bytes."""
    return gzip.compress(as_csv(archive, selection).encode(), mtime=0)


def as_json(archive: Archive, selection: Selection) -> str:
    """Return the selection as ``impactd-selection/1``."""
    found = {
        "format": FORMAT,
        **_head(selection),
        "about": _ABOUT,
        "shots": [row_of(archive, shot) for shot in selection.shots],
    }
    return json.dumps(found, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


class NoParquetError(Exception):
    """The package that writes Parquet is not installed."""


def as_parquet(archive: Archive, selection: Selection) -> bytes:
    """Return the selection as Parquet, units and meanings with the columns.

    Raises
    ------
    NoParquetError
        Without the extra ``parquet``.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise NoParquetError from error

    def field(name: str) -> Any:
        """Return a column's name, type, unit and meaning."""
        kind = pyarrow.string()
        if name in _UNITS:
            kind = pyarrow.float64()
        elif name in _COUNTED:
            kind = pyarrow.int64()
        told = {"unit": _UNITS.get(name), "description": _ABOUT.get(name)}
        return pyarrow.field(
            name, kind, metadata={key: value for key, value in told.items() if value is not None}
        )

    head = {"format": FORMAT, **{key: str(value) for key, value in _head(selection).items()}}
    table = pyarrow.Table.from_pylist(
        [row_of(archive, shot) for shot in selection.shots],
        schema=pyarrow.schema([field(name) for name in COLUMNS], metadata=head),
    )
    sink = io.BytesIO()
    pyarrow.parquet.write_table(table, sink)
    return sink.getvalue()


def as_zip(archive: Archive, selection: Selection) -> Iterator[bytes]:
    """Yield a zip of the shots' NeXus files and the CSV, file by file: never whole in memory.

    Yields
    ------
    bytes
        The next part of the zip.
    """
    sink = _Sink()
    # Stored, not packed: records are noise, and a rig's computer has a rig to run.
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED) as archived:
        archived.writestr("results.csv", as_csv(archive, selection))
        yield sink.taken()
        for shot in selection.shots:
            content = archive.shot_path(shot.number).read_bytes()
            archived.writestr(f"shots/shot-{shot.number:06d}.h5", content)
            yield sink.taken()
    yield sink.taken()


def _head(selection: Selection) -> Json:
    chosen = {
        key: " ".join(str(value).split())  # one line each
        for key, value in selection.chosen_by.items()
        if value is not None
    }
    return {"software": selection.software, "count": len(selection.shots), **chosen}


class _Sink(io.RawIOBase):
    """A file that is handed on as it is written."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def taken(self) -> bytes:
        """Return what was written since the last time."""
        found = b"".join(self._parts)
        self._parts.clear()
        return found


def numbers_of(text: str) -> Sequence[int] | None:
    """Return the shot numbers in ``3, 5, 8-19``; ``None`` when it is no such list."""
    found: set[int] = set()
    for part in text.replace(";", ",").replace(" ", ",").split(","):
        if not part:
            continue
        first, dash, last = part.partition("-")
        if not (first.isdecimal() and len(first) <= 9 and (not dash or last.isdecimal())):
            return None
        low, high = int(first), int(last) if dash else int(first)
        if not 0 < low <= high or high - low > 100_000:
            return None
        found.update(range(low, high + 1))
    return sorted(found) or None
