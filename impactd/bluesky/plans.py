"""Plans: a series of drops as one run."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import Any

import bluesky.plan_stubs as bps
import bluesky.preprocessors as bpp

from impactd.bluesky.detector import ImpactDetector


def drop_series(
    detector: ImpactDetector,
    sphere: str,
    surface: str,
    height_m: float,
    *,
    repeats: int,
    md: Mapping[str, Any] | None = None,
) -> Generator[Any, Any, Any]:
    """Drop one sphere on one surface again and again: one run, one event a shot.

    Parameters
    ----------
    detector : ImpactDetector
        The rig.
    sphere, surface : str
        Names in the rig's materials.
    height_m : float
        Drop height. [m]
    repeats : int
        Drops.
    md : mapping, optional
        More for the run's start document.

    Yields
    ------
    Msg
        For the RunEngine; stopping it aborts the drop that is under way.
    """
    about = {
        "plan_name": "drop_series",
        "detectors": [detector.name],
        "num_points": repeats,
        "sphere": sphere,
        "surface": surface,
        "drop_height_m": height_m,
    }

    @bpp.stage_decorator([detector])
    @bpp.run_decorator(md={**about, **(md or {})})
    def run() -> Generator[Any, Any, None]:
        """Make the drops."""
        detector.drop_next(sphere, surface, height_m)
        for _ in range(repeats):
            yield from bps.trigger_and_read([detector])

    return (yield from run())
