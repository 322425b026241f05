"""Which effect first? A tournament of honest refits: many starts on few shots, the best on all.

Repeats of a drop say the same about a model's form, so early rounds look at few shots, chosen so
that every pair and, as far as it goes, every height takes part. Scores are compared only within one
set of shots. What a linear look promises puts the starts in order; it is a promise only, and where
the residual is many times the noise the usual sizes of every effect are tried beside it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.candidates import (
    KNOWN_BEFORE,
    Proposal,
    Refit,
    continued,
    default_starts,
    extended,
    price,
    proposals,
    refit,
    refit_elsewhere,
    rescoped,
    scopes_of,
)
from analysis.discovery.evidence import Evidence, gather
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.problem import FitShot, JointProblem

PENALTY = 12.0
"""Price of one number in whitened squares, about ln of the number of samples."""
FEW, MORE = 9, 18
"""Shots of the first two rounds."""
FIRST_STEPS, SECOND_STEPS = 4, 8
STARTS_PER_OWNER = 2
STRUCTURE_STARTS = 4
SHORTLIST = 7
INTO_SECOND, INTO_LAST = 7, 3
BENT = 300.0
"""Whitened squares beyond the noise, on the few shots, from which a slope is only a promise."""
FAR = 1.5
"""Whitened squares a sample from which the present fit is no place to begin."""
KNOWN_U = 0.3
"""A global whose prior is narrower than this is known before any record."""
USUAL_MODULUS_PA, USUAL_RESTITUTION = 3e9, 0.8
"""Where an unknown plastic begins when the records themselves mislead."""
NOTHING = 1.0
"""Whitened squares by which a start must differ from the model without the effect."""
HOPELESS = 0.4
"""Share of the leader's score below which a candidate is not carried on."""
USUAL_STARTS, FAR_STARTS = 4, 8
AFAR_KEPT, AFAR_STEPS = 4, 14
SETTLED = 3
"""Shots on which far starts are put in order."""
RISES_AFTER = 0.2
"""Share of a pulse's width after touch-down at which it has risen by 5 %, or so."""
WELL_BELOW = 0.7
"""Share of the largest excursion that a ceiling, if there is one, does not touch."""
ALWAYS_TRIED = 6

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Start:
    """One way to begin fitting one effect.

    Attributes
    ----------
    proposal : Proposal
        Effect, form and coordinates.
    scope : str
        Owner of its amplitude.
    coefficients : dict
        Amplitude by owner; empty for the proposal's own.
    promised : float
        Linear gain less its price.
    begin : Fitted or None
        Where the present model begins, if not at its best.
    """

    proposal: Proposal
    scope: str
    coefficients: dict[str, float]
    promised: float
    begin: joint.Fitted | None = None


def thinned(problem: JointProblem, count: int) -> list[int]:
    """Return the places of shots that stand for all.

    Parameters
    ----------
    problem : JointProblem
        Whole campaign.
    count : int
        How many are wanted at least, where there are so many.

    Returns
    -------
    list of int
        In order of time; all pairs take part, then all heights, then repeats spread over time.
    """
    groups: dict[tuple[str, float], list[int]] = {}
    for place, item in enumerate(problem.shots):
        groups.setdefault((item.pair, item.shot.drop_height_m or 0.0), []).append(place)
    by_pair: dict[str, list[list[int]]] = {}
    for (pair, _), places in sorted(groups.items()):
        by_pair.setdefault(pair, []).append(places)
    pairs = [by_pair[p] for p in sorted(by_pair)]
    chosen: list[int] = []
    for turn in range(max(len(p) for p in groups.values()) * max(len(p) for p in pairs)):
        for at, heights in enumerate(pairs):
            # a staircase: neighbouring pairs begin at different heights
            group = heights[(turn + at) % len(heights)]
            free = [i for i in group if i not in chosen]
            if free and (len(chosen) < count or turn == 0):
                chosen.append(free[(turn + at) % len(free)])
        if len(chosen) >= count:
            break
    return sorted(chosen)


def part_of(
    problem: JointProblem, fitted: joint.Fitted, places: list[int]
) -> tuple[JointProblem, joint.Fitted]:
    """Return a campaign of some of the shots, the same model fitted to them."""
    if len(places) == len(problem.shots):
        return problem, fitted
    few = dataclasses.replace(problem, shots=[problem.shots[i] for i in places])
    return few, joint.fit(few, fitted.nuisances[places], theta=fitted.theta)


