"""Which effect first? A tournament of honest refits: many starts on few shots, the best on all.

Repeats of a drop say the same about a model's form, so early rounds look at few shots, chosen so
that every pair and, as far as it goes, every height takes part. Scores are compared only within one
set of shots. What a linear look promises puts the starts in order; it is a promise only, and where
the residual is many times the noise the usual sizes of every effect are tried beside it.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial

from analysis.aliases import Array
from analysis.diagnosis.basis.proposals import Proposal, amplitude_of, proposals, scopes_of
from analysis.diagnosis.candidate import (
    STEPS_FROM_NEAR,
    Refit,
    continued,
    explains_more_before,
    refit,
    refit_elsewhere,
    refitted,
)
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.multistart import (
    Start,
    below_a_ceiling,
    distinct,
    ends_the_signal,
    starts,
    where_it_rings,
)
from analysis.diagnosis.progress import MethodStep, Progress
from analysis.diagnosis.score_test import chance_of
from analysis.effects.effect import Effect
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.freed_inputs import cost_with_free_inputs
from analysis.fit.problem import JointProblem

FEW, MORE = 9, 18
"""Shots of the first two rounds: three spheres on three surfaces once, and at two heights. These
and the numbers below share out the time; all were chosen by trial, and no verdict asks for them."""
FEWEST = 3
"""Shots on which starts from afar are tried. Derived: as many as there are spheres, and surfaces,
so that each is there once. In six campaigns whose base left 4 to 5300 times the noise's variance
the right effect came first of these in five, and second in one. Of at most twice as many all are
taken, as three would spare less than half."""
FIRST_STEPS, SECOND_STEPS = 4, 8
"""Of a fit in each of these rounds."""
SHORTLIST = 7
"""Effects that are fitted where slopes can be trusted, the most promising ones."""
INTO_SECOND, INTO_LAST = 7, 3
"""Effects that are carried on to more shots, and to all."""
AFAR_KEPT, AFAR_STEPS = 4, 14
"""Starts of a form, and steps of each, where the way from afar is long."""
STEPS_ON_PART = 25
"""Of the present model's fit to a part of the shots: it begins at its best on all. Measured: of 35
such fits in seven campaigns 32 ended within 7 steps, one after 21, and two crept on past 100."""
ALWAYS_TRIED = 6
"""Effects that are fitted even where the first has left nothing for others to explain."""
RUNNERS_UP = 2
"""Of these, from afar, however much they leave: a reader asks what came next. A choice of time:
each takes 1 to 2 s."""


def ranked(
    present: PresentModel,
    tried: list[Proposal],
    progress: Progress,
    *,
    first: bool = True,
    alone: bool = False,
    whole: list[Refit] | None = None,
) -> list[Refit]:
    """Return library effects refitted on top of a model, best first.

    The first few are fitted to all shots and put into ``whole`` on the way; the rest, behind them,
    to a part of the shots, what they explain scaled to all. ``first``: nothing was added yet, and
    every effect is tried where slopes mislead.
    """
    places, everything = thinned(present.problem, FEW), list(range(len(present.problem.shots)))
    chi2 = sum(b.chi2 for b in present.fitted.blocks)
    samples = sum(item.expected_squares for item in present.problem.shots)
    bent = few_show_much(present.problem, present.fitted)
    far = chi2 > CRITERIA.far_squares_per_sample * samples
    if not bent:  # a few shots show too little of what is small, and slopes say all of it
        places = everything
    few, base = part_of(present.problem, present.fitted, places)
    tried = [*tried, *where_it_rings(few, base, tried)]
    entries = starts(linearise(few, base, tried, wanted=()), tried, alone=alone)
    order = list(entries) if bent and first else _short(entries)
    step = MethodStep.CANDIDATES if first else MethodStep.ON_TOP

    def told(what: str, share: float) -> None:
        """Tell what is being done, the step before it."""
        progress(step.told(what), share)

    part = Part(places, base)
    first_round = _FirstRound(present, few, part, entries, told)
    if far and len(places) > 2 * FEWEST:
        best, behind = first_round.from_afar(order)
    else:
        best, behind = first_round.from_near(order, bent=bent, far=far), []
    last = [] if whole is None else whole
    found = _later_rounds(present, best, part, told, last, bent=bent, far=far)
    return one_form_each([*found, *behind])


@dataclass(frozen=True)
class _FirstRound:
    """Effects fitted to few shots, until one leaves noise."""

    present: PresentModel
    few: JointProblem
    part: Part
    entries: dict[str, list[Start]]
    progress: Progress

    def from_near(self, order: list[str], *, bent: bool, far: bool) -> list[Refit]:
        """Return the best fit of each form of effects, from their own starts."""
        begins = self._begins(self.part) if far else []
        tries = partial(self._from_starts, bent=bent, begins=begins)
        best, tried, _ = self._until_noise([], order, tries)
        # who ties with what leaves noise is as near as that
        near = partial(self._from_starts, bent=False, begins=[])
        return [*best, *self._beside_it(order[tried:ALWAYS_TRIED], near)]

    def from_afar(self, order: list[str]) -> tuple[list[Refit], list[Refit]]:
        """Return the same of the effects that do best on three shots.

        Behind them what three shots make of the others, scaled to all. The effects that slopes put
        first are tried before the rest: they often are right.
        """
        places = different(self.present.problem, FEWEST)
        three = Part(places, part_of(self.present.problem, self.present.fitted, places)[1])
        on_three = partial(self._on_three, three, self._begins(three))
        forms: dict[str, list[Refit]] = {}

        def with_other_forms(effect_id: str) -> list[Refit]:
            """Return what three shots make of all forms of an effect."""
            return [*forms[effect_id], *on_three(effect_id, others=True)]

        carry = partial(self._carried, three, with_other_forms)
        best: list[Refit] = []
        moved: list[str] = []
        for group in filter(None, (order[:ALWAYS_TRIED], order[ALWAYS_TRIED:])):
            self.progress("fitting three shots from afar", 0.0)
            forms.update(zip(group, self.few.each(on_three, group), strict=True))
            left, likeliest = _likeliest_first(forms, moved)
            if not leaves_noise(likeliest.problem, likeliest.fitted):
                if len(forms) < len(order):
                    continue
                # another form may do best, whose effect's first one is far behind
                forms = dict(zip(order, self.few.each(with_other_forms, order), strict=True))
                carry = partial(self._carried, three, forms.__getitem__)
                left, likeliest = _likeliest_first(forms, moved)
            # as in the last round: what explains less than half does not lead on more shots
            least = CRITERIA.half * likeliest.score()
            more = [n for n in left[ALWAYS_TRIED:] if any(r.score() >= least for r in forms[n])]
            left = [*left[:ALWAYS_TRIED], *more]
            best, tried, explained = self._until_noise(best, left, partial(carry, steps=AFAR_STEPS))
            moved += left[:tried]
            if explained:
                near = partial(self._comes_near, three)
                rest = [
                    name
                    for at, name in enumerate(left[tried:ALWAYS_TRIED])
                    if at < RUNNERS_UP or any(map(near, forms[name]))
                ]
                moved += rest
                best += self._beside_it(rest, partial(carry, steps=SECOND_STEPS))
                break
        factor = len(self.present.problem.shots) / len(three.places)
        others = [r for name, own in forms.items() if name not in moved for r in own]
        return best, sorted((scaled(r, factor) for r in others), key=rank)

    def _until_noise(
        self, best: list[Refit], names: list[str], forms: Callable[[str], list[Refit]]
    ) -> tuple[list[Refit], int, bool]:
        """Return refits with those of effects, how many were tried, whether one leaves noise."""
        samples = sum(item.expected_squares for item in self.few.shots)
        tried_all = self.few.each(forms, names)
        tried, explained = 0, False
        while tried < len(names) and not explained:
            self.progress(f"trying {names[tried]}", 0.6 * tried / len(names))
            new = next(tried_all)
            best, leader = _leader_ended([*best, *new], new, self.part.base, samples)
            explained = leader is not None and leaves_noise(leader.problem, leader.fitted)
            tried += 1
        tried_all.close()  # the others need not go so far any more
        return best, tried, explained

    def _beside_it(self, names: list[str], forms: Callable[[str], list[Refit]]) -> list[Refit]:
        """Return refits of effects that are tried although another one has left noise."""
        found: list[Refit] = []
        tried_all = self.few.each(forms, names)
        for name in names:
            self.progress(f"trying {name}", 0.6)
            found += next(tried_all)
        return found

    def _from_starts(
        self, effect_id: str, *, bent: bool, begins: list[joint.Fitted]
    ) -> list[Refit]:
        """Return the best fit of each form of an effect from its own starts."""
        base, earlier = self.part.base, self.present.earlier.get(effect_id)
        own = self.entries[effect_id]
        begun = distinct(own, self.few, base, bent=bent, begins=begins, earlier=earlier)
        tries = [start.fitted(self.few, base, FIRST_STEPS) for start in begun]
        return _best_forms(tries, base, bent=bent, far=bool(begins))[0]

    def _begins(self, part: Part) -> list[joint.Fitted]:
        """Return where fits from afar begin: at the usual place, then below a signal's end."""
        usual = self.present.begin(part.places, part.base)
        return [usual, below_a_ceiling(self.present.problem.with_shots(part.places), usual)]

    def _on_three(
        self,
        part: Part,
        begins: list[joint.Fitted],
        effect_id: str,
        *,
        others: bool = False,
    ) -> list[Refit]:
        """Return an effect's first form, or each other, at its best on three shots.

        What is below the sphere has many valleys, and from one form's starts another's is found:
        all forms count as first.
        """
        three = self.present.problem.with_shots(part.places)
        entries, earlier = self.entries[effect_id], self.present.earlier.get(effect_id)
        name = min((start.proposal.effect.id for start in entries), key=len)
        first = [
            start.proposal.effect.structure is not None or start.proposal.effect.id == name
            for start in entries
        ]
        own = [start for start, is_first in zip(entries, first, strict=True) if is_first != others]
        begun = distinct(own, three, part.base, bent=True, begins=begins, earlier=earlier)
        tries = [start.fitted(three, part.base, FIRST_STEPS) for start in begun]
        best, second = _best_forms(tries, part.base, bent=True, far=True)
        # three shots may prefer a valley beside the right one
        return [*best, *second]

    def _comes_near(self, three: Part, found: Refit) -> bool:
        """Tell whether a refit leaves *little* of what three shots show beyond the noise."""
        noise = sum(self.present.problem.shots[at].expected_squares for at in three.places)
        return found.fitted.cost - noise < CRITERIA.little * (three.base.cost - noise)

    def _carried(
        self,
        three: Part,
        forms: Callable[[str], list[Refit]],
        effect_id: str,
        *,
        steps: int,
    ) -> list[Refit]:
        """Return all forms of an effect, carried on from three shots to the few.

        ``forms`` gives what three shots make of them.
        """
        return [
            refit_elsewhere(
                one,
                few=three.places,
                many=self.part.places,
                few_base=three.base,
                base=self.part.base,
                problem=self.few,
                max_iterations=steps,
                anchors=_anchors(self.present, three, self.part, one.effect, far=True),
            )
            for one in forms(effect_id)
        ]


