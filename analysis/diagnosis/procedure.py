"""The loop: fit, ask, name, repair, ask again; and say so when nothing fits."""

from __future__ import annotations

import contextlib
import dataclasses
from dataclasses import dataclass, field
from functools import cached_property, partial

from analysis.aliases import Array
from analysis.base_models import DEFAULT_BASE, RINGING_BASES
from analysis.campaign import Campaign
from analysis.diagnosis.backward_elimination import (
    each_held_against_others,
    forms_not_told_apart,
    held_against_others,
    not_held_against,
)
from analysis.diagnosis.base_choice import (
    FIRST_LOOK,
    base_beside_effect,
    effect_leads,
    fitted_base,
    mixed_base,
    stated,
)
from analysis.diagnosis.candidate import Refit, refitted
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.each_alone import is_inside_shots
from analysis.diagnosis.forward_selection import FIRSTS_TRIED, try_effects, useful
from analysis.diagnosis.localisation import Located, locate
from analysis.diagnosis.marginal_likelihood import Price
from analysis.diagnosis.mistakes import Mistake, Named, named_mistake, repeated_in_time
from analysis.diagnosis.model_free import Shown, left_by_model, shown_by_records
from analysis.diagnosis.multistart import extended_like, usual_place
from analysis.diagnosis.next_drop import NextDrop, propose
from analysis.diagnosis.noise_check import Background, check_noise
from analysis.diagnosis.odd_shots import Rest, SetAside, count_as_noise, without_odd_shots
from analysis.diagnosis.one_material import without_each_material
from analysis.diagnosis.progress import (
    BudgetSpentError,
    MethodStep,
    Progress,
    TimeBudget,
    Watch,
    unwatched,
)
from analysis.diagnosis.search_on_part import (
    left_open_on_part,
    no_effect_explains_part,
    searched_on_part,
)
from analysis.diagnosis.selection import OpenNames, Selection, Step
from analysis.diagnosis.successive_halving import (
    PresentModel,
    leaves_noise,
    rank,
)
from analysis.diagnosis.uncertain_numbers import (
    exact_refit,
    with_numbers_as_stated,
    with_uncertain_numbers,
)
from analysis.effects.library import effect_named, library
from analysis.fit import joint
from analysis.fit.below_one import fit_from_start
from analysis.fit.cores import ONE_CORE, Cores
from analysis.fit.physical_range import out_of_range
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model import solver
from analysis.undetermined import tells_no_modulus

SLOT = "electronics"
"""Where what is on the line all the time gets in."""
RECORD = "record"
"""The slot of what was written down wrong, or changed under way."""