def starts(
    evidence: Evidence, tried: list[Proposal], *, alone: bool = False
) -> dict[str, list[Start]]:
    """Return for each library entry where to begin, the most promising first.

    Parameters
    ----------
    evidence : Evidence
        Of the present model, with the proposals' columns.
    tried : list of Proposal
        What may be tried.
    alone : bool
        The shots are one material's: its numbers are that one's, or each shot's.

    Returns
    -------
    dict
        Owner to starts; owners in order of their best promise.
    """
    found: dict[str, list[Start]] = {}
    for proposal in tried:
        for scope in scopes_of(proposal.effect):
            if alone and scope in ("surface", "sphere"):
                continue
            seen = evidence.explain(proposal.key, scope, heldout=False)
            sizes = {_owner(label): value for label, value in seen.coefficients.items()}
            own = seen.dof if scope == "shot" else 0
            promised = seen.gain - price(seen.dof - own, own, seen.gain, PENALTY)
            found.setdefault(proposal.owner, []).append(Start(proposal, scope, sizes, promised))
    for some in found.values():
        some.sort(key=lambda s: -s.promised)
    return dict(sorted(found.items(), key=lambda item: -item[1][0].promised))


def _owner(label: str) -> str:
    return label.rpartition("[")[2].rstrip("]") if label.endswith("]") else ""


def _distinct(
    own: list[Start],
    few: JointProblem,
    base: joint.Fitted,
    *,
    bent: bool,
    begins: list[joint.Fitted],
) -> list[Start]:
    """Return the best few that differ in form or start, one for the whole rig among them."""
    structure = own[0].proposal.effect.structure is not None
    wanted = STRUCTURE_STARTS if structure else STARTS_PER_OWNER
    found: list[Start] = []
    for entry in own:
        if all(entry.proposal.key != f.proposal.key for f in found):
            found.append(entry)
        if len(found) == wanted:
            break
    if all(f.scope != "rig" for f in found):
        found += [s for s in own if s.scope == "rig"][:1]
    return found + (_usual(own, few, base, begins) if bent else [])


def _usual(
    own: list[Start], few: JointProblem, base: joint.Fitted, begins: list[joint.Fitted]
) -> list[Start]:
    """Return starts at an effect's usual sizes, whatever the linear look says of them."""
    found = []
    top = max(s.window.peak for s in few.shots)
    for effect in {s.proposal.effect.id: s.proposal.effect for s in own}.values():
        if effect.basis is not None:
            continue
        likely = next(s for s in own if s.proposal.effect.id == effect.id)
        coordinates = default_starts(effect, top)
        places: list[joint.Fitted | None] = [
            *(begins if _ends_the_signal(effect) else begins[:1])
        ]
        if effect.structure is None or not begins:
            places.append(None)
        for place in places:
            kept = FAR_STARTS if place and len(effect.parameters) > 1 else USUAL_STARTS
            nearest = coordinates
            if len(coordinates) > kept:
                settled = place is not None and effect.structure is not None
                nearest = _mildest(effect, coordinates, few, place or base, settled=settled)[:kept]
            found += [
                Start(
                    dataclasses.replace(likely.proposal, coordinates=at),
                    likely.scope,
                    {},
                    likely.promised,
                    begin=place,
                )
                for at in nearest
            ]
    return found


def _mildest(
    effect: Effect,
    coordinates: list[tuple[float, ...]],
    few: JointProblem,
    base: joint.Fitted,
    *,
    settled: bool,
) -> list[tuple[float, ...]]:
    """Return starts in order of the misfit they begin with, those that change nothing last.

    A yield pressure that nothing reaches, a ceiling above all peaks: from there no slope leads on.
    Far from the data the shots' own parameters are settled first.
    """
    own = rescoped(effect, "rig")
    if settled and len(few.shots) > SETTLED:
        some = list(range(0, len(few.shots), math.ceil(len(few.shots) / SETTLED)))
        few = dataclasses.replace(few, shots=[few.shots[i] for i in some])
        base = dataclasses.replace(base, nuisances=base.nuisances[some])
    nuisances = base.nuisances
    if settled:
        nuisances = joint.settle(few, base.theta, nuisances, kept=KNOWN_BEFORE)
    without = joint.total_cost(few, base.theta, nuisances)
    found = []
    for at in coordinates:
        names = (f"{own.id}.{p.name}" for p in own.parameters)
        larger, theta, start = extended(few, base, own, dict(zip(names, at, strict=True)))
        if settled:
            start = joint.settle(larger, theta, start, kept=KNOWN_BEFORE)
        cost = joint.total_cost(larger, theta, start)
        nothing = not math.isfinite(cost) or abs(cost - without) < NOTHING
        found.append((nothing, cost, at))
    return [at for _, _, at in sorted(found)]


