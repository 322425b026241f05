r"""The mean waveform of the other hits: a prediction of a hit without any model.

.. math:: y(t) = a\, W(u) + \sum_k c_k V_k(u) + b, \qquad u = (t - \Delta) / s

W is a mean of hits and V_k are modes of variation, as cubic splines at full resolution; size a,
shift, stretch s, offset b and the c_k are each hit's own. Sample j of a hit lies at
``place + pace * j`` on the waveform's grid, which turns shift and stretch into two numbers that
enter linearly; beyond the grid's ends a waveform stays what it is there.

As a discrepancy it stands on top of a model, as the mean waveform of what that leaves, or in its
place, so that no discrepancy loses to a mean of other hits. All that it states then is of shots it
was not learned on: a mean of few hits follows these, noise included.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import spline_filter1d

from analysis.aliases import Array, Json
from analysis.diagnosis.discrepancy.fit import Learned
from analysis.diagnosis.progress import BudgetSpentError
from analysis.diagnosis.selection import Step
from analysis.fit.campaign_fit import heldout_fits, heldout_folds, refit_nuisances
from analysis.fit.joint import Fitted
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.window import Window

ON_TOP, IN_PLACE = "waveform", "mean_waveform"
"""Families of the discrepancy: of what the model leaves, or of the records themselves."""
SCOPE = "pair"
MOST_ROUNDS = 20
"""Times that hits are aligned to their mean, and the mean is taken anew. Measured: four sets of
recordings needed 3 to 6; means of three hits creep on, by 8 % of their error in ten rounds more."""
SETTLED = 0.01
"""Relative fall of the squares at which a mean has settled: 0.5 % of the error."""
HELDOUT_STEPS = 12
"""At most, until the squares stand still. Measured: 3 to 5 in nearly all hits, 11 in one of 250."""
FEWEST_TRAINING = 2
"""Hits that make a mean: one is no mean."""
SHARES = (1.0, 0.5, 0.25, 0.1)
"""Of a step, tried until one helps."""
AGREED = 1e-5
"""Relative fall of the squares at which a fit ends: an error is told to three digits."""
LARGEST_STRETCH = 0.2
"""Of one step. Chosen by trial: a wrong first slope may ask for a hit without length, and a step
that does not help is shortened anyway."""
RIDGE = 1e-13
"""On columns of length one: rounding, where two are alike."""

Start = tuple[float, float]
"""Place and pace."""


@dataclass(frozen=True)
class Hit:
    """One record, or what a model leaves of it, over its fit window."""

    signal: Array  # shape (n,). [unit of the signal]
    spline: Array  # its cubic spline, shape (n + 2,)
    first_s: float  # time of the first sample, counted from the rise of the pulse. [s]
    rate_hz: float  # sampling rate. [Hz]
    width_s: float  # of the pulse. [s]
    size: float  # first guess. [unit of the signal]
    offset: float  # first guess. [unit of the signal]

    @classmethod
    def of(cls, item: FitShot, residual: Array | None = None) -> Hit:
        """Return the record of a shot, or what a model leaves of it."""
        hit = cls.of_window(item.window, item.frame.sample_rate_hz)
        if residual is None:
            return hit
        spline = _padded_spline(residual)
        return dataclasses.replace(hit, signal=residual, spline=spline, size=1.0, offset=0.0)

    @classmethod
    def of_window(cls, window: Window, rate_hz: float) -> Hit:
        """Return the part of a record that is fitted; the rate is that of its samples. [Hz]"""
        return cls(
            window.signal,
            _padded_spline(window.signal),
            -window.rise_index / rate_hz,
            rate_hz,
            window.width_s,
            window.peak,
            window.baseline,
        )


@dataclass(frozen=True)
class Placed:
    """Where a hit lies on a waveform, and how large it is."""

    place: float  # of the first sample. [grid step]
    pace: float  # from sample to sample. [grid step]
    sizes: Array
    """Of the mean and the modes, 1 being typical [1], and the offset. [unit of the signal]"""
    squares: float  # what is left


@dataclass(frozen=True)
class Waveform:
    """A mean and its modes on a grid of times."""

    begin_s: float  # first point of the grid. [s]
    step_s: float  # spacing of the grid. [s]
    shapes: Array
    """Mean and modes as a typical training hit has them, (1 + modes, m). [unit of the signal]"""
    splines: Array  # their cubic splines, shape (1 + modes, m + 2)
    width_s: float  # geometric mean of the training pulses' widths. [s]

    def with_shapes(self, shapes: Array) -> Waveform:
        """Return other shapes on the same grid."""
        return dataclasses.replace(self, shapes=shapes, splines=_padded_spline(shapes))

    def start(self, hit: Hit, stretch: float) -> Start:
        """Return where a hit lies whose pulse rises where the waveform's does."""
        pace = 1.0 / (hit.rate_hz * self.step_s * stretch)
        return hit.first_s * hit.rate_hz * pace - self.begin_s / self.step_s, pace

    def starts(self, hit: Hit) -> list[Start]:
        """Return where a fit may begin: as long as the waveform, or as the pulse's width says."""
        return [self.start(hit, 1.0), self.start(hit, hit.width_s / self.width_s)]

    def stretch(self, hit: Hit, placed: Placed) -> float:
        """Return how many times longer than the waveform a hit is. [1]"""
        return 1.0 / (hit.rate_hz * self.step_s * placed.pace)

    def residual(self, hit: Hit, placed: Placed) -> Array:
        """Return what it leaves of a hit. Shape (n,). [unit of the signal]"""
        left = hit.signal - placed.sizes[-1]
        for size, spline in zip(placed.sizes, self.splines, strict=False):
            left -= size * _sampled(spline, placed.place, placed.pace, left.size)
        return np.asarray(left, dtype=np.float64)


