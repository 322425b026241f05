"""The observation of each shot's latest fit for the network of moduli, kept up to date in memory.

The index holds several kilobytes of result per shot; the network needs six numbers of it. They are
read once, and from then on only fits that were written since.
"""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from impactd.moduli.control_chart import PairChart
from impactd.storage.archive import Archive
from impactd.storage.fits import ShotFit

if TYPE_CHECKING:
    from analysis import PairObservation
    from analysis.campaign import Quantity

CERTIFICATE = "certificate"
"""What the cell's values came from before the first calibration."""
IDS_AT_ONCE = 50
"""A fit is decoded in 0.1-0.2 ms: so many hold the reading connection for less than 10 ms."""


@dataclass(frozen=True, slots=True)
class ShotUse:
    """How the network uses a shot."""

    started_utc: str
    observation: PairObservation | None
    """``None`` where the shot stays out."""
    entry: str
    """JSON of its entry among the answer's ``shots``: number and SHA-256; where it stays out, of
    that among ``excluded``: number and reason."""
    temperature_c: Quantity | None
    """At the shot. [degC]"""


class Observations:
    """The latest fit of every shot under one model. Not thread safe.

    ``version`` grows whenever a shot's fit is taken in.
    """

    def __init__(self, archive: Archive, model: str) -> None:
        self._archive = archive
        self._model = model
        self._seen = 0
        self._uses: dict[int, ShotUse] = {}
        self.version = 0

    def update(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Take in what was written since the last time.

        ``stopped`` is asked between batches; what is missing then is taken in the next time.
        """
        # Ids grow in the order of commits: the index has one writer at a time.
        fits, newest = self._archive.fits, self._archive.fits.last_id()
        while self._seen < newest and not stopped():
            last = min(self._seen + IDS_AT_ONCE, newest)
            for found in fits.of_shots(self._model, after=self._seen, last=last):
                self._uses[found.number] = _use(found)
                self.version += 1
            self._seen = last
            time.sleep(0)  # others may want the interpreter

    def chosen(self, since: str | None, until: str | None) -> list[ShotUse]:
        """Return the shots of a time in the order of their numbers.

        ``since`` is the first timestamp that counts, ``until`` the first that does not, in the
        archive's form.
        """
        return [
            use for _, use in sorted(self._uses.items()) if _within(use.started_utc, since, until)
        ]

    def charts(self, since: str | None, until: str | None) -> dict[tuple[str, str], PairChart]:
        """Return the control chart of every pair that takes part, in alphabetical order.

        The keys are sphere and surface; the times are as in `chosen`.
        """
        found: dict[tuple[str, str], list[tuple[int, ShotUse, PairObservation]]] = {}
        for number, use in sorted(self._uses.items()):
            seen = use.observation
            if seen is None or not _within(use.started_utc, since, until):
                continue
            found.setdefault((seen.sphere, seen.surface), []).append((number, use, seen))
        return {
            pair: PairChart(
                tuple(number for number, _, _ in group),
                tuple(use.started_utc for _, use, _ in group),
                np.array([seen.log_reduced_modulus for _, _, seen in group]),
                np.array([seen.u_random for _, _, seen in group]),
            )
            for pair, group in sorted(found.items())
        }


def _within(moment: str, since: str | None, until: str | None) -> bool:
    return (since is None or moment >= since) and (until is None or moment < until)


def _use(found: ShotFit) -> ShotUse:
    from analysis import observation_from_fit

    why_not, seen = _why_not(found), None
    if why_not is None:
        calibration = CERTIFICATE if found.fit.calibration is None else str(found.fit.calibration)
        seen = observation_from_fit(
            found.fit.result, shot=f"shot {found.number}", calibration=calibration
        )
        why_not = None if seen else "its fit gives no reduced modulus"
    if seen is None:
        entry = _encoded({"shot": found.number, "reason": why_not})
        return ShotUse(found.started_utc, None, entry, None)
    entry = _encoded({"number": found.number, "sha256": found.sha256})
    temperature = None if found.environment is None else found.environment.temperature_c
    return ShotUse(found.started_utc, _with_shared_names(seen), entry, temperature)


def _encoded(entry: dict[str, object]) -> str:
    text = json.dumps(entry, ensure_ascii=False, separators=(",", ":"))
    # A lone surrogate is valid in a JSON escape and in no UTF-8 answer.
    return text.encode("utf-8", "replace").decode()


def _with_shared_names(seen: PairObservation) -> PairObservation:
    """Return the observation with one copy of each name for all shots: JSON makes one each time."""
    return replace(
        seen,
        sphere=sys.intern(seen.sphere),
        surface=sys.intern(seen.surface),
        model=sys.intern(seen.model),
        calibration=sys.intern(seen.calibration),
        input_u=_shared(tuple(seen.input_u.items())),
    )


@lru_cache(maxsize=256)
def _shared(items: tuple[tuple[str, float], ...]) -> dict[str, float]:
    """Return one mapping for all shots that were fitted with the same values."""
    return dict(items)


def _why_not(found: ShotFit) -> str | None:
    """Return why a shot stays out of the network, ``None`` when it takes part."""
    if found.source == "import":
        return "it was recorded on another rig; fit its campaign instead"
    outcome = found.fit.result["outcome"]
    if outcome["status"] != "converged":
        return str(outcome["message"])
    if found.clipped:
        return "it reaches a limit of the converter or amplifier"
    if found.series is not None:
        # The cell's calibration rests on it already; counted again, it would vouch for itself.
        return f"it belongs to calibration {found.series}"
    return None
