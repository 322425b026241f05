r"""Effects that the records show without a model of contact and mounting.

Where no model of the impact comes near, as on a rig built otherwise, a fit names nothing. Four
things show without one:

Clipping. The top of a pulse is a parabola, of which the part within a share e of its height is
:math:`\sqrt{e}` wide. A top that is cut is as wide at every e, and of the same height in hits
that differ in everything else.

High-pass. The coupler's output y obeys :math:`\dot x = \dot y + y/\tau`, and the input x is at rest
after the contact: so the impulse :math:`Y = \int y\,dt` dies away as :math:`e^{-t/\tau}`, to
nothing. Without a high-pass Y stays what it is, and an offset of the baseline adds the same
straight line to either.

Hum. The mean waveform of all hits, of free size, shift, stretch and offset, holds what an impact
causes. Hum has another phase in every record and is left over; of all frequencies a multiple of
none but the mains' own explains most.

Low-pass. What cuts the band cuts the noise with it (`roll_off`), a digital one down to nothing at
half the sampling rate. Noise may have the colour of an analogue one of itself; so this is asked
only where the mean waveform of all hits leaves less of them than the model. A model that follows
the records better shows a low-pass itself.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import eval_legendre as legendre

from analysis.aliases import Array
from analysis.diagnosis.candidate import KNOWN_BEFORE, Refit, extended, refitted
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.mean_waveform import Hit, aligned_mean
from analysis.diagnosis.roll_off import HIGHEST, roll_off
from analysis.effects.effect import Effect
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.settle import settle
from analysis.fit.shot_fit import collect
from analysis.fit.window import MAX_SAMPLES, quiet_part, rail
from analysis.parameters import of_effect

NARROW, WIDER = 0.005, 20.0
"""Share of a pulse's height within which its top is, at least, and how many times more tells what
is about it."""
TOP_DEVIATIONS = 6.0
"""Of the noise, that a top holds: from the highest sample of a flat one to the lowest."""
DEEPEST = 0.5
"""Share of a pulse's height within which there is but one top."""
FEWEST_HITS = 3
"""That must agree: of two, chance is not told from a law."""
CONTACT_ENDS = 0.02
"""Share of the height at which a pulse is over."""
MOST_POINTS = 500
"""Of an impulse's course: it is smooth."""
SMOOTH_ORDER = 4
"""Of a polynomial beside the decay: it turns three times at most, and what rings turns in each of
its periods. Chosen by trial on shocks with a mounting that rings."""
FEW, STEPS = 12, 25
"""Shots, and steps of a fit, in which an effect whose number is known comes to rest. A choice of
time: 99 shots took 50 s for each of four fits, and a number that is held does not wait for it."""
HELD = 1e-5
"""Share by which a number may move from what the records say of it: a model that is far from them
has millions of squares to win."""
MAINS_HZ = (50.0, 60.0)
HUM_HZ = np.concatenate([np.arange(20.0, 100.0, 2.5), np.geomspace(100.0, 1000.0, 30)])
"""Frequencies that are held against the mains'. [Hz]"""


