r"""A comparison of a shot with its repetitions, right after a drop and without a fit.

A shot is laid on the mean waveform of earlier shots of the same sphere, surface and height
(`discrepancy.mean_waveform`). Three numbers are compared: its size, its duration, and what the mean
leaves of it, its shape. How far the repetitions of all conditions scatter about their own means
says what is usual:

.. math:: t = \frac{x - \bar x}{\sqrt{(1 + 1/n)\, s^2 + u^2}}

of n repetitions, with Student's t for the few that s rests on; u is what noise leaves of x. A shot
that is unlike its repetitions is held against other labels, another height and another gain. It is
said to be like those as which it would not have been unlike.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp
from scipy.stats import t as student

from analysis.aliases import Array
from analysis.campaign import Shot
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.mean_waveform import (
    HELDOUT_STEPS,
    Hit,
    Placed,
    Waveform,
    aligned_mean,
    fit_hit,
)
from analysis.fit.window import cut, quiet_part

Condition = tuple[str | None, str | None, float | None]
"""Sphere, surface and drop height: what repetitions have in common."""

FEWEST = 2
"""Repetitions that make a mean and a scatter."""
STATED_COUNTS = 2
"""Deviations that a stated repeatability of the speed counts as. A choice: two shots tell next to
nothing of their scatter, and a repeatability stated too small by a few times is soon outvoted."""
POWERS = np.array([0.6, -0.1, 0.0])
"""Of the drop height, in size, duration and shape: v^(6/5) and v^(-1/5) of an elastic contact, and
the speed goes with the root of the height."""
POWERS_WITHIN = np.array([0.06, 0.1, 0.1])
"""By which these powers are wrong, and of ring and loss of the cell, which do not keep pace with
the pulse, the rms over the peak for a height e times another. Measured on the simulated rig."""
FURTHEST = 1.5
"""Largest |ln| of a height over the stated one, and of a gain, that is thought of: e^1.5 = 4.5."""
HEIGHTS = 1001
"""Heights that are tried up to there: steps of 0.3 %."""
TINY = 1e-6
"""Least size that has a logarithm: what swings the other way is no repetition."""
QUIET = 20_000
"""Samples before the pulse, at most, that the noise is taken from: its rms within 1 %."""
SIZE, DURATION, SHAPE = range(3)
CONDITIONS_KEPT = 64
"""Of which mean and scatter are kept, some 100 kB each."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A shot as it is compared."""

    name: str
    condition: Condition
    quantity: str
    hit: Hit
    peak: float  # [unit of the signal]
    noise_rms: float  # [unit of the signal]
    memory: float
    """Samples of the noise that tell as much as one would, were it white. [1]"""

    @classmethod
    def of(cls, shot: Shot) -> Recorded:
        """Return a shot as it is compared; raise ShotRejectedError where it holds no pulse."""
        window = cut(shot)
        quiet = quiet_part(shot)[-QUIET:]
        rms, memory = _noise(quiet)
        return cls(
            name=shot.name,
            condition=(shot.sphere, shot.surface, shot.drop_height_m),
            quantity=shot.quantity,
            hit=Hit.of_window(window, shot.sample_rate_hz),
            peak=window.peak,
            noise_rms=rms,
            memory=memory,
        )


@dataclass(frozen=True)
class Likely:
    """What a shot may be in truth, in words and as `SetAside.likely` of a diagnosis has it."""

    words: str
    like: dict[str, str | float]


@dataclass(frozen=True)
class Comparison:
    """A shot compared with its repetitions."""

    repetitions: tuple[str, ...]
    """Names of those it was compared with."""
    unlike: bool
    size: float  # over that of its repetitions. [1]
    duration: float  # the same. [1]
    shape: float
    """Rms of what their mean leaves of it beyond noise, over its peak. [1]"""
    likely: tuple[Likely, ...] = ()
    """The likeliest first; empty where it is like its repetitions, or nothing explains it."""

    @property
    def sentence(self) -> str:
        """Return what is to be said of the shot, without its name; empty for nothing."""
        if not self.unlike:
            return ""
        like = ", or ".join(one.words for one in self.likely) or (
            f"it is {self.size:.3g} of their size and {self.duration:.3g} of their duration, with "
            f"{100 * self.shape:.2g} % of its peak of another shape; no other label, height or "
            "gain explains it"
        )
        count = len(self.repetitions)
        return f"it is unlike its {count} repetitions. {like[0].upper()}{like[1:]}."