def _likeliest_first(forms: Mapping[str, list[Refit]], moved: list[str]) -> tuple[list[str], Refit]:
    """Return which effects have not moved on, the likeliest first, and its best refit."""
    best = {name: min(own, key=rank) for name, own in forms.items() if name not in moved}
    left = sorted(best, key=lambda name: rank(best[name]))
    return left, best[left[0]]


def few_show_much(problem: JointProblem, fitted: joint.Fitted) -> bool:
    """Tell whether the few shots leave so much that slopes mislead there, and more are not needed.

    As much as so few have of it by the mean of all: their own squares scatter by as much.
    """
    few, whole = len(thinned(problem, FEW)), len(problem.shots)
    noise = sum(item.expected_squares for item in problem.shots)
    excess = sum(b.chi2 for b in fitted.blocks) - noise
    return excess * few / whole > CRITERIA.curved_squares


def _leader_ended(
    best: list[Refit], new: list[Refit], base: joint.Fitted, samples: float
) -> tuple[list[Refit], Refit | None]:
    """Return refits, and which of the new ones leads them; None if none does.

    A new leader is fitted further if it explains more than it leaves: only then is it known whether
    it leaves noise. One that still creeps is left at that.
    """
    leader = min((r for r in best if not r.at_bound), key=rank, default=None)
    if leader is None or not any(leader is one for one in new):
        return best, None
    if leader.fitted.converged or leader.gain < leader.fitted.cost - samples:
        return best, leader
    ended = continued(base, leader, max_iterations=AFAR_STEPS)
    kept = [ended if r is leader else r for r in best]
    return kept, None if ended.at_bound else ended


