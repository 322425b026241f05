"""What a person measured, in a file beside the recordings, goes into the campaign made of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from impactd.importing.errors import RecordingError
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.errors import CampaignError

_SHOTS = "shots"


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


def state(campaign: Path, values: dict[str, Any], file: Path) -> None:
    """Write values into a ``campaign.json``, and check the whole. Raise RecordingError."""
    document = json.loads(campaign.read_text(encoding="utf-8"))
    stated = dict(values.get(_SHOTS, {}))
    for shot in document[_SHOTS]:
        shot.update(stated.pop(shot["name"], {}))
    if stated:
        names = ", ".join(shot["name"] for shot in document[_SHOTS])
        raise RecordingError(
            f"{file}:", f"there is no shot {next(iter(stated))!r}; the shots are {names}."
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