@dataclass(frozen=True)
class Diagnosis:
    """What was found."""

    verdict: str
    """adequate, identified, family, partial, unknown or not_identifiable."""
    steps: list[Step]
    """The selection; the last step is the model that stands."""
    chosen: list[Refit]
    """The effects that were added, in order."""
    rivals: dict[str, list[Refit]] = field(default_factory=dict)
    """For each effect chosen that has some, the refits that the data cannot tell from it."""
    forms_as_good: dict[str, list[Refit]] = field(default_factory=dict)
    """For each effect chosen that has some, other forms of its law that the data cannot tell from
    the one taken."""
    open_names: OpenNames = field(default_factory=dict)
    """For each effect that has some, the names it was not held against, as the time was over."""
    slot: str | None = None
    located: Located | None = None
    """Where it lives and the learned discrepancy, where no name explains all."""
    next_drop: NextDrop | None = None
    """The drop that would tell the likeliest names apart."""
    check_noise: Background | None = None
    """What is on the line all the time; None where nobody looked."""
    set_aside: tuple[SetAside, ...] = ()
    """Shots that do not belong; the last steps rest on the others."""
    mistakes: tuple[Mistake, ...] = ()
    """A mistake of the record that explains all, then those that cannot be told from it."""
    effects_as_good: tuple[str, ...] = ()
    """Ids of effects that explain as much as that mistake."""
    shown: tuple[Shown, ...] = ()
    """What the records show of the effects that were named, where no fit could name them."""
    base_asked: str | None = None
    """The base model that was asked for; None where the records chose it."""
    watch: Watch = field(default_factory=Watch)
    """Knows whether the search ended early."""

    @property
    def search_ended(self) -> bool:
        """Whether the search for names came to its end."""
        return self.watch.ended is None or self.watch.ended.verdict_stands

    @property
    def disturbed(self) -> bool:
        """Whether something is on the line all the time that is no noise."""
        return self.check_noise is not None and self.check_noise.clear

    @property
    def leaves_noise(self) -> bool:
        """Whether the model that stands leaves noise, and nothing else is on the line either."""
        return self.verdict not in ("partial", "unknown")

    @property
    def confusable(self) -> list[str]:
        """Return ids that the data cannot tell from those that were named."""
        return sorted(
            {name for effect_id in self.effect_ids for name in self.confusable_with(effect_id)}
        )

    @property
    def effect_ids(self) -> list[str]:
        """Return the ids of the effects that were named."""
        return [taken.effect_id for taken in self.chosen]

    def confusable_with(self, effect_id: str) -> list[str]:
        """Return ids that the data cannot tell from a named one, or that nobody compared."""
        near = [r.effect_id for r in self.rivals.get(effect_id, [])]
        return [*near, *(o for o in self.open_names.get(effect_id, []) if o not in near)]


def diagnose_campaign(
    campaign: Campaign,
    base: str | None = None,
    *,
    progress: Progress | None = None,
    budget: TimeBudget | None = None,
    cores: Cores = ONE_CORE,
) -> Diagnosis:
    """Close the loop on a campaign.

    It starts from the model ``base``; by default from the closed one, or from the paper's where the
    records obey that. The base fit is made whatever the budget. ``progress`` is told what is being
    done and a share between 0 and 1.
    """
    told = Watch(progress, budget, cores)
    found = dataclasses.replace(_found(campaign, base, told), base_asked=base, watch=told)
    told(MethodStep.VERDICT.told("what may be claimed?"), 0.97)
    told.judged = True
    told(MethodStep.NEXT_DROP.told("which would tell most?"), 0.98)
    with contextlib.suppress(BudgetSpentError):
        found = dataclasses.replace(found, next_drop=_next_drop(found))
    return found


def _found(campaign: Campaign, base: str | None, told: Watch) -> Diagnosis:
    """Return the verdict, and what it rests on."""
    selection, usual = fitted_base(campaign, base or DEFAULT_BASE, told)
    reasons = _OtherReasons(selection.last, usual, told)
    if base is None and not selection.adequate:
        with contextlib.suppress(BudgetSpentError):
            selection, usual = _obeyed_base(campaign, selection, reasons)
    if tells_no_modulus(selection.last.problem, selection.last.fitted):
        told(MethodStep.STRUCTURE.told("no modulus can be told; what else do they show?"), 0.05)
    if selection.last.problem.model.kind == solver.HSD and not selection.adequate:
        told(MethodStep.STRUCTURE.told("or does the cell ring?"), 0.06)
        with contextlib.suppress(BudgetSpentError):
            selection, usual = _crystal(campaign, selection, usual, told)
    seen = check_noise(selection.last.problem.shots)
    if _is_all(seen, selection.last):
        selection.last.refused = dict.fromkeys(
            library(), "what is on the line anyway may look like it"
        )
        verdict = "partial" if selection.chosen else "unknown"
        return Diagnosis(verdict, selection.steps, selection.chosen, slot=SLOT, check_noise=seen)
    if selection.last.impossible and not selection.last.structured:
        # noise is left, but by a model that nothing real can be: the data cannot show it
        return Diagnosis("not_identifiable", selection.steps, selection.chosen, check_noise=seen)
    set_aside: tuple[SetAside, ...] = ()
    if not selection.adequate:
        with contextlib.suppress(BudgetSpentError):
            selection = _with_what_shows(selection, usual)
    rest, usual_of_rest = selection, usual
    reasons = reasons.beside(selection.last, usual)
    inside = not selection.adequate and reasons.is_inside_shots
    if not (selection.adequate or inside):
        with contextlib.suppress(BudgetSpentError):
            rest, usual_of_rest, set_aside = _without_odd_shots(selection, reasons)
    found = rest if rest.adequate else with_uncertain_numbers(rest)
    # one mistake is less than several odd shots
    if not (rest.adequate or inside) or len(set_aside) > 1:
        with contextlib.suppress(BudgetSpentError):
            free = found if rest is selection else with_uncertain_numbers(selection)
            mistaken = _mistaken(selection, free, reasons)
            if mistaken is not None:
                return _beside(seen, mistaken)
    may_differ = base is None and rest is selection
    begin = _on_obeyed_base(campaign, rest, found, usual_of_rest, told) if may_differ else None
    rest, found, usual_of_rest = begin or (rest, found, usual_of_rest)
    judged = _searched(rest, found, usual_of_rest, seen, told)
    return dataclasses.replace(_beside(seen, judged), set_aside=set_aside)


