"""The residual stacked over shots, against the time after touch-down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.fit.measurand import Json
from analysis.fit.shot_fit import ShotFit

Array = NDArray[np.float64]

MOST_GROUPS = 40
"""More curves than this nobody reads; heights are then put together."""
# bins per contact time up to so many contact times
FINE_UNTIL, FINE = 4.0, 30
# and so many from there on, up to here
MIDDLE_UNTIL, MIDDLE = 10.0, 10
COARSE = 2
"""Bins per contact time beyond."""
DIGITS = 4
"""Of a number that is only drawn."""


@dataclass(frozen=True)
class Grid:
    """Bins of time after touch-down.

    Attributes
    ----------
    edges_us : ndarray, shape (b + 1,)
        [us]
    contact_us : float
        Median contact time. [us]
    """

    edges_us: Array
    contact_us: float

    @property
    def centres_us(self) -> Array:
        """Return the bins' middles. [us]"""
        return np.asarray((self.edges_us[1:] + self.edges_us[:-1]) / 2)


def time_us(shot: ShotFit) -> Array:
    """Return each fitted sample's time after touch-down. Shape (n,). [us]"""
    step = 1e6 / shot.item.frame.sample_rate_hz
    return np.asarray(np.arange(shot.prediction.size) * step - float(shot.own[2]))


def grid_for(shots: Sequence[ShotFit]) -> Grid:
    """Return bins that are fine while the contact lasts and coarse when little happens.

    Parameters
    ----------
    shots : sequence of ShotFit
        At least one.

    Returns
    -------
    Grid
        Never finer than a sample.
    """
    contact = float(np.median([s.contact_time_s for s in shots])) * 1e6
    sample = max(1e6 / s.item.frame.sample_rate_hz for s in shots)
    start = max(min(float(time_us(s)[0]) for s in shots), -4.0 * contact)
    end = max(float(time_us(s)[-1]) for s in shots)
    edges, at = [], start
    while at < end:
        edges.append(at)
        share = at / contact
        bins = FINE if -1 <= share < FINE_UNTIL else MIDDLE if share < MIDDLE_UNTIL else COARSE
        at += max(sample, contact / bins)
    return Grid(np.array([*edges, at]), contact)


def binned(grid: Grid, shot: ShotFit, values: Array) -> tuple[Array, Array]:
    """Return sums and counts of a shot's samples in each bin.

    Parameters
    ----------
    grid : Grid
        The bins.
    shot : ShotFit
        Whose time it is.
    values : ndarray, shape (n,)
        One for each fitted sample.

    Returns
    -------
    sums, counts : ndarray, shape (b,)
        Of the samples within each bin.
    """
    place = np.searchsorted(grid.edges_us, time_us(shot), side="right") - 1
    size = grid.edges_us.size - 1
    inside = (place >= 0) & (place < size)
    counts: Array = np.bincount(place[inside], minlength=size).astype(float)
    sums: Array = np.bincount(place[inside], weights=values[inside], minlength=size).astype(float)
    return sums, counts


def mean_of(grid: Grid, shots: Sequence[ShotFit]) -> Array:
    """Return the mean residual in each bin, NaN where there is none. Shape (b,)."""
    sums, counts = np.zeros(grid.edges_us.size - 1), np.zeros(grid.edges_us.size - 1)
    for shot in shots:
        more, seen = binned(grid, shot, shot.residual)
        sums += more
        counts += seen
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan)


def groups_of(
    shots: Sequence[ShotFit], key: Callable[[ShotFit], tuple[str, float | None]]
) -> dict[tuple[str, float | None], list[ShotFit]]:
    """Return shots by a key, keys in order."""
    found: dict[tuple[str, float | None], list[ShotFit]] = {}
    for shot in shots:
        found.setdefault(key(shot), []).append(shot)
    return dict(sorted(found.items(), key=lambda item: (item[0][0], item[0][1] or 0.0)))


def by_pair_and_height(shot: ShotFit) -> tuple[str, float | None]:
    """Return a shot's pair and height, rounded so that repetitions fall together."""
    height = shot.item.shot.drop_height_m
    return shot.item.pair, None if height is None else round(height, 4)


def stacks_json(shots: Sequence[ShotFit]) -> Json:
    """Return the mean residual of each pair and height, and of early, middle and late shots.

    Parameters
    ----------
    shots : sequence of ShotFit
        In order of time.

    Returns
    -------
    dict
        ``time_us`` and curves as lists, null where a bin is empty. [unit of the signal]
    """
    grid = grid_for(shots)
    groups = groups_of(shots, by_pair_and_height)
    if len(groups) > MOST_GROUPS:
        groups = groups_of(shots, lambda s: (s.item.pair, None))
    third = max(1, (len(shots) + 2) // 3)
    parts = {
        name: shots[at * third : (at + 1) * third]
        for at, name in enumerate(("early", "mid", "late"))
    }
    return {
        "time_us": _rounded(grid.centres_us),
        "contact_us": grid.contact_us,
        "by_pair_and_height": [
            {
                "pair": pair,
                "drop_height_m": height,
                "shots": len(own),
                "mean": _rounded(mean_of(grid, own)),
            }
            for (pair, height), own in groups.items()
        ],
        "by_order": [
            {"part": name, "shots": len(own), "mean": _rounded(mean_of(grid, own))}
            for name, own in parts.items()
            if own
        ],
    }


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]