@dataclass(frozen=True)
class Predicted:
    """A hit as predicted by a waveform that it had no part in."""

    sizes: Array  # as `Placed.sizes`
    stretch: float  # how many times longer it is than the mean. [1]
    residual: Array  # what is left, shape (n,). [unit of the signal]


@dataclass(frozen=True)
class Prediction:
    """All hits as predicted with so many modes of variation."""

    modes: int  # at most; a mean of few hits has fewer
    hits: list[Predicted]  # one a shot

    @property
    def heldout_rms(self) -> float:
        """Return the pooled error. [unit of the signal]"""
        squares = sum(float(one.residual @ one.residual) for one in self.hits)
        return math.sqrt(squares / sum(one.residual.size for one in self.hits))


@dataclass(frozen=True)
class MeanWaveform:
    """What the mean of other hits predicts, without and with modes of variation."""

    predictions: list[Prediction]
    """By the number of modes, from none on; empty where no mean can be had."""
    shots: int  # how many were predicted
    reason: str | None = None  # why no mean can be had

    @property
    def heldout_rms(self) -> float | None:
        """Return the error of the plain mean on held-out shots. [unit of the signal]"""
        return self.predictions[0].heldout_rms if self.predictions else None

    def to_json(self) -> Json:
        """Return the error of the plain mean, as a diagnosis states it."""
        return {"heldout_rms_V": self.heldout_rms, "shots": self.shots, "reason": self.reason}


def mean_waveform(problem: JointProblem, most_modes: int = 0) -> MeanWaveform:
    """Return how well the mean of other hits predicts each hit, with modes of variation as well.

    Over the same samples and folds as a fit's ``heldout_rms``, of the problem's windows, nothing of
    its model. A held-out hit's size, shift, stretch, offset and modes are fitted to it, as its
    speed and touch-down are in a model.
    """
    hits = [Hit.of(item) for item in problem.shots]
    folds = ((fold, hits) for fold in heldout_folds(problem))
    found = _predictions(problem, folds, most_modes)
    if found:
        return MeanWaveform(found, len(hits))
    return MeanWaveform(
        [],
        0,
        f"{len(hits)} {'shot leaves' if len(hits) == 1 else 'shots leave'} no mean of at least "
        f"{FEWEST_TRAINING} others of the same quantity where some are held out",
    )


def waveform_discrepancy(step: Step, mean: MeanWaveform) -> Learned | None:
    """Return the waveform that repairs held-out shots best, as a discrepancy of a model.

    None where no mean of its shots can be had.
    """
    if not mean.predictions:
        return None
    found = [(IN_PLACE, one) for one in mean.predictions]
    try:
        left = _folds_of_residuals(step.problem, step.fitted)
        on_top = _predictions(step.problem, left, len(mean.predictions) - 1)
        found += [(ON_TOP, one) for one in on_top]
    except (np.linalg.LinAlgError, BudgetSpentError):
        pass  # a fold leaves the model without a solution, or the time is over
    known = [one for one in found if math.isfinite(one[1].heldout_rms)]
    family, best = min(known, key=lambda one: one[1].heldout_rms)
    residual = [one.residual for one in best.hits]
    shots = list(zip(step.problem.shots, residual, strict=True))
    return Learned(
        parts=((family, SCOPE),),
        problem=step.problem,
        fitted=step.fitted,
        coefficients={},
        by_shot=_numbers(best),
        added=[s.residual - r for s, r in zip(step.linearised.shots, residual, strict=True)],
        residual=residual,
        chi2=sum(float(np.sum(np.square(item.whiten(left)))) for item, left in shots),
        rms=best.heldout_rms,
        heldout_rms=best.heldout_rms,
    )