def _on_obeyed_base(
    campaign: Campaign, start: Selection, found: Selection, usual: joint.Fitted, told: Watch
) -> tuple[Selection, Selection, joint.Fitted] | None:
    """Return where the search begins if an effect hid which base the records obey, else None."""
    if start.chosen or start.last.problem.model.base_name not in RINGING_BASES:
        return None
    with contextlib.suppress(BudgetSpentError):
        return base_beside_effect(campaign, (found, usual), told)
    return None


def _searched(
    start: Selection, found: Selection, usual: joint.Fitted, seen: Background, told: Watch
) -> Diagnosis:
    """Return the verdict after the search for effects; ``found`` is what it begins with."""
    if not found.adequate:
        found = searched_on_part(found, usual, told)
    if not found.adequate:
        with contextlib.suppress(BudgetSpentError):
            both = _effect_and_mistake(start, found, told)
            if both is not None:
                return both
    return _but_for_the_line(found, start, seen) or _judge(found, start, usual, told)


def _but_for_the_line(found: Selection, start: Selection, seen: Background) -> Diagnosis | None:
    """Return the verdict where effects leave no more than what is on the line anyway, else None.

    ``start`` is where the search began. What is beyond the first effects that leave no more is not
    named.
    """
    if not seen.clear:
        return None
    first = len(start.chosen)
    for count in range(first + 1, len(found.chosen) + 1):
        step = found.steps[count]
        if step.structured and not step.impossible and _is_all(seen, step):
            less = Selection(found.steps[: count + 1], found.chosen[:count])
            exact = with_numbers_as_stated(less, start)
            slot = exact.chosen[first].effect.slot
            return Diagnosis("partial", exact.steps, exact.chosen, slot=slot)
    return None


@dataclass(frozen=True)
class _OtherReasons:
    """What beside an effect may be the reason of what a base leaves; each is asked once."""

    step: Step
    usual: joint.Fitted
    told: Watch

    def beside(self, step: Step, usual: joint.Fitted) -> _OtherReasons:
        """Return the same for another model; itself where it is this one."""
        return self if step is self.step else _OtherReasons(step, usual, self.told)

    @cached_property
    def is_inside_shots(self) -> bool:
        """Whether what is left is inside single shots, and so neither of the others."""
        return is_inside_shots(self.step, self.usual)

    @cached_property
    def rest(self) -> Rest | None:
        """The base without shots that do not belong; None where there are none."""
        return without_odd_shots(self.step, self.usual, self.told)

    @cached_property
    def mistake(self) -> Named | None:
        """The mistake that explains all; None where there is none."""
        name = self.step.problem.model.base_name
        return named_mistake(self.step, partial(_restated, base=name, told=self.told), self.told)

    @cached_property
    def is_one_materials(self) -> bool:
        """Whether the base leaves noise where one material's shots are left out."""
        present = PresentModel(self.step.problem, self.step.fitted, self.usual)
        without = without_each_material(present)
        return any(leaves_noise(one.problem, one.fitted) for one in without)

    @property
    def explain(self) -> bool:
        """Whether one material, shots that do not belong or one mistake explain what a base leaves.

        A material that loses much bends all shots that share its numbers; one shot with a wrong
        label bends a few, as another law would; a coupon whose mass lacks a digit seems not to ride
        on the crystal.
        """
        if self.is_one_materials:
            return True
        if self.is_inside_shots:
            return False
        return self.rest is not None or self.mistake is not None