def usual_place(problem: JointProblem, nuisances: Array) -> joint.Fitted:
    """Return a model at what was known before any record: where a large effect's fit may begin.

    Parameters
    ----------
    problem : JointProblem
        Prepared.
    nuisances : ndarray, shape (shots, p)
        Where the shots' own parameters begin.

    Returns
    -------
    Fitted
        Not fitted at all: the means of what is known well, the prepared start for the rest.
    """
    known = np.diag(problem.prior_precision) > KNOWN_U**-2
    theta = np.where(known, problem.prior_mean, problem.start)
    for at, name in enumerate(problem.names):
        if not known[at] and name.startswith(("sphere.", "surface.")):
            theta[at] = math.log(USUAL_MODULUS_PA)
    nuisances = nuisances.copy()
    for row, item in enumerate(problem.shots):
        if item.speed_prior is not None:
            nuisances[row, 0] = item.speed_prior.mean
        nuisances[row, 1] = math.log(USUAL_RESTITUTION)
        nuisances[row, 2] = _touch_down_us(item, float(nuisances[row, 2]))
    nothing = np.zeros((theta.size, theta.size))
    return joint.Fitted(theta, nuisances, [], nothing, math.inf, 0, False)


def _touch_down_us(item: FitShot, prepared_us: float) -> float:
    """Return the prepared touch-down, or one from where the pulse rises if the two contradict."""
    width_us = 1e6 * item.window.width_s
    rise_us = 1e6 * item.window.rise_index / item.frame.sample_rate_hz
    risen = rise_us - RISES_AFTER * width_us
    return risen if abs(prepared_us - risen) > RISES_AFTER * width_us else prepared_us


def below_a_ceiling(problem: JointProblem, begin: joint.Fitted) -> joint.Fitted:
    """Return the model fitted to what lies well within the campaign's largest excursion.

    Where the signal has an end, what is above it says nothing, and a model that must follow it is
    drawn far away; records and predictions that are cut alike below it agree whatever is above.

    Parameters
    ----------
    problem : JointProblem
        With the present model.
    begin : Fitted
        Where it begins.

    Returns
    -------
    Fitted
        To the cut records; ``begin`` where they cannot be fitted.
    """
    level = WELL_BELOW * max(s.window.peak for s in problem.shots)
    shots = []
    for item in problem.shots:
        low, high = item.frame.rail or (-math.inf, math.inf)
        rail = (max(low, -level), min(high, level))
        signal = np.clip(item.window.signal, *rail)
        window = dataclasses.replace(item.window, signal=signal)
        frame = dataclasses.replace(item.frame, rail=rail)
        shots.append(dataclasses.replace(item, window=window, frame=frame))
    cut = dataclasses.replace(problem, shots=shots)
    nuisances = joint.settle(cut, begin.theta, begin.nuisances)
    found = joint.fit(cut, nuisances, theta=begin.theta)
    return found if found.blocks else begin


@dataclass(frozen=True)
class Ground:
    """What a turn stands on.

    Attributes
    ----------
    problem, fitted : JointProblem, Fitted
        The present model at its best on all shots.
    usual : Fitted
        The base model at what was known before, for all shots.
    """

    problem: JointProblem
    fitted: joint.Fitted
    usual: joint.Fitted

    def begin(self, places: list[int], base: joint.Fitted) -> joint.Fitted:
        """Return where a far start begins on some shots: usual place, present effects as fitted."""
        theta = base.theta.copy()
        theta[: self.usual.theta.size] = self.usual.theta
        nuisances = base.nuisances.copy()
        nuisances[:, : self.usual.nuisances.shape[1]] = self.usual.nuisances[places]
        return dataclasses.replace(base, theta=theta, nuisances=nuisances)