@dataclass(frozen=True)
class Shown:
    """An effect that records show without a model."""

    effect_id: str
    form: str  # id of the effect's form
    values: dict[str, float]  # its numbers, as the records say; empty for a free signal
    sentence: str  # what was seen
    in_noise: bool = False  # whether it was seen there, where no model of an impact has a part
    measured: bool = True  # whether the records say its numbers; else it is where it changes least

    def on_top_of(self, problem: JointProblem, fitted: joint.Fitted, usual: joint.Fitted) -> Refit:
        """Return a model with this effect, held at what the records say of it.

        Where the model is far from the records, the best fit would bend the effect after them. It
        begins from the fit without the effect and from the usual place; which begin and which form
        is asked of a few shots that stand for all.
        """
        rows = np.unique(np.linspace(0, len(problem.shots) - 1, FEW).astype(int))
        few = problem.with_shots(rows)
        tries = [
            (self._held(few, _of_rows(fitted, rows), form, _of_rows(begin, rows), known), form, at)
            for form in self._forms
            for at, (begin, known) in enumerate(((fitted, ()), (usual, KNOWN_BEFORE)))
        ]
        best, form, at = min(tries, key=lambda one: one[0].fitted.cost)
        begin = (fitted, usual)[at]
        near = dataclasses.replace(begin, theta=best.fitted.theta[: begin.theta.size])
        return self._held(problem, fitted, form, near, ((), KNOWN_BEFORE)[at])

    def freed(self, held: Refit, problem: JointProblem, fitted: joint.Fitted) -> Refit:
        """Return that model with nothing held, fitted on from there."""
        larger, _, _ = extended(problem, fitted, held.effect, self._starts(held.effect))
        result = joint.fit(larger, held.fitted.nuisances, theta=held.fitted.theta)
        return refitted(dataclasses.replace(held, problem=larger, fitted=result), problem, fitted)

    def _held(
        self,
        problem: JointProblem,
        fitted: joint.Fitted,
        effect: Effect,
        begin: joint.Fitted,
        known: tuple[str, ...],
    ) -> Refit:
        starts = self._starts(effect)
        larger, theta, nuisances = extended(problem, begin, effect, starts)
        for name, coordinate in starts.items():
            at = larger.names.index(name)
            larger.prior_mean[at] = coordinate
            larger.prior_precision[at, at] = (HELD * coordinate) ** -2
        nuisances = settle(larger, theta, nuisances, kept=known)
        result = joint.fit(larger, nuisances, theta=theta, max_iterations=STEPS)
        bare = Refit(effect, self.effect_id, "rig", larger, result, 0.0, 0, False, 0.0)
        return refitted(bare, problem, fitted)

    @property
    def _forms(self) -> list[Effect]:
        """Return the form that was seen and those that the same numbers describe."""
        seen = effect_named(self.form)
        if self.in_noise or not self.values:
            return [seen]
        every = (seen, *effect_named(self.effect_id).variants)
        return [one for one in every if {p.name for p in one.parameters} == set(self.values)]

    def _starts(self, effect: Effect) -> dict[str, float]:
        return {
            of_effect(effect.id, one.name): one.coordinate(self.values[one.name])
            for one in effect.parameters
        }


def _of_rows(fitted: joint.Fitted, rows: NDArray[np.int_]) -> joint.Fitted:
    """Return what a fit says of some of its shots."""
    blocks = [] if fitted.failed else [fitted.blocks[row] for row in rows]
    cost = sum(block.cost for block in blocks) if blocks else math.inf
    nuisances = fitted.nuisances[rows]
    return dataclasses.replace(fitted, nuisances=nuisances, blocks=blocks, cost=cost)


def shown_by_records(shots: Sequence[FitShot], left_by_model: float = 0.0) -> list[Shown]:
    """Return the effects that records of one quantity show by themselves.

    ``left_by_model`` is the rms that the model at hand leaves of them. [unit of the signal]
    """
    if len({item.shot.quantity for item in shots}) != 1 or len(shots) < FEWEST_HITS:
        return []
    found = [_clipping(shots), _highpass(shots), _hum(shots)]
    lowpass = _lowpass(shots)
    if lowpass is not None and _left_by_mean(shots) < left_by_model:
        found.append(lowpass)
    return [one for one in found if one is not None]


def left_by_model(problem: JointProblem, fitted: joint.Fitted) -> float:
    """Return the rms that a fitted model leaves of all fit windows. [unit of the signal]"""
    return _rms([one.residual for one in collect(problem, fitted, scale=1.0)])


def _left_by_mean(shots: Sequence[FitShot]) -> float:
    return _rms(_beside_mean([Hit.of(item) for item in shots]))


def _rms(residuals: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate(residuals)))))


def _lowpass(shots: Sequence[FitShot]) -> Shown | None:
    found = roll_off([item.shot for item in shots])
    if found is None:
        return None
    cutoff_hz = found.cutoff_hz
    measured = cutoff_hz is not None
    if cutoff_hz is None:
        cutoff_hz = HIGHEST * shots[0].frame.sample_rate_hz
        seen = (
            "vanishes at half the sampling rate, as it does behind a digital low-pass and behind "
            "no analogue one; it does not say where this cuts, so the model has it at "
            f"{cutoff_hz:.2g} Hz, where it changes least"
        )
    else:
        seen = (
            f"falls off as white noise does behind a low-pass of about {cutoff_hz:.2g} Hz, and "
            "what cuts the noise cuts the signal"
        )
    return Shown(
        "amplifier_lowpass",
        found.form,
        {"cutoff_hz": cutoff_hz},
        f"the noise {found.stretch} {seen}",
        in_noise=True,
        measured=measured,
    )


def _level(item: FitShot) -> Array:
    """Return a whole record, compression positive and its baseline taken off."""
    return item.window.polarity * item.shot.signal - item.window.baseline


def _top(item: FitShot) -> int:
    return item.window.first + item.window.peak_index