def leaves_noise(problem: JointProblem, fitted: joint.Fitted) -> bool:
    """Tell whether so little is left that it is no sign of more, stated numbers being uncertain."""
    samples = sum(item.window.signal.size for item in problem.shots)
    most = samples + chance_of(samples)
    return fitted.cost < most or cost_with_free_inputs(problem, fitted) < most


def rivals_refitted(
    problem: JointProblem, fitted: joint.Fitted, taken: Refit, effect_ids: set[str] | None = None
) -> list[Refit]:
    """Return other effects, by default of its slot, each form fitted to some shots, best first.

    From the most promising start of each form, with one size for all shots, or for the materials
    that the taken one acts on. The best few, and what is close to the taken one, go on to all.
    """
    tried = [
        p
        for p in proposals(problem)[0]
        if p.effect_id != taken.effect_id
        and (
            p.effect.slot == taken.effect.slot if effect_ids is None else p.effect_id in effect_ids
        )
    ]
    places, whole = thinned(problem, MORE), list(range(len(problem.shots)))
    few, base = part_of(problem, fitted, places)
    lead = base.cost - part_of(taken.problem, taken.fitted, places)[1].cost
    forms: dict[str, Start] = {}
    for own in starts(linearise(few, base, tried, wanted=()), tried).values():
        for start in own:
            if start.scope == "rig":
                forms.setdefault(start.proposal.effect.id, start)

    def on_few(start: Start) -> Refit:
        """Return a start fitted to some shots."""
        return _on_the_same(start, few, base, taken)

    found = sorted(few.each(on_few, list(forms.values())), key=rank)
    near, behind = found, []
    if len(places) < len(whole):
        near = [
            one
            for at, one in enumerate(found)
            if one.gain >= CRITERIA.half * lead
            and (at < INTO_LAST or lead - one.gain < CRITERIA.clear_lead)
        ]
        factor = len(whole) / len(places)
        behind = [scaled(one, factor) for one in found if all(one is not n for n in near)]

        carried = partial(on_all, problem=problem, base=fitted, part=(places, base))
        near = list(problem.each(carried, near))
    near.sort(key=rank)

    def ended(one: Refit) -> Refit:
        """Return a refit at its end."""
        return one if one.fitted.converged else continued(fitted, one)

    near[:INTO_LAST] = problem.each(ended, near[:INTO_LAST])
    return one_form_each([*sorted(near, key=rank), *sorted(behind, key=rank)])


