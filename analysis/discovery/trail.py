"""The trail: which effects, one on top of the other, until the residual is noise or nothing helps.

A first effect that takes up most is usually right where one effect acts. Where two act, each large,
the one that takes up most may be neither; so a few first effects get a second one each before
the search gives up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from analysis.discovery.candidates import Refit
from analysis.discovery.criteria import CRITERIA
from analysis.discovery.divided import divided
from analysis.discovery.evidence import Evidence, gather
from analysis.discovery.isolated import (
    can_be_one_materials,
    explains_all,
    isolated,
    tried_alone,
)
from analysis.discovery.left_out import LeftOut, left_out
from analysis.discovery.method_steps import MethodStep, Progress
from analysis.discovery.omnibus import Omnibus, ask
from analysis.discovery.parts import Ground
from analysis.discovery.proposals import Proposal, proposals
from analysis.discovery.ranking import one_form_each, rank, ranked
from analysis.discovery.reformed import reformed
from analysis.discovery.time_budget import BudgetSpentError, unwatched
from analysis.discovery.widened import widened
from analysis.fit import joint
from analysis.fit.freed_inputs import at_likeliest_inputs
from analysis.fit.physical_range import out_of_range
from analysis.fit.problem import JointProblem

MAX_EFFECTS = 3
FIRSTS_TRIED = 2
"""First effects that get a second one before the search gives up."""
HUM = "mains_hum"


@dataclass
class Step:
    """One turn of the loop.

    Attributes
    ----------
    problem, fitted : JointProblem, Fitted
        The model of this turn, at its best.
    evidence : Evidence
        Its residual.
    omnibus : Omnibus
        Whether there is structure.
    refits : list of Refit
        What was tried on top, best first.
    refused : dict
        Why other effects could not be tried.
    without : list of LeftOut
        The same model without each material's shots, where that was asked.
    unfinished : bool
        The time was over before all that can be tried was compared.
    """

    problem: JointProblem
    fitted: joint.Fitted
    evidence: Evidence
    omnibus: Omnibus
    refits: list[Refit] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    without: list[LeftOut] = field(default_factory=list)
    unfinished: bool = False

    @property
    def impossible(self) -> bool:
        """Whether one of its numbers is outside what it can be."""
        return bool(out_of_range(self.problem, self.fitted))


@dataclass
class Trail:
    """Steps, and the effects that lead from each to the next.

    Attributes
    ----------
    steps : list of Step
        One more than effects.
    chosen : list of Refit
        In order.
    """

    steps: list[Step]
    chosen: list[Refit]

    @property
    def last(self) -> Step:
        """Return the step that the trail has reached."""
        return self.steps[-1]

    @property
    def adequate(self) -> bool:
        """Whether the trail has ended in noise, or in less than its effects' forms are good for.

        A model with a number that nothing can have does not count, whatever it leaves.
        """
        if self.last.impossible:
            return False
        if not self.last.omnibus.structured:
            return True
        left = self.last.omnibus.left
        explained = self.steps[0].fitted.cost - self.last.fitted.cost
        return bool(self.chosen) and left < min(
            CRITERIA.structure.form_error_share * explained, CRITERIA.structure.form_error_squares
        )

    @property
    def score(self) -> float:
        """Return the whitened squares left, numbers paid for."""
        paid = sum(r.gain - r.score() for r in self.chosen)
        return self.last.fitted.cost + paid

    def on(self, found: Refit) -> Trail:
        """Return the trail one effect further, its numbers owned by whom the data ask for."""
        step = look(found.problem, found.fitted)
        if step.omnibus.structured:
            wide = reformed(self.last.problem, self.last.fitted, found)
            wide = widened(self.last.problem, self.last.fitted, wide)
            lead = wide.score() - found.score()
            if lead > 0.0:
                wider = look(wide.problem, wide.fitted)
                # where the same effect ends in noise it needs no lead
                if lead > CRITERIA.comparison.least_lead or not wider.omnibus.structured:
                    found, step = wide, wider
        return Trail([*self.steps, step], [*self.chosen, found])


def look(problem: JointProblem, fitted: joint.Fitted) -> Step:
    """Return a fitted model with the answer to whether its residual is noise.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        The model at its best.

    Returns
    -------
    Step
        Nothing tried on top yet.

    Notes
    -----
    Made to its end whatever the time: what was fitted is worth nothing without it. What masses,
    radii and heights explain that differ from their statements by what these allow is no structure:
    such an answer is that of the fit in which they are where the shots put them.
    """
    whole = unwatched(problem)
    evidence = gather(whole, fitted)
    found = Step(problem, fitted, evidence, ask(evidence))
    if not found.omnibus.structured or joint.is_hopeless(problem, fitted.cost):
        return found
    settled, near = at_likeliest_inputs(whole, fitted)
    if settled is whole:
        return found  # every number is exact
    evidence = gather(settled, near)
    freed = ask(evidence)
    return found if freed.structured else Step(problem, fitted, evidence, freed)


def try_effects(step: Step, usual: joint.Fitted, progress: Progress) -> None:
    """Fill in what library effects bring on top of a step, as far as the time goes."""
    found: list[Refit] = []
    try:
        _compare(step, usual, progress, found)
    except BudgetSpentError:
        step.unfinished = True
        raise
    finally:
        step.refits += one_form_each(sorted(found, key=rank))


def _compare(step: Step, usual: joint.Fitted, progress: Progress, found: list[Refit]) -> None:
    """Fit library effects on top of a step, each into ``found`` once it is fitted to all shots."""
    tried: list[Proposal]
    tried, step.refused = proposals(step.problem)
    ground = Ground(step.problem, step.fitted, usual)
    first = not step.problem.model.effects
    at = MethodStep.CANDIDATES if first else MethodStep.ON_TOP
    progress(at.told("does one material make the difference?"), 0.0)
    step.without = left_out(ground)
    for apart in isolated(ground, step.without):
        found += tried_alone(apart, ground, progress, first=first)
        found.sort(key=rank)
        tried = [p for p in tried if not can_be_one_materials(p.effect)]
        if found and explains_all(found[0], ground):
            tried = []
        if found and (not tried or _ends_in_noise(found[0])):
            break
    if not tried:
        return
    whole: list[Refit] = []
    try:
        found += ranked(ground, tried, progress, first=first, whole=whole)
    except BudgetSpentError:
        found += whole
        raise


def _ends_in_noise(found: Refit) -> bool:
    return found.usable and not look(found.problem, found.fitted).omnibus.structured


def useful(step: Step) -> list[Refit]:
    """Return the refits of a step that may be taken, best first."""
    return [r for r in step.refits if r.usable and r.score() >= CRITERIA.comparison.least_lead]


def follow(
    start: Trail, usual: joint.Fitted, progress: Progress, reached: list[Trail] | None = None
) -> Trail:
    """Search for effects on top of where a trail stands.

    Parameters
    ----------
    start : Trail
        Structured at its end.
    usual : Fitted
        The base model at what was known before any record.
    progress : callable
        Told what is being done and a share between 0 and 1.
    reached : list of Trail, optional
        Filled with trails on the way: what is left where the time is over before the end.

    Returns
    -------
    Trail
        The first that ends in noise, fewest effects first; else the best that was found.
    """
    found: list[Trail] = [] if reached is None else reached
    try_effects(start.last, usual, progress)
    firsts = useful(start.last)
    for first in firsts[:1]:
        progress(MethodStep.COMPARE.told(f"forms and groupings of {first.owner}"), 0.9)
        found.append(start.on(first))
    if found and (found[0].adequate or len(start.chosen) + 2 > MAX_EFFECTS):
        return found[0]
    apart = _divided(start, usual, progress)
    if apart is not None and (apart.adequate or not found):
        return apart
    if not found:
        return start
    for place, first in enumerate(firsts[:FIRSTS_TRIED]):
        if first.gain < CRITERIA.stepwise.first_effect_share * firsts[0].gain:
            break
        found.append(_with_second(found[0] if place == 0 else start.on(first), usual, progress))
        if found[-1].adequate:
            return found[-1]
    best = min(found, key=lambda t: t.score)
    if len(best.chosen) < MAX_EFFECTS and _nearly(start, best):
        third = _with_second(best, usual, progress)
        # the third of a chain is where what the first two leave for their forms would get a name
        return best if third.last.omnibus.structured else third
    return best


def _divided(start: Trail, usual: joint.Fitted, progress: Progress) -> Trail | None:
    """Return a trail of two effects of which one is one material's, None where there is none."""

    def alone(
        problem: JointProblem, fitted: joint.Fitted, place: joint.Fitted, told: Progress
    ) -> Refit | None:
        some = Trail([look(problem, fitted)], [])
        if some.adequate:
            return None  # then that material makes all the difference, and was tried alone
        try_effects(some.last, place, told)
        for first in useful(some.last)[:FIRSTS_TRIED]:
            one = some.on(first)
            if one.adequate:
                return one.chosen[-1]
        return None

    ground = Ground(start.last.problem, start.last.fitted, usual)
    found = divided(ground, start.last.without, alone, progress)
    if found is None:
        return None
    first, seconds = found
    step = look(first.problem, first.fitted)
    step.refits += seconds
    trail = Trail([*start.steps, step], [*start.chosen, first])
    second = useful(step)[:1]
    return trail.on(second[0]) if second else None


def _with_second(trail: Trail, usual: joint.Fitted, progress: Progress) -> Trail:
    """Return a trail with what helps most on top; the trail itself where nothing does."""
    if not trail.adequate:
        try_effects(trail.last, usual, progress)
        found = useful(trail.last)
        if found:
            return trail.on(found[0])
    return trail


def _nearly(start: Trail, end: Trail) -> bool:
    """Tell whether a trail has taken up so much that one more effect could be the rest."""
    samples = sum(s.white.size for s in start.last.evidence.shots)
    had, left = start.last.evidence.chi2 - samples, end.last.evidence.chi2 - samples
    return left < CRITERIA.stepwise.third_effect_share * had