def _clipping(shots: Sequence[FitShot]) -> Shown | None:
    """Return a ceiling that several hits end at although their flanks differ."""
    levels, slopes = [], []
    for item in shots:
        if rail(item.shot, item.window) is not None:
            continue  # the converter's own limit, which the fit knows
        x, top = _level(item), _top(item)
        share = _share_of_top(item, x[top])
        if item.shot.clipped or _flat(x, top, share):
            levels.append(float(np.median(x[_around(x, top, share)])))
            rise = np.diff(x[max(0, item.window.first + item.window.rise_index - 1) : top + 1])
            slopes.append(float(rise.max()) if rise.size else math.nan)
    if len(levels) < FEWEST_HITS or not np.all(np.isfinite(slopes)):
        return None
    agree = float(np.std(np.log(levels)))
    differ = float(np.std(np.log(slopes)))
    if agree > CRITERIA.little * differ:
        return None
    ceiling = float(np.median(levels))
    return Shown(
        "clipping",
        "clipping",
        {"ceiling_v": ceiling},
        f"{len(levels)} of {len(shots)} pulses have flat tops at one height, "
        f"{ceiling:.4g} above the baseline, within {100.0 * agree:.1g} %, though the steepness of "
        f"their flanks differs by {100.0 * differ:.2g} %",
    )


def _share_of_top(item: FitShot, height: float) -> float:
    quiet = quiet_part(item.shot)
    noise = float(np.std(quiet)) if quiet.size else 0.0
    return max(NARROW, TOP_DEVIATIONS * noise / height)


def _flat(x: Array, top: int, share: float) -> bool:
    """Tell whether a top is as wide close below its height as far below."""
    if WIDER * share > DEEPEST:
        return False  # noise hides it
    near, far = _width(x, top, share), _width(x, top, WIDER * share)
    return near > CRITERIA.half * far


def _around(x: Array, top: int, share: float) -> slice:
    """Return the samples around a top that are within a share of its height."""
    above = x > (1.0 - share) * x[top]
    before, after = np.flatnonzero(~above[:top]), np.flatnonzero(~above[top:])
    first = int(before[-1]) + 1 if before.size else 0
    return slice(first, top + int(after[0]) if after.size else x.size)


def _width(x: Array, top: int, share: float) -> float:
    """Return how wide a pulse is at a share below its top, between samples. [sample]"""
    run, level = _around(x, top, share), (1.0 - share) * x[top]
    first, last = run.start, run.stop - 1
    before = (x[first] - level) / (x[first] - x[first - 1]) if first > 0 else 0.0
    after = (x[last] - level) / (x[last] - x[last + 1]) if last + 1 < x.size else 0.0
    return float(last - first + before + after)


def _highpass(shots: Sequence[FitShot]) -> Shown | None:
    """Return a time constant with which the impulse of every pulse dies away to nothing."""
    courses = [course for item in shots if (course := _impulse(item)) is not None]
    if len(courses) < max(FEWEST_HITS, len(shots) / 2):
        return None
    # about a smooth course the mounting rings, which speaks neither for a high-pass nor against it
    constant, rings = (
        sum(_left(t, y, columns(t)) for t, y in courses) for columns in (_constant, _smooth)
    )

    def unexplained(ln_tau: float) -> float:
        decay = math.exp(ln_tau)
        dying = sum(_left(t, y, [_decay(t, decay)]) for t, y in courses)
        smooth = min(rings, sum(_left(t, y, [_decay(t, decay), *_smooth(t)]) for t, y in courses))
        return (dying - smooth) / (constant - smooth) if constant > smooth else 1.0

    longest = float(np.median([t[-1] - t[0] for t, _ in courses]))
    step = float(np.median([np.diff(t).mean() for t, _ in courses]))
    grid = np.log(np.geomspace(4.0 * step, longest, 24))
    best = int(np.argmin([unexplained(float(at)) for at in grid]))
    if not 0 < best < grid.size - 1:
        return None
    found = minimize_scalar(unexplained, bounds=(grid[best - 1], grid[best + 1]), method="bounded")
    tau = math.exp(float(found.x))
    stays = abs(float(np.median([_lasting(t, y, tau) for t, y in courses])))
    if found.fun > CRITERIA.little or stays > CRITERIA.little:
        return None
    return Shown(
        "coupler_highpass",
        "coupler_highpass",
        {"time_constant_s": tau},
        f"after the pulse the impulse dies away to nothing with a time constant of about "
        f"{1e3 * tau:.2g} ms in {len(courses)} of {len(shots)} records",
    )