def _on_the_same(start: Start, problem: JointProblem, fitted: joint.Fitted, taken: Refit) -> Refit:
    """Return a start of the rig, refitted on the materials that another effect acts on."""
    only = taken.effect.only
    if only is not None and only.kind not in scopes_of(start.proposal.effect):
        only = None
    return refit(
        problem,
        fitted,
        start.proposal,
        scope=only.kind if only else start.scope,
        coefficients={only.label if only else "": start.coefficients[""]},
        linear_gain=start.promised,
        only=only,
    )


def lookalikes_refitted(problem: JointProblem, fitted: joint.Fitted, taken: Refit) -> list[Refit]:
    """Return what an effect has to be told from beside the library, each fitted to all shots.

    Of free signals those that explain nearly as much before the trigger, where records are longer.
    """
    found = []
    for effect in effect_named(taken.effect_id).lookalikes:
        if effect.basis is not None and explains_more_before(problem.shots, taken.effect, effect):
            continue
        at = tuple(p.coordinate(p.starts[0]) for p in effect.parameters)
        proposal = Proposal(effect, effect.id, at, amplitude_of(effect))
        found.append(
            refit(
                problem,
                fitted,
                proposal,
                scope=scopes_of(effect)[0],
                coefficients={},
                linear_gain=0.0,
            )
        )
    return found


