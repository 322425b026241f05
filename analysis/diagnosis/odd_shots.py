"""Shots that do not belong: without a few of them the rest is noise, and their repetitions agree.

No effect of a rig acts on one shot and spares its repetitions: the same sphere on the same surface
from the same height, or from a lower and from a higher one, as effects grow or fall with the speed.
So a shot that differs from them is set aside before any effect is looked for. What it is like is
said: a drop of another sphere or coupon, from another height, with another gain. Without a
repetition an effect may be the reason, and the shot stays, unless another label or a speed of its
own explains it whole: then that is wrong, whatever acts.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from analysis.aliases import Array
from analysis.campaign import Shot, shot_words
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.progress import MethodStep, Progress
from analysis.diagnosis.score_test import chance_of
from analysis.diagnosis.selection import Step
from analysis.errors import AnalysisError
from analysis.fit import joint
from analysis.fit.blocks import shot_cost
from analysis.fit.fit_shot import FitShot, fit_shot, gain_is_observable
from analysis.fit.problem import JointProblem, build
from analysis.fit.settle import settle
from analysis.fit.start import with_start
from analysis.model import solver
from analysis.model.impact_model import COUPON
from analysis.parameters import of_material

FEWEST = 3
"""Shots from which one may be the odd one: of two nobody knows which."""
SUBSETS, CONCENTRATIONS = 3, 3
"""Small sets of shots that a fit begins from where the whole is drawn far off, and fits from each
to the shots that it follows best. Of three sets one holds none of two odd shots; chosen by trial.
"""
RANK = 1e-9
"""Singular value, over the largest, of a direction of one shot's parameters that it shows. Derived:
sums over its samples are good to 1e-12, and coordinates differ in scale by some hundreds."""
SETTLINGS = 5
"""Rounds in which one shot's own parameters settle, at most. A choice of time: it ends before where
the squares fall by less than one, a likelihood ratio of 1.6."""
DRAWN = 400
"""Points of a picture: as many as a column of a page can show."""
HEIGHT, RATE = "drop_height_m", "sample_rate_hz"
WRITTEN_DOWN = {HEIGHT, RATE, "sphere", "surface"}
"""What may be wrong of a shot although the shot is as it should be."""
OTHER_RATES = (0.1, 0.2, 0.25, 0.4, 0.5, 2.0, 2.5, 4.0, 5.0, 10.0)
"""Times the stated sample rate. Derived: digitizers offer 1, 2, 2.5 and 5 in each decade, and two
of these within a decade have such a ratio."""
GAIN_WITHIN = 0.7
"""Largest change of the logarithm of one shot's gain, a factor of two. A choice: an amplifier's
next range is farther off, and would be seen as such."""


@dataclass(frozen=True)
class SetAside:
    """A shot that was set aside, and why."""

    shot: int
    """Place in the campaign, from 0."""
    name: str
    because: str
    likely: dict[str, str | float]
    """What it would be like: sphere and surface, drop_height_m, sample_rate_hz, or gain; empty for
    nothing known."""
    curves: dict[str, list[float]]
    """``time_us`` in the record, ``signal``, and the best of the model ``as_labelled``."""


@dataclass(frozen=True)
class Rest:
    """A campaign without the shots that do not belong."""

    step: Step
    kept: list[int]
    """Places among the shots of the problem that was given."""
    set_aside: tuple[SetAside, ...]


def without_odd_shots(step: Step, usual: joint.Fitted, progress: Progress) -> Rest | None:
    """Return the present model without shots that do not belong; None where there are none.

    One shot after the other is left out, until none differs from the rest by more than noise. Where
    several have drawn the fit far off, it begins where a few shots lead, with the shots' own
    numbers as ``usual`` has them: known before any record.
    """
    progress(MethodStep.STRUCTURE.told("does a shot not belong?"), 0.07)
    whole = len(step.problem.shots)
    if whole < FEWEST:
        return None
    most = math.ceil(CRITERIA.little * whole)
    likely = None if step.tested is None else step.score_test.clearest
    part = _Part(list(range(whole)), step.problem, step.fitted)
    if part.is_hopeless:
        near = _with_one_left_out(step, part) or _trimmed(step, usual.nuisances, most)
        if near is None:
            return None
        part = near
    while not part.fitted.failed and len(part.kept) >= whole - most:
        odd, certain = _odd_one(part, most - (whole - len(part.kept)))
        if len(part.kept) < whole and not certain:
            rest = Step(part.problem, part.fitted, likely=likely)
            if not rest.structured:
                return _set_aside(step, rest, part.kept)
        if odd is None:
            return None
        part = _without(step, part, odd)
    return None


def count_as_noise(step: Step) -> int:
    """Return the number of shots of which the model leaves no more than noise.

    Without the one that draws it far off, where one does.
    """
    part = _Part(list(range(len(step.problem.shots))), step.problem, step.fitted)
    if part.is_hopeless and len(part.kept) >= FEWEST:
        part = _with_one_left_out(step, part) or part
    left = zip(part.problem.shots, part.fitted.blocks, strict=False)  # no blocks: nothing fitted
    return sum(block.cost <= _most_noise(item) for item, block in left)


def _set_aside(step: Step, rest: Step, kept: list[int]) -> Rest | None:
    """Return the rest with why the others do not belong; None where an effect may be the reason."""
    left_out = sorted(set(range(len(step.problem.shots))) - set(kept))
    found = [_described(step, rest, at) for at in left_out]
    certain = all(repeated or WRITTEN_DOWN & set(one.likely) for one, repeated in found)
    return Rest(rest, kept, tuple(one for one, _ in found)) if certain else None


@dataclass(frozen=True)
class _Part:
    """Some of the shots, and the present model fitted to them."""

    kept: list[int]
    problem: JointProblem
    fitted: joint.Fitted

    @property
    def is_hopeless(self) -> bool:
        """Whether the fit is far off."""
        return joint.is_hopeless(self.problem, self.fitted.cost)


def _odd_one(part: _Part, to_go: int) -> tuple[int | None, bool]:
    """Return the place of the shot that differs most from the rest, and whether beyond all chance.

    None where it does not by more than noise, or is only one of more than ``to_go`` that do.
    """
    falls, chance = _own_falls(part.problem, part.fitted)
    worst = int(np.argmax(falls))
    may_be_noise = chance[worst] * falls.size >= CRITERIA.false_alarm_rate
    part_of_all = CRITERIA.half * falls.sum() / max(to_go, 1)
    if may_be_noise or to_go < 1 or falls[worst] < part_of_all:
        return None, False
    return worst, bool(chance[worst] == 0.0)


def _without(step: Step, part: _Part, odd: int) -> _Part:
    """Return the fit to all shots of a part but one."""
    kept = [i for at, i in enumerate(part.kept) if at != odd]
    return _fitted_to(step, kept, np.delete(part.fitted.nuisances, odd, axis=0), part.fitted)


def _with_one_left_out(step: Step, part: _Part) -> _Part | None:
    """Return the fit without the one shot that makes nearly all the difference; None without one.

    The commonest case, and five times as fast as to begin with a few shots.
    """
    odd = None if part.fitted.failed else _odd_one(part, 1)[0]
    less = None if odd is None else _without(step, part, odd)
    return None if less is None or less.is_hopeless else less


def _fitted_to(step: Step, kept: list[int], nuisances: Array, begin: joint.Fitted) -> _Part:
    problem = step.problem.with_shots(kept)
    return _Part(kept, problem, joint.fit(problem, nuisances, theta=begin.theta))


def _trimmed(step: Step, usual: Array, most: int) -> _Part | None:
    """Return the fit to the shots that it follows, all but ``most`` at least; None without one.

    It begins where a few shots are followed that hold no odd one. Source: concentration steps from
    small subsets, P. J. Rousseeuw and K. Van Driessen, Data Min. Knowl. Disc. 12 (2006) 29.
    """
    whole = step.problem
    least, found, kept = math.inf, step.fitted, list(range(len(whole.shots)))
    for some in _subsets(whole):
        begin = dataclasses.replace(step.fitted, theta=whole.start)
        part = _fitted_to(step, some, usual[some], begin)
        for _ in range(CONCENTRATIONS):
            if part.fitted.failed:
                break
            nuisances = usual.copy()
            nuisances[part.kept] = part.fitted.nuisances
            nuisances = settle(whole, part.fitted.theta, nuisances)
            squares = np.array(
                [
                    shot_cost(whole, item, part.fitted.theta, own) / item.expected_squares
                    for item, own in zip(whole.shots, nuisances, strict=True)
                ]
            )
            best = sorted(np.argsort(squares)[: len(whole.shots) - most].tolist())
            trimmed = float(squares[best].sum())
            if not trimmed < least:
                break
            least, found = trimmed, dataclasses.replace(part.fitted, nuisances=nuisances)
            kept = [i for i, one in enumerate(squares) if i in best or one < joint.HOPELESS]
            if trimmed > joint.HOPELESS * len(best):
                break  # so few shots are far off too: a model that lacks something
            part = _fitted_to(step, best, nuisances[best], part.fitted)
        if least <= joint.HOPELESS * (len(whole.shots) - most):
            return _fitted_to(step, kept, found.nuisances[kept], found)
    return None


def _subsets(problem: JointProblem) -> list[list[int]]:
    """Return disjoint sets of shots with one of every pair each; an odd shot is in one only."""
    by_pair: dict[str, list[int]] = {}
    for at, item in enumerate(problem.shots):
        by_pair.setdefault(item.pair, []).append(at)
    return [
        sorted(own[turn % len(own)] for own in by_pair.values())
        for turn in range(min(SUBSETS, max(len(own) for own in by_pair.values())))
    ]


def _own_falls(problem: JointProblem, fitted: joint.Fitted) -> tuple[Array, Array]:
    """Return how far the squares fall where one shot has a rig of its own, and its chance.

    Both of shape (n,), of the linearised problem: the shot's speed and all that it shares with
    others are its own then. What it leaves beyond noise even so counts as well.
    """
    matrix, _, parts = joint.normal_equations(problem, fitted)
    numbers, falls, left = np.ones((3, len(problem.shots)))
    for at, (item, block, part) in enumerate(zip(problem.shots, fitted.blocks, parts, strict=True)):
        others = np.linalg.lstsq(matrix - part.matrix, part.vector, rcond=None)[0]
        own, load = block.matrix.copy(), block.vector.copy()
        prior, speed = item.speed_prior, block.chain.shape[0]
        promised = 0.0
        if prior is not None:  # a height that may be wrong promises no speed
            away = float(fitted.nuisances[at][0] - prior.mean) / prior.u
            promised = away**2
            own[speed, speed] -= prior.u**-2
            load[speed] += away / prior.u
        moved, _, rank, _ = np.linalg.lstsq(own, load, rcond=RANK)
        alone = block.cost - promised - float(load @ moved)
        falls[at] = float(part.vector @ others) + promised + float(load @ moved)
        numbers[at], left[at] = max(int(rank), 1), max(alone - _most_noise(item), 0.0)
    # noise of another colour than was estimated widens all shots' falls alike
    usual = max(1.0, float(np.median(falls / chi2.median(numbers))))
    chance = np.where(left > 0.0, 0.0, chi2.sf(falls / usual, numbers))
    return np.maximum(falls - usual * numbers, 0.0) + left, chance


def _most_noise(item: FitShot) -> float:
    """Return the squares that noise leaves of a shot at most."""
    return item.expected_squares + chance_of(item.expected_squares)


# -- what a shot is like ---------------------------------------------------------------------------
def _described(whole: Step, rest: Step, at: int) -> tuple[SetAside, bool]:
    """Return why a shot does not belong, and whether a repetition is left that says so too."""
    item = whole.problem.shots[at]
    alone = ShotAlone(rest.problem, rest.fitted.theta, item, whole.fitted.nuisances[at])
    found = alone.explanations()
    ratio = math.sqrt(alone.squares(item) / item.expected_squares)
    peers = sum(other.condition == item.condition for other in rest.problem.shots)
    between = not peers and _is_between(item, rest.problem.shots)
    alike = "lower and higher drops of the pair leave" if between else "all other shots leave"
    others = {0: alike, 1: "its repetition leaves"}.get(peers, f"its {peers} repetitions leave")
    copied = _copied_from(item, whole.problem.campaign.shots)
    if copied is not None:
        found = [(f"its record is a copy of that of {copied}", {})]
    like = ", or ".join(words for words, _ in found)
    because = f"It leaves {ratio:.3g} times the noise, {others} noise. " + (
        f"{like[0].upper()}{like[1:]}." if found else "No other label, height or gain explains it."
    )
    places = [id(shot) for shot in whole.problem.campaign.shots]
    place = places.index(id(item.shot))
    likely = found[0][1] if found else {}
    repeated = peers > 0 or between
    return SetAside(place, item.shot.name, because, likely, alone.curves()), repeated


def _copied_from(item: FitShot, shots: Sequence[Shot]) -> str | None:
    """Return in words of which shot a record is a copy to the last bit; None of none."""
    for place, other in enumerate(shots):
        if other is not item.shot and np.array_equal(other.signal, item.shot.signal):
            return shot_words(place, other.name)
    return None


def _is_between(item: FitShot, others: list[FitShot]) -> bool:
    """Tell whether the pair of a shot was dropped from a lower and from a higher place as well."""
    heights = [o.shot.drop_height_m for o in others if o.pair == item.pair]
    own, known = item.shot.drop_height_m, [h for h in heights if h is not None]
    return own is not None and bool(known) and min(known) <= own <= max(known)


@dataclass(frozen=True)
class ShotAlone:
    """One shot under what all others say of the rig and of the materials."""

    rest: JointProblem
    theta: Array
    item: FitShot
    own: Array
    """The shot's own parameters as the fit of all shots has them: where to begin."""

    def squares(self, item: FitShot) -> float:
        """Return the whitened squares at the shot's best own parameters; infinite without any."""
        return self._at_best(item)[0]

    def _at_best(self, item: FitShot) -> tuple[float, Array]:
        problem = dataclasses.replace(self.rest, shots=[item])
        starts = [self.own]
        if item.speed_prior is not None:
            starts.append(self._as_promised(item))
        return min((self._settled(problem, start) for start in starts), key=_first)

    def squares_as_promised(self, item: FitShot) -> float:
        """Return the same from the speed that its height promises alone.

        What the shot had under another label is no guide.
        """
        problem = dataclasses.replace(self.rest, shots=[item])
        return self._settled(problem, self._as_promised(item))[0]

    def _as_promised(self, item: FitShot) -> Array:
        """Return where to begin if the shot is as fast as its height says."""
        own = self.own.copy()
        if item.speed_prior is not None:
            own[0] = item.speed_prior.mean
        return own

    def _settled(self, problem: JointProblem, own: Array) -> tuple[float, Array]:
        squares = math.inf
        for _ in range(SETTLINGS):
            own = settle(problem, self.theta, own[None, :])[0]
            before, squares = squares, shot_cost(problem, problem.shots[0], self.theta, own)
            if not squares < before - 1.0:
                break
        return squares, own

    def curves(self) -> dict[str, list[float]]:
        """Return the pulse and what the model makes of it as labelled, `DRAWN` points at most."""
        shared, _ = self.rest.shared_local(self.item, self.theta)
        local = np.concatenate([shared, self._at_best(self.item)[1]])
        expected = self.rest.model.predict(local, self.item.frame).signal
        window, rate = self.item.window, self.item.frame.sample_rate_hz
        pulse = max(1, round(window.width_s * rate))
        first = max(0, window.rise_index - pulse)
        last = min(window.signal.size, window.rise_index + 4 * pulse)
        shown = slice(first, last, math.ceil((last - first) / DRAWN))
        time_us = 1e6 * (window.first + np.arange(window.signal.size)) / rate
        drawn = {"time_us": time_us, "signal": window.signal, "as_labelled": expected}
        return {name: values[shown].tolist() for name, values in drawn.items()}

    def explanations(self) -> list[tuple[str, dict[str, str | float]]]:
        """Return in words and numbers what leaves noise of the shot, the least squares first."""
        asked = (*self.labels(), *self.rates(), *self._height(), *self._gain())
        found = sorted(asked, key=_first)
        enough = min(
            _most_noise(self.item),
            found[0][0] + CRITERIA.least_lead if found else math.inf,
        )
        return [(said, like) for squares, said, like in found if squares <= enough]

    def labels(self) -> Iterator[tuple[float, str, dict[str, str | float]]]:
        """Yield the squares left under each other label, in words and in names."""
        shot, campaign = self.item.shot, self.rest.campaign
        if shot.sphere is None or shot.surface is None:
            return
        known = set(self.rest.names)
        for sphere in sorted(campaign.spheres):
            for surface in sorted(campaign.surfaces):
                same = (sphere, surface) == (shot.sphere, shot.surface)
                moduli = {of_material("sphere", sphere), of_material("surface", surface)}
                if same or not moduli <= known:
                    continue
                other = self._restated(dataclasses.replace(shot, sphere=sphere, surface=surface))
                like: dict[str, str | float] = {}
                if sphere != shot.sphere:
                    like["sphere"] = sphere
                if surface != shot.surface:
                    like["surface"] = surface
                words = (
                    f"it is like {sphere} on {surface}, not {shot.sphere} on {shot.surface}: "
                    "look at the label"
                )
                yield self.squares_as_promised(other), words, like

    def rates(self) -> Iterator[tuple[float, str, dict[str, str | float]]]:
        """Yield the squares left at each other sample rate, in words and as a number."""
        stated = self.item.shot.sample_rate_hz
        for ratio in OTHER_RATES:
            rate = stated * ratio
            words = f"its sample rate was {1e-3 * rate:g} kHz, not {1e-3 * stated:g} kHz"
            shot = dataclasses.replace(self.item.shot, sample_rate_hz=rate)
            alone = dataclasses.replace(self.rest.campaign, shots=(shot,))
            try:
                # at another time base the pulse begins elsewhere: its start is no guide
                own = with_start(build(alone, self.rest.model))[1][0]
                other = self._restated(shot)
            except AnalysisError:  # no impact lasts so long, or so short
                continue
            yield dataclasses.replace(self, own=own).squares_as_promised(other), words, {RATE: rate}

    def _restated(self, shot: Shot) -> FitShot:
        """Return the shot as if ``shot`` had been written down."""
        campaign, model = self.rest.campaign, self.rest.model
        kv = model.kind == solver.KV
        return fit_shot(
            shot,
            campaign,
            self.item.noise,
            known_gain=gain_is_observable(campaign, kv=kv),
            kv=kv,
            closed=model.closed,
            rides=model.obeys(COUPON),
            place=self.item.frame.place,
        )

    def _height(self) -> Iterator[tuple[float, str, dict[str, str | float]]]:
        stated = self.item.shot.drop_height_m
        if self.item.speed_prior is None or stated is None:
            return
        squares, own = self._at_best(dataclasses.replace(self.item, speed_prior=None))
        # the squared speed goes with the height, nearly so in air
        height = stated * math.exp(2.0 * (float(own[0]) - self.item.speed_prior.mean))
        words = f"it fell from about {1e3 * height:.3g} mm, not {1e3 * stated:.3g} mm"
        yield squares + CRITERIA.price_of_number, words, {HEIGHT: height}

    def _gain(self) -> Iterator[tuple[float, str, dict[str, str | float]]]:
        if self.item.shot.quantity != "voltage":
            return
        own = self._as_promised(self.item)

        def squares(ln: float) -> float:
            """Return what is left if the signal is too large by a factor, as a logarithm."""
            nonlocal own  # the next factor is not far from this one
            item = _amplified(self.item, math.exp(-ln))
            least, own = self._settled(dataclasses.replace(self.rest, shots=[item]), own)
            return least

        found = minimize_scalar(
            squares,
            bounds=(-GAIN_WITHIN, GAIN_WITHIN),
            method="bounded",
        )
        factor = math.exp(float(found.x))
        words = f"its signal is {factor:.3g} of the others': look at the gain, or it hit off-centre"
        yield float(found.fun) + CRITERIA.price_of_number, words, {"gain": factor}


def _first(found: tuple[float, *tuple[Any, ...]]) -> float:
    return found[0]


def _amplified(item: FitShot, by: float) -> FitShot:
    """Return a shot with its signal times a factor."""
    window = dataclasses.replace(item.window, signal=item.window.signal * by)
    return dataclasses.replace(item, window=window)