def compare(
    shot: Recorded, earlier: Sequence[Recorded], *, speed_repeatability: float | None = None
) -> Comparison | None:
    """Return the comparison of a shot; None where it has fewer repetitions than `FEWEST`.

    Parameters
    ----------
    shot : Recorded
        The new one.
    earlier : sequence of Recorded
        Shots of the same session in any order, of its condition and of others.
    speed_repeatability : float, optional
        Stated relative standard deviation of the impact speed. [1]

    Returns
    -------
    Comparison or None
        The chance of calling a good shot unlike is `Structure.false_alarm_rate`.
    """
    groups: dict[Condition, list[Recorded]] = {}
    for one in earlier:
        if (one.quantity, one.hit.rate_hz) == (shot.quantity, shot.hit.rate_hz):
            groups.setdefault(one.condition, []).append(one)
    if len(groups.get(shot.condition, ())) < FEWEST:
        return None
    known = [_repeated(tuple(group)) for group in groups.values() if len(group) >= FEWEST]
    own = next(one for one in known if one.condition == shot.condition)
    scatter = _Scatter.of(known, speed_repeatability)
    beside = _Beside.of(shot, own, scatter)
    seen = beside.seen()
    return Comparison(
        repetitions=own.names,
        unlike=seen.unlike,
        size=math.exp(seen.away[SIZE]),
        duration=math.exp(seen.away[DURATION]),
        shape=float(seen.away[SHAPE]),
        likely=tuple(_Look(shot, beside, known, scatter).explanations()) if seen.unlike else (),
    )


def _noise(quiet: Array) -> tuple[float, float]:
    """Return the rms of noise, and how many of its samples count as one."""
    if quiet.size < CRITERIA.least_quiet_samples:
        return 0.0, 1.0
    away = quiet - quiet.mean()
    squares = float(away @ away)
    if not squares > 0.0:
        return 0.0, 1.0
    neighbours = float(np.clip(away[1:] @ away[:-1] / squares, 0.0, 0.98))
    return math.sqrt(squares / quiet.size), (1.0 + neighbours) / (1.0 - neighbours)


# -- three numbers of a shot -----------------------------------------------------------------------
@dataclass(frozen=True)
class _Numbers:
    """Size, duration and shape of a shot on a waveform, and their variances by noise alone."""

    values: Array  # ln size and ln duration, and rms of another shape over the peak, (3,). [1]
    noise: Array  # (3,)

    def certain(self) -> Array:
        """Return the values with no more of another shape than noise cannot have made. (3,)"""
        most = CRITERIA.excess_deviations * self.noise[SHAPE]
        values = self.values.copy()
        values[SHAPE] = math.sqrt(max(values[SHAPE] ** 2 - most, 0.0))
        return values


def _numbers(wave: Waveform, shot: Recorded, placed: Placed, spared: float) -> _Numbers:
    """Return the numbers of a shot; ``spared`` is the noise left of it and of the mean. [1]"""
    left = wave.residual(shot.hit, placed)
    noise = shot.noise_rms**2
    # what squares of noise scatter by, were they twice as far out as they usually are
    chance = noise * math.sqrt(2.0 * shot.memory / left.size)
    excess = float(left @ left) / left.size - spared * noise
    values = np.array(
        [
            math.log(max(float(placed.sizes[0]), TINY)),
            math.log(wave.stretch(shot.hit, placed)),
            math.sqrt(max(excess, 0.0)) / shot.peak,
        ]
    )
    u_size, u_duration = _deviations(wave, shot, placed)
    return _Numbers(values, np.array([u_size**2, u_duration**2, chance / shot.peak**2]))


def _deviations(wave: Waveform, shot: Recorded, placed: Placed) -> tuple[float, float]:
    """Return what noise moves ln size and ln duration by, to first order."""
    before = wave.residual(shot.hit, placed)
    step = 1e-4
    moves = (
        dataclasses.replace(placed, sizes=placed.sizes * np.array([1.0 + step, 1.0])),
        dataclasses.replace(placed, pace=placed.pace * (1.0 + step)),
        dataclasses.replace(placed, place=placed.place + step),
    )
    columns = [(wave.residual(shot.hit, one) - before) / step for one in moves]
    matrix = np.column_stack([*columns, np.ones(before.size)])
    matrix /= np.linalg.norm(matrix, axis=0)
    lengths = [float(np.linalg.norm(column)) for column in columns[:2]]
    spread = np.sqrt(np.diag(np.linalg.pinv(matrix.T @ matrix))[:2])
    found = shot.noise_rms * math.sqrt(shot.memory) * spread / np.array(lengths)
    return float(found[0]), float(found[1])