def ranked(
    ground: Ground,
    tried: list[Proposal],
    progress: Progress,
    *,
    first: bool = True,
    alone: bool = False,
) -> list[Refit]:
    """Return library effects refitted on top of a model, best first.

    Parameters
    ----------
    ground : Ground
        The present model, and where it would be without a record.
    tried : list of Proposal
        What may be tried.
    progress : callable
        Told what is being done and a share between 0 and 1.
    first : bool
        Nothing was added yet: then every effect is tried where slopes mislead.
    alone : bool
        As for `starts`.

    Returns
    -------
    list of Refit
        The first few fitted to all shots; the rest, behind them, to a part of the shots, their
        gain scaled to all.
    """
    places = thinned(ground.problem, FEW)
    few, base = part_of(ground.problem, ground.fitted, places)
    evidence = gather(few, base, tried)
    entries = starts(evidence, tried, alone=alone)
    samples = sum(s.white.size for s in evidence.shots)
    bent = evidence.chi2 - samples > BENT
    far = evidence.chi2 > FAR * samples
    begins = _begins(ground, few, base, places) if far else []
    order = list(entries) if bent and first else _short(entries)
    best: list[Refit] = []
    for at, owner in enumerate(order):
        lead = max((r.score(PENALTY) for r in best if not r.at_bound), default=0.0)
        if at >= ALWAYS_TRIED and evidence.chi2 - samples - lead < BENT:
            break  # nothing is left for another to explain
        progress(f"trying {owner}", 0.6 * at / len(order))
        tries = [
            refit(
                few,
                base,
                start.proposal,
                scope=start.scope,
                coefficients=start.coefficients,
                linear_gain=start.promised,
                max_iterations=FIRST_STEPS,
                begin=start.begin,
            )
            for start in _distinct(entries[owner], few, base, bent=bent, begins=begins)
        ]
        best += _best_forms(tries, base, bent=bent, far=far)
    return _later_rounds(ground, best, Part(places, base), progress, bent=bent, far=far)


def _begins(
    ground: Ground, few: JointProblem, base: joint.Fitted, places: list[int]
) -> list[joint.Fitted]:
    """Return where far starts begin: the usual place, then, for a signal that ends, below it."""
    usual = ground.begin(places, base)
    return [usual, below_a_ceiling(few, usual)]


def rivals_refitted(problem: JointProblem, fitted: joint.Fitted, taken: Refit) -> list[Refit]:
    """Return the other effects of a slot, each form fitted to all shots, best first.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        The model that one of them was added to.
    taken : Refit
        That one.

    Returns
    -------
    list of Refit
        One an effect, from the most promising start of each form; the rig's sizes, which is what
        most effects are.
    """
    tried = [
        p
        for p in proposals(problem)[0]
        if p.effect.slot == taken.effect.slot and p.owner != taken.owner
    ]
    found = []
    for own in starts(gather(problem, fitted, tried), tried).values():
        forms: dict[str, Start] = {}
        for start in own:
            if start.scope == "rig":
                forms.setdefault(start.proposal.effect.id, start)
        found += [
            refit(
                problem,
                fitted,
                start.proposal,
                scope=start.scope,
                coefficients=start.coefficients,
                linear_gain=start.promised,
            )
            for start in forms.values()
        ]
    found.sort(key=rank)
    found[:INTO_LAST] = [
        r if r.fitted.converged else continued(fitted, r) for r in found[:INTO_LAST]
    ]
    return one_form_each(sorted(found, key=rank))


def _best_forms(
    tries: list[Refit], base: joint.Fitted, *, bent: bool, far: bool
) -> list[Refit]:
    """Return the best start of each form of an effect, some steps further where slopes mislead."""
    found = []
    for form in sorted({r.effect.id for r in tries}):
        own = sorted((r for r in tries if r.effect.id == form), key=rank)
        if far and own[0].effect.structure is not None:
            # from afar the way is long, and the first steps do not show which start gets there
            own = [continued(base, r, max_iterations=AFAR_STEPS) for r in own[:AFAR_KEPT]]
        elif bent and not own[0].fitted.converged:
            own = [continued(base, own[0], max_iterations=SECOND_STEPS)]
        found.append(min(own, key=rank))
    return found


