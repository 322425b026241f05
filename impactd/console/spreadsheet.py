"""Results as CSV: one number a line, with its unit in a column of its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from analysis.written_numbers import counted
from impactd.aliases import Json
from impactd.console.failure import Failure
from impactd.storage.csv_table import csv_line

COLUMNS = ("model", "of", "name", "quantity", "value", "u", "low95", "high95", "unit", "status")


def write_csv(file: Path, document: Json) -> None:
    """Write the numbers of a result for a spreadsheet.

    Parameters
    ----------
    file : Path
        Where to; UTF-8 with a byte order mark, without which Excel misreads units.
    document : dict
        ``impactd-fit/1``, ``impactd-diagnosis/1`` (both of its models), or the answer of
        ``GET /v1/moduli``.

    Raises
    ------
    Failure
        If the file cannot be written.
    """
    blocks = [document[key] for key in ("before", "after") if key in document] or [document]
    try:
        with file.open("w", newline="", encoding="utf-8-sig") as out:
            out.write(csv_line(COLUMNS))
            for block in blocks:
                out.writelines(csv_line(row) for row in _rows(block))
    except OSError as error:
        raise Failure(f"{file} cannot be written: {error.strerror}.") from error


def _rows(block: Json) -> Iterator[tuple[Any, ...]]:
    model = block.get("model", "")
    for name, modulus in (block.get("moduli") or {}).items():
        for key in ("youngs_modulus_Pa", "plane_strain_modulus_Pa"):
            yield (
                model,
                "material",
                name,
                key,
                *_numbers(key, modulus.get(key)),
                modulus["status"],
            )
    for name, pair in (block.get("pairs") or {}).items():
        for key in ("reduced_modulus_Pa", "stiffness", "stiffness_over_mass"):
            if key in pair:
                yield (
                    model,
                    "pair",
                    name,
                    key,
                    *_numbers(key, pair[key]),
                    counted(pair["shots"], "hit"),
                )
    for name, value in (block.get("parameters") or {}).items():
        yield (model, "parameter", name, name.rpartition(".")[2], *_numbers(name, value), "")


def _numbers(quantity: str, found: Json | None) -> tuple[Any, ...]:
    known = found or {}
    low, high = known.get("interval95") or (None, None)
    unit = known.get("unit") or ("Pa" if quantity.endswith("_Pa") else "")
    return known.get("value"), known.get("u"), low, high, unit