def _mistaken(selection: Selection, free: Selection, reasons: _OtherReasons) -> Diagnosis | None:
    """Return the verdict that a mistake of the record explains all, None where an effect may.

    A mistake that was not compared with all effects, as the time was over, is one of a family.
    ``free`` is the selection with stated numbers uncertain, on which effects are compared.
    """
    named, usual, told = reasons.mistake, reasons.usual, reasons.told
    if named is None:
        return None
    as_good, compared = [], True
    in_time = named.best.in_time and repeated_in_time(selection.last.problem)
    try:
        alone = in_time or named.best.is_discrete
        if not (alone or no_effect_explains_part(free, usual, told)):
            try_effects(free.last, usual, told)
        for one in useful(free.last)[:1]:
            effect = free.on(one)
            ahead = named.best.cost - (effect.last.fitted.cost + one.gain - one.score())
            if effect.adequate and ahead > CRITERIA.least_lead:
                return None
            if effect.adequate and ahead > -CRITERIA.least_lead:
                as_good.append(one.effect_id)
    except BudgetSpentError:
        compared = False
    verdict = "identified" if compared and not as_good and not named.near else "family"
    return Diagnosis(
        verdict,
        [*with_numbers_as_stated(free, selection).steps, named.step],
        selection.chosen,
        slot=RECORD,
        mistakes=(named.best, *named.near),
        effects_as_good=tuple(as_good),
    )


def _effect_and_mistake(start: Selection, found: Selection, told: Watch) -> Diagnosis | None:
    """Return the verdict that one effect and one mistake of the record explain all, else None.

    ``found`` was searched from ``start``; the effects that scored most there are tried.
    """
    campaign = start.last.problem.campaign
    kept = {id(item.shot) for item in start.last.problem.shots}
    campaign = dataclasses.replace(
        campaign, shots=tuple(shot for shot in campaign.shots if id(shot) in kept)
    )
    tried = [r for r in found.steps[len(start.steps) - 1].refits if not (r.at_bound or r.own)]
    ways: list[tuple[float, Refit, Named]] = []
    for first in sorted(tried, key=lambda r: -r.score())[:FIRSTS_TRIED]:
        fit = partial(_refitted, start=start, like=first)
        problem, fitted = fit(campaign, nuisances=first.fitted.nuisances)
        whole = refitted(
            dataclasses.replace(first, problem=problem, fitted=fitted, on_all_shots=True),
            start.last.problem,
            start.last.fitted,
        )
        named = None if fitted.failed else named_mistake(Step(problem, fitted), fit, told)
        if named is not None:
            ways.append((named.best.cost + whole.gain - whole.score(), whole, named))
    if not ways:
        return None
    least, taken, named = min(ways, key=lambda way: way[0])
    near = [
        # as it is without the mistake: with it, the moduli are those of a misfit
        dataclasses.replace(other, problem=beside.step.problem, fitted=beside.step.fitted)
        for cost, other, beside in ways
        if other is not taken and cost - least < CRITERIA.least_lead
    ]
    return Diagnosis(
        "family" if near or named.near else "identified",
        [*start.steps, Step(taken.problem, taken.fitted), named.step],
        [*start.chosen, taken],
        {taken.effect_id: near} if near else {},
        slot=taken.effect.slot,
        mistakes=(named.best, *named.near),
    )