def _best_forms(
    tries: list[Refit], base: joint.Fitted, *, bent: bool, far: bool
) -> tuple[list[Refit], list[Refit]]:
    """Return the best start of each form of an effect, some steps further where slopes mislead.

    Behind them, from afar, the second-best starts.
    """
    best, second = [], []
    for form in sorted({r.effect.id for r in tries}):
        own = sorted((r for r in tries if r.effect.id == form), key=rank)
        if far and (own[0].effect.structure is not None or len(own[0].effect.parameters) > 1):
            # from afar the way is long, and the first steps do not show which start gets there
            own = [continued(base, r, max_iterations=AFAR_STEPS) for r in own[:AFAR_KEPT]]
            own.sort(key=rank)
            second += own[1:2]
        elif bent and not own[0].fitted.converged:
            own = [continued(base, own[0], max_iterations=SECOND_STEPS)]
        best.append(own[0])
    return best, second


def _short(entries: dict[str, list[Start]]) -> list[str]:
    """Return the groups worth a refit where slopes can be trusted."""
    order = [name for name, own in entries.items() if any(s.possible for s in own)]
    return order[:SHORTLIST] + [
        o for o in order[SHORTLIST:] if _slope_says_little(entries[o][0].proposal.effect)
    ]


def _slope_says_little(effect: Effect) -> bool:
    """Tell whether an effect changes everything at once, or nothing before a threshold."""
    return effect.structure is not None or any(p.threshold for p in effect.parameters)


def rank(found: Refit) -> tuple[bool, bool, float]:
    """Return what puts refits in order: physical ones first, then those fitted to all shots."""
    return not found.on_all_shots, found.at_bound, -found.score()


def _merit(found: Refit, factor: float) -> float:
    """Return the score that all shots would give; what left its range loses half of it."""
    score = found.score(factor=factor)
    weight = CRITERIA.half
    return weight * score if found.at_bound and score > 0 else score


def _anchors(
    present: PresentModel, few: Part, many: Part, effect: Effect, *, far: bool
) -> tuple[Array, Array] | None:
    """Return where shots' own parameters are before any fit, if that is the better guide."""
    if not far:
        return None
    found = []
    for part in (few, many):
        begin = present.begin(part.places, part.base)
        if ends_the_signal(effect):
            begin = below_a_ceiling(present.problem.with_shots(part.places), begin)
        found.append(begin.nuisances)
    return found[0], found[1]


