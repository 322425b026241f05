"""The mean waveform of other hits: the plainest prediction of a hit, without any model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.discrepancy.waveform_fit import (
    Hit,
    Placed,
    Waveform,
    fit_hit,
    padded_spline,
    residual,
    sampled,
)
from analysis.fit.campaign_fit import heldout_folds
from analysis.fit.measurand import Json
from analysis.fit.problem import JointProblem

MOST_ROUNDS = 20
"""Times that hits are aligned to their mean, and the mean is taken anew. Measured: four sets of
recordings needed 3 to 6; means of three hits creep on, by 8 % of their error in ten rounds more."""
SETTLED = 0.01
"""Relative fall of the squares at which a mean has settled: 0.5 % of the error."""
HELDOUT_STEPS = 12
"""At most, until the squares stand still. Measured: 3 to 5 in nearly all hits, 11 in one of 250."""
FEWEST_TRAINING = 2
"""Hits that make a mean: one is no mean."""

Array = NDArray[np.float64]
Key = tuple[str, str]
Fold = tuple[Sequence[int], Sequence[Hit]]
"""Hits to hold out together, and all hits as the others know them."""


@dataclass(frozen=True)
class Predicted:
    """A hit as predicted by a waveform that it had no part in.

    Attributes
    ----------
    sizes : ndarray, shape (2 + modes,)
        Of the mean and the modes, 1 being typical, and the offset. [1], [unit of the signal]
    stretch : float
        How many times longer it is than the mean. [1]
    residual : ndarray, shape (n,)
        What is left. [unit of the signal]
    """

    sizes: Array
    stretch: float
    residual: Array


@dataclass(frozen=True)
class Prediction:
    """All hits as predicted with so many modes of variation.

    Attributes
    ----------
    modes : int
        At most; a mean of few hits has fewer.
    hits : list of Predicted
        One a shot.
    """

    modes: int
    hits: list[Predicted]

    @property
    def heldout_rms(self) -> float:
        """Return the pooled error. [unit of the signal]"""
        squares = sum(float(one.residual @ one.residual) for one in self.hits)
        return math.sqrt(squares / sum(one.residual.size for one in self.hits))


@dataclass(frozen=True)
class MeanWaveform:
    """What the mean of other hits predicts, without and with modes of variation.

    Attributes
    ----------
    predictions : list of Prediction
        By the number of modes, from none on; empty where no mean can be had.
    shots : int
        How many were predicted.
    reason : str or None
        Why no mean can be had.
    """

    predictions: list[Prediction]
    shots: int
    reason: str | None = None

    @property
    def heldout_rms(self) -> float | None:
        """Return the error of the plain mean on held-out shots. [unit of the signal]"""
        return self.predictions[0].heldout_rms if self.predictions else None

    def to_json(self) -> Json:
        """Return the error of the plain mean, as a diagnosis states it."""
        return {"heldout_rms_V": self.heldout_rms, "shots": self.shots, "reason": self.reason}


def mean_waveform(problem: JointProblem, most_modes: int = 0) -> MeanWaveform:
    """Return how well the mean of other hits predicts each hit.

    Parameters
    ----------
    problem : JointProblem
        Its windows and folds are used, nothing of its model.
    most_modes : int
        Modes of variation to try as well.

    Returns
    -------
    MeanWaveform
        Over the same samples and folds as a fit's ``heldout_rms``. A held-out hit's size, shift,
        stretch, offset and modes are fitted to it, as its speed and touch-down are in a model.
    """
    hits = [Hit.of(item) for item in problem.shots]
    folds = [(fold, hits) for fold in heldout_folds(problem)]
    found = predictions(problem, folds, most_modes)
    if not found:
        return MeanWaveform([], 0, _too_few(len(hits)))
    return MeanWaveform(found, len(hits))


def predictions(problem: JointProblem, folds: Iterable[Fold], most_modes: int) -> list[Prediction]:
    """Return every hit as predicted by the waveforms of the hits outside its fold.

    Parameters
    ----------
    problem : JointProblem
        Says what hit what.
    folds : iterable of tuple
        Shots to hold out together, and all hits as the shots outside the fold know them.
    most_modes : int
        Modes of variation.

    Returns
    -------
    list of Prediction
        By the number of modes. The others are those of the same sphere and surface; where a fold
        leaves fewer than `FEWEST_TRAINING` of these, all of the same quantity; where it leaves
        fewer of these too, the list is empty.
    """
    keys = [(item.shot.quantity, item.pair) for item in problem.shots]
    found: list[dict[int, Predicted]] = [{} for _ in range(most_modes + 1)]
    for fold, hits in folds:
        kept = [i for i in range(len(keys)) if i not in fold]
        for key in dict.fromkeys(keys[i] for i in fold):
            training = [hits[i] for i in _training(kept, keys, key)]
            if len(training) < FEWEST_TRAINING:
                return []
            mean, placed = learned(training)
            for modes, one in enumerate(found):
                wave = with_modes(mean, training, placed, modes)
                one |= {i: _predicted(wave, hits[i]) for i in fold if keys[i] == key}
    if not found[0]:
        return []
    return [Prediction(m, [one[i] for i in range(len(keys))]) for m, one in enumerate(found)]


def _predicted(wave: Waveform, hit: Hit) -> Predicted:
    placed = fit_hit(wave, hit, wave.starts(hit), HELDOUT_STEPS)
    return Predicted(placed.sizes, wave.stretch(hit, placed), residual(wave, hit, placed))


def _training(kept: Sequence[int], keys: Sequence[Key], key: Key) -> list[int]:
    """Return the hits of a pair, or all of its quantity where these are too few."""
    own = [i for i in kept if keys[i] == key]
    return own if len(own) >= FEWEST_TRAINING else [i for i in kept if keys[i][0] == key[0]]


def _too_few(count: int) -> str:
    return (
        f"{count} {'shot leaves' if count == 1 else 'shots leave'} no mean of at least "
        f"{FEWEST_TRAINING} others of the same quantity where some are held out"
    )


def learned(hits: Sequence[Hit]) -> tuple[Waveform, list[Placed]]:
    """Return the mean of hits, and where each hit lies on it.

    Parameters
    ----------
    hits : sequence of Hit
        At least `FEWEST_TRAINING`.

    Returns
    -------
    wave : Waveform
        Without modes.
    placed : list of Placed
        One a hit.
    """
    width = math.exp(float(np.mean([math.log(hit.width_s) for hit in hits])))
    step = 1.0 / max(hit.rate_hz for hit in hits)
    begin = min(hit.first_s for hit in hits)
    end = max(hit.first_s + (hit.signal.size - 1) / hit.rate_hz for hit in hits)
    nothing = np.zeros((1, round((end - begin) / step) + 1))
    wave = Waveform(begin, step, nothing, padded_spline(nothing), width)
    placed = [
        Placed(*wave.start(hit, 1.0), np.array([hit.size, hit.offset]), math.inf) for hit in hits
    ]
    wave, before = _mean(wave, hits, placed), math.inf
    for turn in range(MOST_ROUNDS):
        placed = [
            fit_hit(wave, hit, wave.starts(hit), 1)
            if turn == 0
            else fit_hit(wave, hit, [(one.place, one.pace)], 1, one.sizes)
            for hit, one in zip(hits, placed, strict=True)
        ]
        wave, squares = _mean(wave, hits, placed), sum(one.squares for one in placed)
        if before - squares < SETTLED * before:
            break
        before = squares
    return wave, placed


def _mean(wave: Waveform, hits: Sequence[Hit], placed: Sequence[Placed]) -> Waveform:
    """Return the mean that leaves the least squares of hits that are placed, on the same grid."""
    count = wave.shapes.shape[1]
    top, under = np.zeros(count), np.zeros(count)
    for hit, one in zip(hits, placed, strict=True):
        values, seen = _on_grid(hit, one, count)
        size, offset = float(one.sizes[0]), float(one.sizes[-1])
        top += seen * size * (values - offset)
        under += seen * size**2
    known = np.flatnonzero(under > 0.0)
    typical = math.sqrt(float(np.mean([one.sizes[0] ** 2 for one in placed])))
    mean = typical * np.interp(np.arange(count), known, top[known] / under[known])
    shapes = mean[None, :]
    return Waveform(wave.begin_s, wave.step_s, shapes, padded_spline(shapes), wave.width_s)


def _on_grid(hit: Hit, placed: Placed, count: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return a hit at the grid's points, and where it has samples."""
    first, pace = -placed.place / placed.pace, 1.0 / placed.pace
    at = first + pace * np.arange(count)
    return sampled(hit.spline, first, pace, count), (at >= 0) & (at <= hit.signal.size - 1)