def _numbers(found: Prediction) -> dict[str, Array]:
    """Return what every shot has for itself, a mode of 0 where few hits allow none."""
    sizes = {"size": 0} | {f"mode {k}": k for k in range(1, found.modes + 1)}
    numbers = {
        label: np.array([one.sizes[k] if k < one.sizes.size - 1 else 0.0 for one in found.hits])
        for label, k in sizes.items()
    }
    return numbers | {"stretch": np.array([one.stretch for one in found.hits])}


_Fold = tuple[Sequence[int], Sequence[Hit]]
"""Hits to hold out together, and all hits as the others know them."""


def _folds_of_residuals(problem: JointProblem, fitted: Fitted) -> Iterator[_Fold]:
    """Yield each fold and what the model that the others fit leaves of every shot."""
    for fold, others in heldout_fits(problem, fitted):
        rows, hits = iter(others.nuisances), []
        for i, item in enumerate(problem.shots):
            nuisance = fitted.nuisances[i] if i in fold else next(rows)
            hits.append(Hit.of(item, refit_nuisances(problem, i, others.theta, nuisance)))
        yield fold, hits


def _predictions(
    problem: JointProblem, folds: Iterable[_Fold], most_modes: int
) -> list[Prediction]:
    """Return every hit as predicted by the waveforms of the hits outside its fold.

    By the number of modes. The others are those of the same sphere and surface; where a fold
    leaves fewer than `FEWEST_TRAINING` of these, all of the same quantity; where it leaves fewer of
    these too, the list is empty.
    """
    keys = [(item.shot.quantity, item.pair) for item in problem.shots]
    found: list[dict[int, Predicted]] = [{} for _ in range(most_modes + 1)]
    for fold, hits in folds:
        kept = [i for i in range(len(keys)) if i not in fold]
        for key in dict.fromkeys(keys[i] for i in fold):
            own = [i for i in kept if keys[i] == key]
            if len(own) < FEWEST_TRAINING:
                own = [i for i in kept if keys[i][0] == key[0]]
            if len(own) < FEWEST_TRAINING:
                return []
            training = [hits[i] for i in own]
            mean, placed = aligned_mean(training)
            for modes, one in enumerate(found):
                wave = _with_modes(mean, training, placed, modes)
                one |= {i: _predicted(wave, hits[i]) for i in fold if keys[i] == key}
    if not found[0]:
        return []
    return [Prediction(m, [one[i] for i in range(len(keys))]) for m, one in enumerate(found)]


def _predicted(wave: Waveform, hit: Hit) -> Predicted:
    placed = fit_hit(wave, hit, wave.starts(hit), HELDOUT_STEPS)
    return Predicted(placed.sizes, wave.stretch(hit, placed), wave.residual(hit, placed))


def aligned_mean(hits: Sequence[Hit]) -> tuple[Waveform, list[Placed]]:
    """Return the mean of at least `FEWEST_TRAINING` hits, and where each hit lies on it."""
    width = math.exp(float(np.mean([math.log(hit.width_s) for hit in hits])))
    step = 1.0 / max(hit.rate_hz for hit in hits)
    begin = min(hit.first_s for hit in hits)
    end = max(hit.first_s + (hit.signal.size - 1) / hit.rate_hz for hit in hits)
    nothing = np.zeros((1, round((end - begin) / step) + 1))
    wave = Waveform(begin, step, nothing, _padded_spline(nothing), width)
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
    return wave.with_shapes(mean[None, :])