def _refitted(
    campaign: Campaign, *, start: Selection, like: Refit, nuisances: Array | None = None
) -> tuple[JointProblem, joint.Fitted]:
    """Return the model of a start with one more effect, fitted to a campaign stated otherwise.

    ``nuisances`` are where the shots' own numbers begin; as prepared where they are None, or those
    of a part of the shots.
    """
    last = start.last.problem
    problem, prepared = with_start(build(campaign, last.model))
    problem = dataclasses.replace(problem, checkpoint=last.checkpoint, cores=last.cores)
    larger, theta, prepared = extended_like(problem, prepared, like)
    own = prepared if nuisances is None or nuisances.shape != prepared.shape else nuisances
    return larger, joint.fit(larger, own, theta=theta)


def _without_odd_shots(
    selection: Selection, reasons: _OtherReasons
) -> tuple[Selection, joint.Fitted, tuple[SetAside, ...]]:
    """Return the selection and its usual place without shots that do not belong, and those."""
    rest, usual = reasons.rest, reasons.usual
    if rest is None:
        return selection, usual, ()
    usual = dataclasses.replace(usual, nuisances=usual.nuisances[rest.kept])
    return Selection([*selection.steps[:-1], rest.step], selection.chosen), usual, rest.set_aside


def _restated(campaign: Campaign, base: str, told: Watch) -> tuple[JointProblem, joint.Fitted]:
    """Return the base model fitted to a campaign that is stated otherwise."""
    problem, nuisances = with_start(stated(campaign, base))
    fitted = fit_from_start(problem, nuisances)
    return told.over(problem), fitted


def _obeyed_base(
    campaign: Campaign, selection: Selection, reasons: _OtherReasons
) -> tuple[Selection, joint.Fitted]:
    """Return the selection and its usual place under the ringing base that the records obey.

    The default's, unless another leads by more than chance, where the noise is as wide as what that
    leaves: whatever else acts, closed rigs and the paper's were 5e5 squares apart and more. What
    leaves noise of most shots is obeyed by all, and the others have another reason. Before that the
    bases between these two are asked (`mixed_base`).
    """
    mixed, usual, told = mixed_base(selection.last), reasons.usual, reasons.told
    if mixed is not None and not reasons.explain:
        start = fitted_base(campaign, mixed, told)
        mimicked = not start[0].adequate and effect_leads((selection, usual), start, told)
        return (selection, usual) if mimicked else start
    if 2 * count_as_noise(selection.last) > len(selection.last.problem.shots):
        return selection, usual
    for name in RINGING_BASES[1:]:
        problem, nuisances = with_start(stated(campaign, name))
        fitted = joint.fit(problem, nuisances, max_iterations=FIRST_LOOK)
        samples = sum(item.expected_squares for item in selection.last.problem.shots)
        least = CRITERIA.least_lead * max(1.0, fitted.cost / samples)
        leads = not fitted.failed and selection.last.fitted.cost - fitted.cost > least
        if leads and not reasons.explain:
            selection, usual = fitted_base(campaign, name, told)
    return selection, usual


def _is_all(seen: Background, step: Step) -> bool:
    """Return whether what is on the line anyway may be all that a model leaves beside noise.

    It may look like anything in the windows, and no name is worth looking for.
    """
    if not (seen.clear and step.score_test.structured):
        return seen.clear
    structure = max((a.gain - a.dof for a in step.score_test.answers.values()), default=0.0)
    samples = sum(shot.item.expected_squares for shot in step.linearised.shots)
    return structure < seen.share * samples


