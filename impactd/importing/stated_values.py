"""What a person measured, in a file beside the recordings, goes into the campaign made of them."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

from impactd.importing.errors import RecordingError
from impactd.importing.text_table import decode
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.errors import CampaignError

_SHOTS = "shots"
_WORDS = ("sphere", "surface")
"""Columns of a table of drops that are no numbers."""


def read_values(file: Path) -> dict[str, Any]:
    """Return the values: keys of ``campaign.json``, and ``shots`` by name. Raise RecordingError."""
    try:
        values: Any = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{file}:", f"cannot be read as JSON: {error}.") from error
    shots = values.get(_SHOTS, {}) if isinstance(values, dict) else None
    if not isinstance(shots, dict) or not all(isinstance(one, dict) for one in shots.values()):
        raise RecordingError(
            f"{file}:", 'is no object of a campaign\'s keys with "shots" by their names.'
        )
    return dict(values)


def read_drops(file: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of a table of drops by their names, as keys of a shot.

    The delimiter is a comma, a semicolon or a tab; with the last two, decimal commas are read.
    Raises RecordingError.
    """
    try:
        lines = [line for line in decode(file).splitlines() if line.strip(" ,;\t")]
    except OSError as error:
        raise RecordingError(f"{file}:", f"cannot be read: {error.strerror}.") from error
    delimiter = max("\t;,", key=lines[0].count) if lines else ","
    rows = csv.DictReader(lines, delimiter=delimiter, restkey="", restval="")
    columns = [column.strip() for column in rows.fieldnames or ()]
    if "name" not in columns:
        raise RecordingError(
            f"{file}:",
            f"has no column name; its first line has {', '.join(columns) or 'nothing'}.",
            "Head the columns name (the recording's file or the shot), sphere, surface, "
            "drop_height_mm.",
        )
    rows.fieldnames = columns
    found: dict[str, dict[str, Any]] = {}
    for row in rows:
        cells = {key: str(cell).strip() for key, cell in row.items() if str(cell).strip()}
        name = cells.pop("name", "")
        if not name or name in found:
            raise RecordingError(
                f"{file}, line {rows.line_num}:",
                f"names {name!r} a second time." if name else "has no name.",
            )
        found[name] = {
            key: text if key in _WORDS else _number(file, name, key, text, delimiter)
            for key, text in cells.items()
        }
        if "drop_height_mm" in found[name]:
            found[name]["drop_height_m"] = found[name].pop("drop_height_mm") / 1e3
    return found


def _number(file: Path, name: str, column: str, text: str, delimiter: str) -> float:
    """Return a cell's number, else raise a RecordingError that names the cell."""
    try:
        return float(text if delimiter == "," else text.replace(",", "."))
    except ValueError:
        raise RecordingError(
            f"{file}, {name}, {column}:", f"{text!r} is no number.", "Write it without its unit."
        ) from None


def state(
    campaign: Path, values: dict[str, Any], drops: dict[str, dict[str, Any]], file: str
) -> None:
    """Write values and drops into a ``campaign.json``, and check the whole.

    Parameters
    ----------
    values : dict
        Of `read_values`.
    drops : dict
        Of `read_drops`; the name of a recording's file stands for all its hits.
    file : str
        Where both come from.

    Raises
    ------
    RecordingError
        If a key or a value is impossible, or a name belongs to no shot.
    """
    document = json.loads(campaign.read_text(encoding="utf-8"))
    stated = {**values.get(_SHOTS, {}), **drops}
    unused = dict(stated)
    for shot in document[_SHOTS]:
        for name in (shot["source_file"], shot["name"]):
            shot.update(stated.get(name, {}))
            unused.pop(name, None)
    if unused:
        names = ", ".join(shot["name"] for shot in document[_SHOTS])
        raise RecordingError(
            f"{file}:", f"there is no shot {next(iter(unused))!r}; the shots are {names}."
        )
    document |= {key: value for key, value in values.items() if key != _SHOTS}
    text = json.dumps(document, indent=1, ensure_ascii=False)
    campaign.write_text(text + "\n", encoding="utf-8")
    try:
        rejected = read_campaign(campaign).rejected
    except CampaignError as error:
        raise RecordingError(f"{file}, {error.json_path}:", error.reason) from error
    for shot in rejected:
        raise RecordingError(f"{file}, shot {shot.name}, {shot.path}:", shot.reason)