def _constant(t: Array) -> list[Array]:
    return [np.ones_like(t)]


def _smooth(t: Array) -> list[Array]:
    u = np.linspace(-1.0, 1.0, t.size)
    return [legendre(order, u) for order in (0, *range(2, SMOOTH_ORDER + 1))]


def _lasting(t: Array, y: Array, tau: float) -> float:
    """Return the part of an impulse that remains over the part that dies away."""
    columns = np.column_stack([_decay(t, tau), np.ones_like(t), t])
    dies, stays, _ = np.linalg.lstsq(columns, y, rcond=None)[0]
    return float(stays / dies) if dies != 0.0 else math.inf


def _impulse(item: FitShot) -> tuple[Array, Array] | None:
    """Return times from the record's begin, and the impulse after the pulse, in its own size."""
    x, top = _level(item), _top(item)
    over = np.flatnonzero(x[top:] < CONTACT_ENDS * x[top])
    if not over.size:
        return None
    end, total = top + int(over[0]), np.cumsum(x)
    if x.size - end < 2 * (end - item.window.first - item.window.rise_index) or total[end] <= 0.0:
        return None  # too short a tail
    kept = np.unique(np.linspace(end, x.size - 1, MOST_POINTS).astype(int))
    return kept / item.frame.sample_rate_hz, np.asarray(total[kept] / total[end])


def _decay(t: Array, tau: float) -> Array:
    return np.asarray(np.exp(-(t - t[0]) / tau))


def _left(t: Array, y: Array, columns: list[Array]) -> float:
    """Return the mean square that columns and the line of an offset leave."""
    basis = np.column_stack([*columns, t])
    left = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
    return float(left @ left) / y.size


def _hum(shots: Sequence[FitShot]) -> Shown | None:
    """Return the mains, where nothing else explains as much of what the mean waveform leaves."""
    rates = {item.frame.sample_rate_hz for item in shots}
    length_s = min(item.shot.signal.size / item.frame.sample_rate_hz for item in shots)
    longest = max(item.shot.signal.size for item in shots)
    if len(rates) != 1 or longest > MAX_SAMPLES or length_s * min(MAINS_HZ) < 1.0:
        return None  # less than a period is a slope like any other
    residuals = _beside_mean([_whole(item) for item in shots])
    rate = rates.pop()
    resolution_hz = 0.5 / length_s
    shares = {float(f): _share(residuals, rate, float(f)) for f in (*HUM_HZ, *MAINS_HZ)}
    highest = max(shares, key=lambda f: shares[f])
    mains = min(MAINS_HZ, key=lambda f: abs(f - highest))
    share = shares[mains]
    if abs(highest - mains) > resolution_hz or share < CRITERIA.little:
        return None
    return Shown(
        "mains_hum",
        "mains_hum" if mains == MAINS_HZ[0] else "mains_hum:60_hz",
        {},
        f"beside the mean waveform the records hold {mains:g} Hz, at a phase of its own in each: "
        f"{100.0 * share:.0f} % of what a parabola leaves, more than any other frequency",
    )


def _whole(item: FitShot) -> Hit:
    """Return a whole record as a hit."""
    window = item.window
    whole = dataclasses.replace(
        window,
        signal=window.polarity * item.shot.signal,
        rise_index=window.first + window.rise_index,
    )
    return Hit.of_window(whole, item.frame.sample_rate_hz)


def _beside_mean(hits: Sequence[Hit]) -> list[Array]:
    """Return what the mean waveform of all hits leaves of each."""
    wave, placed = aligned_mean(hits)
    return [wave.residual(hit, one) for hit, one in zip(hits, placed, strict=True)]


def _share(residuals: list[Array], rate_hz: float, frequency_hz: float) -> float:
    """Return the share of what parabolas leave that a tone of free size and phase explains."""
    explained = total = 0.0
    for left in residuals:
        phase = 2.0 * np.pi * frequency_hz * np.arange(left.size) / rate_hz
        u = np.linspace(-1.0, 1.0, left.size)
        slow = np.column_stack([np.ones_like(u), u, u * u])
        basis = np.linalg.qr(np.column_stack([slow, np.cos(phase), np.sin(phase)]))[0]
        products = basis.T @ left
        tone = float(products[3:] @ products[3:])
        explained += tone
        total += float(left @ left - products[:3] @ products[:3])
    return explained / total if total > 0.0 else 0.0