def _on_grid(hit: Hit, placed: Placed, count: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return a hit at the grid's points, and where it has samples."""
    first, pace = -placed.place / placed.pace, 1.0 / placed.pace
    at = first + pace * np.arange(count)
    return _sampled(hit.spline, first, pace, count), (at >= 0) & (at <= hit.signal.size - 1)


def _with_modes(
    wave: Waveform, hits: Sequence[Hit], placed: Sequence[Placed], modes: int
) -> Waveform:
    """Return a mean with the largest modes of what it leaves of its training hits.

    Of n hits at most n - `FEWEST_TRAINING`, so that a mode rests on more than one; a mode's sizes
    have an rms of 1 over the training hits.
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
    return wave.with_shapes(np.vstack([wave.shapes, found]))


def fit_hit(
    wave: Waveform, hit: Hit, starts: Sequence[Start], most: int, sizes: Array | None = None
) -> Placed:
    """Return a waveform fitted to a hit by least squares, never worse than the best start.

    In so many steps of Gauss and Newton at most; ``sizes`` are about what will be found, where that
    is known.
    """
    guess = np.zeros(len(wave.splines)) if sizes is None else sizes
    found = [_at(wave, hit, start, guess) for start in dict.fromkeys(starts)]
    best, products = min(found, key=lambda one: one[0].squares)
    if sizes is None:  # slopes are those of sizes
        best, products = _at(wave, hit, (best.place, best.pace), best.sizes)
    for _ in range(most):
        later, longer = _solved(products, len(products) - 1)[-2:]
        longer = float(np.clip(longer, -LARGEST_STRETCH * best.pace, LARGEST_STRETCH * best.pace))
        for share in SHARES:
            start = best.place + share * float(later), best.pace + share * longer
            there, ahead = _at(wave, hit, start, best.sizes)
            if there.squares < best.squares:
                break
        else:
            break
        small = best.squares - there.squares < AGREED * best.squares
        best, products = there, ahead
        if small:
            break
    return best


def _at(wave: Waveform, hit: Hit, start: Start, sizes: Array) -> tuple[Placed, Array]:
    """Return the best sizes at a place, and all products with slopes of these sizes."""
    products = _products(wave.splines, sizes, hit.signal, *start)
    linear = len(wave.splines) + 1
    found = _solved(products, linear)
    squares = products[-1, -1] - float(found @ products[:linear, -1])
    return Placed(*start, found, max(squares, 0.0)), products


def _padded_spline(values: Array) -> Array:
    """Return cubic spline coefficients along the last axis, mirrored by one at either end."""
    found = np.asarray(spline_filter1d(values, order=3), dtype=np.float64)
    width = [(0, 0)] * (values.ndim - 1) + [(1, 1)]
    return np.pad(found, width, mode="reflect")


@njit(cache=True, nogil=True)
def _weights(t: float) -> tuple[float, float, float, float]:
    """Return what four neighbouring coefficients of a cubic spline count at a share of a step."""
    r = 1.0 - t
    return (
        r * r * r / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0,
        t * t * t / 6.0,
    )


@njit(cache=True, nogil=True)
def _sampled(spline: Array, place: float, pace: float, count: int) -> Array:
    """Return a spline at evenly spaced places, those beyond its ends at these. Shape (count,)."""
    last = spline.size - 3.0
    found = np.empty(count)
    for j in range(count):
        at = min(max(place + pace * j, 0.0), last)
        i = min(int(at), spline.size - 4)
        w0, w1, w2, w3 = _weights(at - i)
        found[j] = w0 * spline[i] + w1 * spline[i + 1] + w2 * spline[i + 2] + w3 * spline[i + 3]
    return found


@njit(cache=True, nogil=True)
def _products(splines: Array, sizes: Array, signal: Array, place: float, pace: float) -> Array:
    """Return the products of all columns: shapes, one, slope, slope times j, and the signal."""
    shapes, last = splines.shape[0], splines.shape[1] - 3.0
    found = np.zeros((shapes + 4, shapes + 4))
    column = np.ones(shapes + 4)
    for j in range(signal.size):
        raw = place + pace * j
        at = min(max(raw, 0.0), last)
        i = min(int(at), splines.shape[1] - 4)
        t = at - i
        r = 1.0 - t
        w0, w1, w2, w3 = _weights(t)
        slope = 0.0
        for k in range(shapes):
            a, b, c, d = splines[k, i], splines[k, i + 1], splines[k, i + 2], splines[k, i + 3]
            column[k] = w0 * a + w1 * b + w2 * c + w3 * d
            if raw == at:
                turn = -r * r * a + (3.0 * t * t - 4.0 * t) * b - (3.0 * r * r - 4.0 * r) * c
                slope += 0.5 * sizes[k] * (turn + t * t * d)
        column[shapes + 1], column[shapes + 2], column[shapes + 3] = slope, slope * j, signal[j]
        for k in range(shapes + 4):
            for other in range(k + 1):
                found[k, other] += column[k] * column[other]
    for k in range(shapes + 4):
        for other in range(k):
            found[other, k] = found[k, other]
    return found


@njit(cache=True, nogil=True)
def _solved(products: Array, count: int) -> Array:
    """Return the least-squares sizes of so many columns, fitted to the last. Shape (count,)."""
    scale = np.ones(count)
    for k in range(count):
        if products[k, k] > 0.0:
            scale[k] = math.sqrt(products[k, k])
    matrix, load = np.empty((count, count)), np.empty(count)
    for k in range(count):
        load[k] = products[k, -1] / scale[k]
        for other in range(count):
            matrix[k, other] = products[k, other] / (scale[k] * scale[other])
        matrix[k, k] += RIDGE
    return np.linalg.solve(matrix, load) / scale