def with_modes(
    wave: Waveform, hits: Sequence[Hit], placed: Sequence[Placed], modes: int
) -> Waveform:
    """Return a mean with the largest modes of what it leaves of its training hits.

    Parameters
    ----------
    wave : Waveform
        Without modes.
    hits, placed : sequence
        As `learned` has them.
    modes : int
        At most; n hits give n - `FEWEST_TRAINING`, so that a mode rests on more than one.

    Returns
    -------
    Waveform
        Mean and modes; of the training hits, a mode's sizes have an rms of 1.
    """
    modes = min(modes, len(hits) - FEWEST_TRAINING)
    if modes <= 0:
        return wave
    count = wave.shapes.shape[1]
    left = np.zeros((len(hits), count))
    for row, (hit, one) in enumerate(zip(hits, placed, strict=True)):
        values, seen = _on_grid(hit, one, count)
        left[row] = seen * (values - one.sizes[0] * wave.shapes[0] - one.sizes[-1])
    # rows are few and long: their products have the same modes
    _, directions = np.linalg.eigh(left @ left.T)
    found = directions[:, ::-1][:, :modes].T @ left / math.sqrt(len(hits))
    shapes = np.vstack([wave.shapes, found])
    return Waveform(wave.begin_s, wave.step_s, shapes, padded_spline(shapes), wave.width_s)