def _later_rounds(
    present: PresentModel,
    best: list[Refit],
    part: Part,
    progress: Progress,
    last: list[Refit],
    *,
    bent: bool,
    far: bool,
) -> list[Refit]:
    """Carry the best on: some steps on more shots, then to the end on all, into ``last``."""
    problem, fitted = present.problem, present.fitted
    whole = len(problem.shots)
    factor = whole / len(part.places)
    first = sorted(best, key=lambda r: -_merit(r, factor))
    behind = [scaled(r, factor) for r in first[INTO_SECOND:]]
    second: list[Refit] = []
    more = thinned(problem, MORE if bent else whole)
    large, base_large = part_of(problem, fitted, more)

    def on_more(one: Refit) -> Refit:
        """Return a refit some steps further, on more shots."""
        if len(part.places) == whole:  # that is where it was fitted
            ended = one.fitted.converged
            return one if ended else continued(fitted, one, max_iterations=SECOND_STEPS)
        return refit_elsewhere(
            one, few_base=part.base, few=part.places, many=more, problem=large, base=base_large,
            max_iterations=SECOND_STEPS,
            anchors=_anchors(present, part, Part(more, base_large), one.effect, far=far),
        )  # fmt: skip

    further = problem.each(on_more, first[:INTO_SECOND])
    for at, one in enumerate(first[:INTO_SECOND]):
        progress(f"refining {one.effect_id}", 0.6 + 0.2 * at / INTO_SECOND)
        second.append(next(further))
    factor = whole / len(more)
    second.sort(key=lambda r: -_merit(r, factor))
    lead = max((_merit(r, factor) for r in second), default=0.0)
    everything = list(range(whole))
    kept = [
        one
        for at, one in enumerate(second)
        if at < INTO_LAST and _merit(one, factor) >= CRITERIA.half * lead
    ]
    behind += [scaled(one, factor) for one in second if all(one is not k for k in kept)]

    def on_all(one: Refit) -> Refit:
        """Return a refit on all shots, at its end."""
        moved = one
        if len(more) < whole:
            moved = refit_elsewhere(
                one, few_base=base_large, few=more, many=everything, problem=problem, base=fitted,
                max_iterations=STEPS_FROM_NEAR,
                anchors=_anchors(
                    present, Part(more, base_large), Part(everything, fitted), one.effect, far=far
                ),
            )  # fmt: skip
        return moved if moved.fitted.converged else continued(fitted, moved)

    ended = problem.each(on_all, kept)
    for at, one in enumerate(kept):
        progress(f"refining {one.effect_id} on all shots", 0.8 + 0.2 * at / INTO_LAST)
        last.append(next(ended))
    return one_form_each([*sorted(last, key=rank), *sorted(behind, key=rank)])


def one_form_each(refits: list[Refit]) -> list[Refit]:
    """Return the refits without an effect's lesser forms."""
    found: dict[str, Refit] = {}
    for one in refits:
        found.setdefault(one.effect_id, one)
    return list(found.values())


def scaled(found: Refit, factor: float) -> Refit:
    """Return a refit on a part of the shots with the gain that all would give."""
    own = round(found.own * factor)
    count = found.parameters - found.own + own
    return dataclasses.replace(
        found, gain=found.gain * factor, parameters=count, own=own, on_all_shots=factor == 1.0
    )


def thinned(problem: JointProblem, count: int) -> list[int]:
    """Return the places of shots that stand for all.

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


def different(problem: JointProblem, count: int) -> list[int]:
    """Return the places of shots that differ most: in sphere and surface, then in height."""
    chosen: list[int] = []
    seen: Counter[object] = Counter()
    for _ in range(min(count, len(problem.shots))):

        def known(place: int) -> tuple[int, int, int]:
            """Return how often a shot's materials and height have been chosen."""
            sphere, surface, height = problem.shots[place].condition
            return seen["sphere", sphere] + seen["surface", surface], seen["height", height], place

        place = min((i for i in range(len(problem.shots)) if i not in chosen), key=known)
        chosen.append(place)
        kinds = ("sphere", "surface", "height")
        seen.update(zip(kinds, problem.shots[place].condition, strict=True))
    return sorted(chosen)