@dataclass(frozen=True)
class _Repeated:
    """Shots of one condition: their mean waveform, and how they lie about it."""

    condition: Condition
    names: tuple[str, ...]
    wave: Waveform
    middle: Array  # mean of their numbers, (3,)
    squares: Array  # of their numbers about it, summed, (3,)
    noise: Array  # mean of their variances by noise, (3,)

    @property
    def count(self) -> int:
        """Return how many they are."""
        return len(self.names)

    @classmethod
    def of(cls, shots: Sequence[Recorded]) -> _Repeated:
        """Return at least `FEWEST` shots of one condition."""
        count = len(shots)
        wave, placed = aligned_mean([one.hit for one in shots])
        # the mean takes one n-th of each shot's noise with it
        spared = 1.0 - 1.0 / count
        found = [_numbers(wave, *one, spared) for one in zip(shots, placed, strict=True)]
        values = np.array([one.values for one in found])
        middle = values.mean(axis=0)
        middle[SHAPE] = 0.0  # a mean has no other shape than its own
        return cls(
            shots[0].condition,
            tuple(one.name for one in shots),
            wave,
            middle,
            np.sum((values - middle) ** 2, axis=0),
            np.mean([one.noise for one in found], axis=0),
        )


@lru_cache(CONDITIONS_KEPT)
def _repeated(shots: tuple[Recorded, ...]) -> _Repeated:
    """Return what was made of the same shots before: of a session one condition grows at a time."""
    return _Repeated.of(shots)


@dataclass(frozen=True)
class _Scatter:
    """How shots of one condition scatter about their mean."""

    variance: Array  # of size, duration and shape, (3,)
    degrees: Array  # of freedom, (3,)

    @classmethod
    def of(cls, known: Sequence[_Repeated], speed_repeatability: float | None) -> _Scatter:
        """Return the mean of all repetitions, and their stated speed."""
        degrees = np.full(3, float(sum(one.count - 1 for one in known)))
        squares = np.sum([one.squares for one in known], axis=0)
        if speed_repeatability:
            # the height goes with the square of the speed
            squares[SIZE] += STATED_COUNTS * (2.0 * POWERS[SIZE] * speed_repeatability) ** 2
            degrees[SIZE] += STATED_COUNTS
        return cls(squares / degrees, degrees)

    def at(self, there: _Repeated) -> _Scatter:
        """Return the same with the durations of one condition alone.

        A long pulse is longer at a lower speed; of a short one the mean holds the ring of the cell
        above all, which keeps its period.
        """
        variance, degrees = self.variance.copy(), self.degrees.copy()
        degrees[DURATION] = there.count - 1
        variance[DURATION] = there.squares[DURATION] / degrees[DURATION]
        return _Scatter(variance, degrees)


@dataclass(frozen=True)
class _Seen:
    """A shot compared with its expectation."""

    away: Array  # of its numbers from the expected ones, (3,)
    t: Array  # the same over what is usual, (3,)
    variance: Array  # what is usual, squared, (3,)
    degrees: Array  # of freedom, (3,)

    @property
    def unlike(self) -> bool:
        """Whether any of its numbers is farther off than chance goes."""
        chance = 2.0 * np.asarray(student.sf(np.abs(self.t), self.degrees))
        return bool(chance.min() * chance.size < CRITERIA.false_alarm_rate)

    @property
    def squares(self) -> float:
        """Twice its negative log-likelihood, by Student's t, for comparison.

        What leaves more room for a shot is the less likely for it.
        """
        tail = (self.degrees + 1.0) * np.log1p(self.t**2 / self.degrees)
        return float(np.sum(tail + np.log(self.variance)))

    def with_any_size(self) -> _Seen:
        """Return the same where no size is likelier than another within e^`FURTHEST` of theirs."""
        t, variance = self.t.copy(), self.variance.copy()
        t[SIZE] = 0.0
        variance[SIZE] = (2.0 * FURTHEST * float(student.pdf(0.0, self.degrees[SIZE]))) ** 2
        return dataclasses.replace(self, t=t, variance=variance)