def _beside(seen: Background, found: Diagnosis) -> Diagnosis:
    """Return a verdict that what is on the line anyway stands beside: it is not the whole."""
    named = found.verdict in ("identified", "family")
    verdict = "partial" if named and seen.clear else found.verdict
    return dataclasses.replace(found, verdict=verdict, check_noise=seen)


def _next_drop(found: Diagnosis) -> NextDrop | None:
    """Return the drop that would separate what is confused, or the two best guesses."""
    if found.verdict == "family":
        for taken in found.chosen:
            if taken.effect_id in found.rivals:
                last = found.steps[-1]
                whole = dataclasses.replace(taken, problem=last.problem, fitted=last.fitted)
                return propose([whole, *found.rivals[taken.effect_id]])
    if found.verdict in ("unknown", "partial"):
        return propose([r for r in found.steps[0].refits if r.usable][:3])
    return None


def _crystal(
    campaign: Campaign, selection: Selection, usual: joint.Fitted, told: Watch
) -> tuple[Selection, joint.Fitted]:
    """Return the selection with the cell no longer rigid, and its usual place, where that helps.

    Of the bases with a cell that rings the one that fits better: the paper's, or the closed one.
    """
    effect, step = effect_named("crystal_dynamics"), selection.last
    ways: list[tuple[Refit, joint.Fitted]] = []
    for base in RINGING_BASES:
        problem, nuisances = with_start(told.over(stated(campaign, base)))
        fitted = fit_from_start(problem, nuisances)
        count = len(problem.names) - len(step.problem.names)
        gain = step.fitted.cost - fitted.cost
        bad = fitted.failed or bool(out_of_range(problem, fitted))
        price = Price(CRITERIA.price_of_number * count)
        refit = Refit(
            effect, effect.id, "rig", problem, fitted, gain, count, bad, gain, price=price
        )
        ways.append((refit, usual_place(problem, nuisances)))
    found, place = min(ways, key=lambda way: rank(way[0]))
    step.refits = [found]
    if found.usable and found.score() > CRITERIA.least_lead:
        selection = selection.on(found)
    return selection, place


def _judge(
    selection: Selection, start: Selection, usual: joint.Fitted, progress: Watch
) -> Diagnosis:
    """Return the verdict that a selection allows, which was searched from a start.

    A chain of effects earns its names only if it ends in noise. Where it does not, what was piled
    on top of the first effect is taken off again: it only mimicked what is missing. A name that was
    not held against all others, as the time was over, is one of a family.
    """
    steps, chosen = selection.steps, selection.chosen
    if selection.adequate and not chosen:
        told = not tells_no_modulus(selection.last.problem, selection.last.fitted)
        steps = with_numbers_as_stated(selection, start).steps
        return Diagnosis("adequate" if told else "not_identifiable", steps, [])
    if chosen and selection.adequate:
        progress(MethodStep.ON_TOP.told("holding every name against others"), 0.95)
        near: dict[str, list[Refit]] = {}
        forms: dict[str, list[Refit]] = {}
        if selection.left_open is None:
            selection.left_open = left_open_on_part(selection, progress)
        with contextlib.suppress(BudgetSpentError):
            selection, near = each_held_against_others(selection)
        unheld: OpenNames = {}
        if progress.ended is not None:
            left_open = selection.left_open
            unheld = not_held_against(selection) if left_open is None else left_open
        verdict = "family" if near or unheld else "identified"
        with contextlib.suppress(BudgetSpentError):
            forms = forms_not_told_apart(selection)
        near, forms = (
            {name: [exact_refit(r) for r in refits] for name, refits in each.items()}
            for each in (near, forms)
        )
        exact = with_numbers_as_stated(selection, start)
        slot = exact.chosen[0].effect.slot
        return Diagnosis(verdict, exact.steps, exact.chosen, near, forms, unheld, slot)
    crystal = [c for c in chosen if c.effect.replaces_base]
    rest = chosen[len(crystal) :]
    standing = _standing(steps[len(crystal) :], rest)
    exact = with_numbers_as_stated(
        Selection(steps[: len(crystal) + standing + 1], chosen[: len(crystal) + standing]), start
    )
    steps, chosen = exact.steps, exact.chosen
    if standing:
        kept = len(crystal) + standing
        located = locate(steps[kept], progress)
        slot = rest[0].effect.slot
        return Diagnosis("partial", steps[: kept + 1], chosen[:kept], slot=slot, located=located)
    seen, shown = _shown(Selection(steps[: len(crystal) + 1], crystal), usual)
    if shown:
        located = locate(seen.last, progress)
        slot = seen.chosen[len(crystal)].effect.slot
        return Diagnosis(
            "partial", seen.steps, seen.chosen, slot=slot, located=located, shown=tuple(shown)
        )
    located = locate(steps[len(crystal)], progress)
    if crystal:
        slot, known = crystal[0].effect.slot, steps[: len(crystal) + 1]
        return Diagnosis("partial", known, crystal, slot=slot, located=located)
    return Diagnosis("unknown", steps[:1], [], slot=located.slot, located=located)


