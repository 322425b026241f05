"""What is done with uploaded recordings in a process of its own: reading them, and a campaign.

Nobody knows who made these files. A reader that crashes, hangs or eats the memory ends its own
process, never the daemon's.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from impactd.aliases import Json
from impactd.importing.choices import Choices
from impactd.importing.errors import RecordingError
from impactd.importing.missing_values import missing_values
from impactd.importing.new_campaign import PICTURE_NAME as DRAWN_NAME
from impactd.importing.new_campaign import make_campaign
from impactd.jobs.recordings import FILES_NAME, PICTURE_NAME, VALUES_NAME
from impactd.storage.campaign_folder import read_campaign


def read(order: Json) -> Json:
    """Return the hits of recordings, what was assumed and what is missing; draw their picture.

    The campaign folder ``out`` is written, whole or not at all. ``refused`` is the only member
    where they cannot be read.
    """
    out = Path(order["out"])
    draft = out.with_name(f".{out.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)  # of a daemon that was killed
    made = _make(order, draft)
    if "refused" in made:
        shutil.rmtree(draft, ignore_errors=True)
    else:
        shutil.copyfile(draft / DRAWN_NAME, Path(order["folder"], PICTURE_NAME))
        draft.rename(out)
    return made


def _make(order: Json, out: Path) -> Json:
    # From here on files have the names that whoever sent them knows.
    os.chdir(Path(order["folder"], FILES_NAME))
    values = Path("..", VALUES_NAME)
    choices = Choices(
        **{**order["choices"], "columns": tuple(order["choices"]["columns"])},
        values=values if order["has_values"] else None,
    )
    try:
        made = make_campaign(order["files"], out, choices)
        missing = missing_values(read_campaign(made.path))
    except RecordingError as error:
        where = error.where.replace(str(values), "values")
        return {"refused": {"where": where, "what": error.what, "remedy": error.remedy}}
    return {"shots": made.shots_to_json(), "assumptions": list(made.said), "missing": missing}