def part_of(
    problem: JointProblem, fitted: joint.Fitted, places: list[int]
) -> tuple[JointProblem, joint.Fitted]:
    """Return a campaign of some of the shots, the same model fitted to them."""
    if len(places) == len(problem.shots):
        return problem, fitted
    few = problem.with_shots(places)
    begin = fitted.nuisances[places]
    return few, joint.fit_to_compare(
        few, begin, theta=fitted.theta, max_iterations=STEPS_ON_PART
    )  # fmt: skip


def refit_of_part(
    problem: JointProblem, base: joint.Fitted, found: Refit, places: list[int]
) -> tuple[JointProblem, joint.Fitted, Refit]:
    """Return a part of the shots, the model without an effect fitted to it, and the one with it."""
    few, few_base = part_of(problem, base, places)
    larger, fitted = part_of(found.problem, found.fitted, places)
    known = dataclasses.replace(found, problem=larger, fitted=fitted)
    return few, few_base, refitted(known, few, few_base)


def on_all(
    found: Refit, problem: JointProblem, base: joint.Fitted, part: tuple[list[int], joint.Fitted]
) -> Refit:
    """Return a refit of some shots fitted to all; ``part`` has their places and their base fit."""
    places, few_base = part
    return refit_elsewhere(
        found,
        few=places,
        many=list(range(len(problem.shots))),
        few_base=few_base,
        base=base,
        problem=problem,
        max_iterations=STEPS_FROM_NEAR,
    )


def better_on_part(
    problem: JointProblem,
    base: joint.Fitted,
    found: Refit,
    search: Callable[[JointProblem, joint.Fitted, Refit], Refit],
) -> Refit:
    """Return what a search makes of a refit on shots that stand for all, then fitted to all.

    There it must be ahead again; else ``found`` itself. The search gets problem, base and refit on
    these shots, and returns that refit where it finds nothing better.
    """
    places = thinned(problem, MORE)
    few, few_base, known = refit_of_part(problem, base, found, places)
    best = search(few, few_base, known)
    if best is known:
        return found
    whole = on_all(best, problem, base, (places, few_base))
    if best.common > 0.0:  # of what one size for these shots takes up, as much more as of the whole
        whole = dataclasses.replace(whole, common=best.common * whole.gain / best.gain)
    return whole if not whole.at_bound and whole.score() > found.score() else found


def as_good_on_part(
    problem: JointProblem,
    base: joint.Fitted,
    found: Refit,
    others: Callable[[JointProblem, joint.Fitted, Refit], Iterable[Refit]],
) -> list[Refit]:
    """Return refits that shots which stand for all do not tell from one, fitted to all.

    ``others`` gets problem, base and refit on these shots, and makes the refits to compare it with.
    """
    places = thinned(problem, MORE)
    few, few_base, known = refit_of_part(problem, base, found, places)
    near = [
        one
        for one in others(few, few_base, known)
        if not one.at_bound and known.score() - one.score() < CRITERIA.least_lead
    ]
    carried = partial(on_all, problem=problem, base=base, part=(places, few_base))
    return [one for one in problem.each(carried, near) if not one.at_bound]


@dataclass(frozen=True)
class PresentModel:
    """What a turn stands on."""

    problem: JointProblem
    fitted: joint.Fitted
    """The present model at its best on all shots."""
    usual: joint.Fitted
    """The base model at what was known before, for all shots."""
    earlier: Mapping[str, Refit] = field(default_factory=dict)
    """By effect what an earlier turn fitted of it, on top of less: where to look first now."""

    def begin(self, places: list[int], base: joint.Fitted) -> joint.Fitted:
        """Return where a far start begins on some shots: usual place, present effects as fitted."""
        theta = base.theta.copy()
        theta[: self.usual.theta.size] = self.usual.theta
        nuisances = base.nuisances.copy()
        nuisances[:, : self.usual.nuisances.shape[1]] = self.usual.nuisances[places]
        return dataclasses.replace(base, theta=theta, nuisances=nuisances)


@dataclass(frozen=True)
class Part:
    """Some of the shots, and the present model fitted to them."""

    places: list[int]
    base: joint.Fitted