def _with_what_shows(selection: Selection, usual: joint.Fitted) -> Selection:
    """Return a selection with the one effect that records show by themselves, if noise is left.

    Its number is known from the records; a search has the longest way to it, from a model that
    followed what was cut. It is held against every other effect of its slot.
    """
    seen, shown = _shown(selection, usual)
    if len(shown) != 1 or joint.is_hopeless(seen.last.problem, seen.last.fitted.cost):
        return selection
    step = selection.last
    found = shown[0].freed(seen.chosen[-1], step.problem, step.fitted)
    if not found.usable:
        return selection
    ahead = selection.on(found)
    if not ahead.adequate:
        return selection
    try:
        return held_against_others(ahead)
    except BudgetSpentError:
        step.unfinished = True
        return ahead


def _shown(selection: Selection, usual: joint.Fitted) -> tuple[Selection, list[Shown]]:
    """Return a selection with the effects that records show without any model, and these."""
    shown, last = [], selection.last
    left = left_by_model(last.problem, last.fitted)
    for one in shown_by_records(last.problem.shots, left):
        # to its end, whatever the time: it is all that can be said where a search found nothing
        found = one.on_top_of(unwatched(selection.last.problem), selection.last.fitted, usual)
        # what is learned beside it ends with the time
        watched = dataclasses.replace(found.problem, checkpoint=last.problem.checkpoint)
        found = dataclasses.replace(found, problem=watched)
        if not found.fitted.failed and (found.gain > 0.0 or one.in_noise):
            selection = selection.longer_by(found)
            shown.append(one)
    return selection, shown


def _standing(steps: list[Step], chosen: list[Refit]) -> int:
    """Return how many effects, from the first, are certain although something else remains.

    Each must take up far more than what is left, and be far ahead of every other name. Two that
    together mimic a third thing take up much as well, so more is asked of more than one.
    """
    for count in range(len(chosen), 0, -1):
        compared = all(step.compared and not step.unfinished for step in steps[:count])
        if steps[count].impossible or not compared:
            continue  # far ahead of all others is only what was compared with all
        left = steps[count].score_test.left
        ahead = CRITERIA.twice if count > 1 else 1.0
        if all(
            _stands(steps[at], steps[at + 1], chosen[at], left, ahead=ahead) for at in range(count)
        ):
            return count
    return 0


def _stands(before: Step, after: Step, taken: Refit, left: float, *, ahead: float) -> bool:
    if taken.own:
        return False  # sizes that are free in every shot follow much that they are not
    explained = before.fitted.cost - after.fitted.cost
    others = max(
        (r.gain for r in before.refits if r.effect_id != taken.effect_id and not r.at_bound),
        default=0.0,
    )
    clear = explained - others > max(CRITERIA.clear_lead, CRITERIA.twice * left)
    return left < CRITERIA.nothing * explained and clear and explained > ahead * others