@dataclass(frozen=True)
class _Beside:
    """A shot on the mean waveform of one condition."""

    numbers: _Numbers
    there: _Repeated
    scatter: _Scatter

    @classmethod
    def of(cls, shot: Recorded, there: _Repeated, scatter: _Scatter) -> _Beside:
        """Lay a shot on a mean waveform that it had no part in."""
        wave, hit = there.wave, shot.hit
        # from each by itself: a width is told in samples, and a descent from a wrong one ends early
        ends = (fit_hit(wave, hit, [start], HELDOUT_STEPS) for start in wave.starts(hit))
        placed = min(ends, key=lambda one: one.squares)
        numbers = _numbers(wave, shot, placed, 1.0 + 1.0 / there.count)
        return cls(numbers, there, scatter.at(there))

    def from_height(self, steps: float) -> _Seen:
        """Return how far off a shot is that fell from e^steps times the height of the others."""
        return self.seen(POWERS * steps, POWERS_WITHIN * steps)

    def seen(self, shift: float | Array = 0.0, within: float | Array = 0.0) -> _Seen:
        """Return how far off a shot is whose numbers are moved so far, give or take (both (3,))."""
        away = self.numbers.certain() - self.there.middle - shift
        count = self.there.count
        variance = (1.0 + 1.0 / count) * self.scatter.variance + np.square(within)
        variance += self.numbers.noise + self.there.noise / count
        return _Seen(away, away / np.sqrt(variance), variance, self.scatter.degrees)


# -- what a shot is like ---------------------------------------------------------------------------
class _Tried(NamedTuple):
    """An explanation of an odd shot."""

    squares: float  # twice its negative log-likelihood. [1]
    seen: _Seen
    likely: Likely


@dataclass(frozen=True)
class _Look:
    """An odd shot, its repetitions, and all conditions of the session."""

    shot: Recorded
    beside: _Beside
    known: Sequence[_Repeated]
    scatter: _Scatter

    def explanations(self) -> list[Likely]:
        """Return as what it would not be unlike, the likeliest first."""
        tried = [*self._labels(), *self._height(), self._gain()]
        fit = sorted((one for one in tried if not one.seen.unlike), key=lambda one: one.squares)
        return [one.likely for one in fit if one.squares <= fit[0].squares + CRITERIA.least_lead]

    def _labels(self) -> Iterator[_Tried]:
        """Take the condition of each other pair whose height is nearest to the stated one."""
        *pair, height = self.shot.condition
        by_pair: dict[tuple[str | None, str | None], list[_Repeated]] = {}
        for one in self.known:
            if list(one.condition[:2]) != pair and abs(_steps(height, one)) < FURTHEST:
                by_pair.setdefault(one.condition[:2], []).append(one)
        for other, conditions in by_pair.items():
            near = min(conditions, key=lambda one: abs(_steps(height, one)))
            named = zip(("sphere", "surface"), other, pair, strict=True)
            like: dict[str, str | float] = {
                key: name for key, name, own in named if name is not None and name != own
            }
            words = f"it is like {_pair_words(*other)}, not {_pair_words(*pair)}: look at the label"
            seen = _Beside.of(self.shot, near, self.scatter).from_height(_steps(height, near))
            yield _Tried(seen.squares, seen, Likely(words, like))

    def _height(self) -> Iterator[_Tried]:
        """Take the height at which it is least off, from whichever condition of the pair.

        A label is one guess. A height is one of many, so it is as likely as they are on average.
        """
        *pair, stated = self.shot.condition
        if stated is None:
            return
        steps = np.linspace(-FURTHEST, FURTHEST, HEIGHTS)
        found: list[tuple[float, _Seen, float]] = []
        for one in self.known:
            if list(one.condition[:2]) == pair:
                beside = self.beside
                if one is not beside.there:
                    beside = _Beside.of(self.shot, one, self.scatter)
                seen = [beside.from_height(float(step)) for step in steps]
                squares = np.array([one.squares for one in seen])
                best = int(squares.argmin())
                average = -2.0 * float(logsumexp(-0.5 * squares) - math.log(HEIGHTS))
                found.append((average, seen[best], float(steps[best]) - _steps(stated, one)))
        average, least_off, step = min(found, key=lambda one: one[0])
        height = stated * math.exp(step)
        words = f"it fell from about {1e3 * height:.3g} mm, not {1e3 * stated:.3g} mm"
        yield _Tried(average, least_off, Likely(words, {"drop_height_m": height}))

    def _gain(self) -> _Tried:
        as_stated = self.beside.seen()
        factor, seen = math.exp(as_stated.away[SIZE]), as_stated.with_any_size()
        words = f"its signal is {factor:.3g} of theirs: another gain, or an off-centre hit"
        return _Tried(seen.squares, seen, Likely(words, {"gain": factor}))


def _steps(height_m: float | None, one: _Repeated) -> float:
    """Return ln of a height over that of a condition; none without heights, else infinite."""
    there = one.condition[2]
    if height_m is None or there is None:
        return 0.0 if height_m is there else math.inf
    return math.log(height_m / there)


def _pair_words(sphere: str | None, surface: str | None) -> str:
    return f"{sphere or 'an unknown sphere'} on {surface or 'an unknown surface'}"
