"""The task of the worker beside the fits: compare a shot with its repetitions."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from pathlib import Path

from analysis.diagnosis.repetitions import Recorded, compare
from analysis.errors import ShotRejectedError
from impactd.aliases import Json
from impactd.storage.assemble import campaign_shot
from impactd.storage.errors import CorruptShotError
from impactd.storage.shot_store import read_shot

SHOTS_KEPT = 400
"""Windows that stay in memory, some 100 kB each: of a session each shot is read once."""


def warm_up() -> None:
    """Do nothing: importing this module has loaded what a comparison needs."""


def compare_shot(order: Json) -> Json:
    """Compare a shot with its repetitions; the order is from `orders.order_for`.

    Return ``comparison``, as `ShotAnswer.repetitions` documents it. Without enough repetitions, or
    a pulse, it names no shots and no numbers.
    """
    shot = _recorded(*_place(order["shot"]))
    numbers = {f"shot {one['number']}": one["number"] for one in order["earlier"]}
    earlier = [_recorded(*_place(one)) for one in order["earlier"]]
    found = None
    if shot is not None:
        known = [one for one in earlier if one is not None]
        found = compare(shot, known, speed_repeatability=order["speed_repeatability"])
    if found is None:
        return {"comparison": {"shots": [], "unlike": False, "sentence": "", "likely": []}}
    return {
        "comparison": {
            "shots": [numbers[name] for name in found.repetitions],
            "unlike": found.unlike,
            "sentence": found.sentence,
            "likely": [one.like for one in found.likely],
            "size": found.size,
            "duration": found.duration,
            "shape": found.shape,
        }
    }


def _place(one: Json) -> tuple[str, str, float | None]:
    return one["path"], one["sha256"], one["drop_height_m"]


@lru_cache(SHOTS_KEPT)
def _recorded(path: str, sha256: str, drop_height_m: float | None) -> Recorded | None:
    """Return a shot and its stated height for the comparison, None where that cannot be."""
    try:
        shot = campaign_shot(read_shot(Path(path), sha256))
        return Recorded.of(dataclasses.replace(shot, drop_height_m=drop_height_m))
    except (CorruptShotError, ShotRejectedError):  # `impactd verify` and the fit tell of these
        return None