def _short(entries: dict[str, list[Start]]) -> list[str]:
    """Return the owners worth a refit where slopes can be trusted."""
    order = list(entries)
    # a structure below the sphere changes everything at once: its slope promises little
    far = [o for o in order[SHORTLIST:] if entries[o][0].proposal.effect.structure is not None]
    return order[:SHORTLIST] + far


def rank(found: Refit) -> tuple[bool, bool, float]:
    """Return what puts refits in order: physical ones first, then those fitted to all shots."""
    return not found.on_all_shots, found.at_bound, -found.score(PENALTY)


def _merit(found: Refit, factor: float) -> float:
    """Return the score that all shots would give; what left its range loses half of it."""
    score = found.score(PENALTY, factor)
    return 0.5 * score if found.at_bound and score > 0 else score


@dataclass(frozen=True)
class Part:
    """Some of the shots, and the present model fitted to them."""

    places: list[int]
    base: joint.Fitted


def _anchors(
    ground: Ground, few: Part, many: Part, effect: Effect, *, far: bool
) -> tuple[Array, Array] | None:
    """Return where shots' own parameters are before any fit, if that is the better guide."""
    if not far:
        return None
    found = []
    for part in (few, many):
        begin = ground.begin(part.places, part.base)
        if _ends_the_signal(effect):
            shots = [ground.problem.shots[i] for i in part.places]
            begin = below_a_ceiling(dataclasses.replace(ground.problem, shots=shots), begin)
        found.append(begin.nuisances)
    return found[0], found[1]


def _ends_the_signal(effect: Effect) -> bool:
    return any(p.peak_starts for p in effect.parameters)


def _later_rounds(
    ground: Ground,
    best: list[Refit],
    part: Part,
    progress: Progress,
    *,
    bent: bool,
    far: bool,
) -> list[Refit]:
    """Carry the best on: some steps on more shots, then to the end on all."""
    problem, fitted = ground.problem, ground.fitted
    whole = len(problem.shots)
    factor = whole / len(part.places)
    first = sorted(best, key=lambda r: -_merit(r, factor))
    behind = [_scaled(r, factor) for r in first[INTO_SECOND:]]
    second: list[Refit] = []
    more = thinned(problem, MORE if bent else whole)
    large, base_large = part_of(problem, fitted, more)
    for at, one in enumerate(first[:INTO_SECOND]):
        progress(f"refining {one.owner}", 0.6 + 0.2 * at / INTO_SECOND)
        moved = refit_elsewhere(
            one, few_base=part.base, few=part.places, many=more, problem=large, base=base_large,
            max_iterations=SECOND_STEPS,
            anchors=_anchors(ground, part, Part(more, base_large), one.effect, far=far),
        )  # fmt: skip
        second.append(moved)
    factor = whole / len(more)
    second.sort(key=lambda r: -_merit(r, factor))
    lead = max((_merit(r, factor) for r in second), default=0.0)
    last: list[Refit] = []
    everything = list(range(whole))
    for at, one in enumerate(second):
        worth = at < INTO_LAST and _merit(one, factor) >= HOPELESS * lead
        if not worth:
            behind.append(_scaled(one, factor))
            continue
        progress(f"refining {one.owner} on all shots", 0.8 + 0.2 * at / INTO_LAST)
        moved = one
        if len(more) < whole:
            moved = refit_elsewhere(
                one, few_base=base_large, few=more, many=everything, problem=problem, base=fitted,
                max_iterations=25,
                anchors=_anchors(
                    ground, Part(more, base_large), Part(everything, fitted), one.effect, far=far
                ),
            )  # fmt: skip
        last.append(moved if moved.fitted.converged else continued(fitted, moved))
    return one_form_each([*sorted(last, key=rank), *sorted(behind, key=rank)])


def one_form_each(refits: list[Refit]) -> list[Refit]:
    """Return the refits without an effect's lesser forms."""
    found: dict[str, Refit] = {}
    for one in refits:
        found.setdefault(one.owner, one)
    return list(found.values())


def _scaled(found: Refit, factor: float) -> Refit:
    """Return a refit on a part of the shots with the gain that all would give."""
    own = round(found.own * factor)
    count = found.parameters - found.own + own
    return dataclasses.replace(
        found, gain=found.gain * factor, parameters=count, own=own, on_all_shots=factor == 1.0
    )
