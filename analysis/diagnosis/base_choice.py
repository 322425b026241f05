"""Which laws of mechanics does a rig obey? Bases are asked alone, then beside what hides them.

Another law of loss, or an effect, may leave so much that no base stands out. So every base is also
asked with another loss, and with the effects that explain most on the base that stands.
"""

from __future__ import annotations

import dataclasses

from analysis.base_models import RINGING_BASES
from analysis.campaign import Campaign
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forward_selection import FIRSTS_TRIED
from analysis.diagnosis.multistart import extended_like, usual_place
from analysis.diagnosis.progress import MethodStep, Watch
from analysis.diagnosis.score_test import chance_of
from analysis.diagnosis.search_on_part import best_on_part, tried_on_part
from analysis.diagnosis.selection import Selection, Step
from analysis.diagnosis.successive_halving import (
    FEW,
    FEWEST,
    different,
    few_show_much,
    part_of,
    thinned,
)
from analysis.diagnosis.uncertain_numbers import with_uncertain_numbers
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.below_one import fit_from_start
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import MIXED, ImpactModel, model_named

LOSS_LAW = "loss_law"
"""Id of the effect that is another law of loss than the base's."""
STEP_SHARE = 0.75
"""Of the solver's steps for an error of 1e-6 of the peak, in every model that is compared. Derived:
the error goes with their fifth power, and 4e-6 of the peak is little beside noise of 1e-4."""
MOST_STEPS = 3000.0
"""Of the solver, for an effect. Derived: it then swings 560 radians in a contact, and moves against
what it sits on by 3e-6 of what its inertia asks for; a stiffer one cannot be told from a rigid one.
Measured: fits to tapes that ran further, to none in the end, took two thirds of all their time."""
FIRST_LOOK = 20
"""Steps of a fit of the other base. Measured on 20 campaigns of the paper's rigs: theirs
ends within 10 in 16, after 18 beside a ceiling, and later only where the closed one is nearer or
neither comes near. On 6 closed rigs it creeps on for 52 to 120."""


def stated(campaign: Campaign, base: str) -> JointProblem:
    """Return a base's problem, without stated rebounds: a trace tells its own loss better."""
    shots = tuple(dataclasses.replace(s, restitution=None) for s in campaign.shots)
    return build(dataclasses.replace(campaign, shots=shots), _base_model(base))


def _base_model(name: str) -> ImpactModel:
    return dataclasses.replace(model_named(name), step_share=STEP_SHARE, most_steps=MOST_STEPS)


def fitted_base(campaign: Campaign, base: str, told: Watch) -> tuple[Selection, joint.Fitted]:
    """Return the base model fitted to all shots, and where it would be without a record.

    What is fitted on top of it ends when the time is over; it does not.
    """
    told(MethodStep.NOISE.told("from the stretches before the trigger"), 0.0)
    problem = stated(campaign, base)
    told(MethodStep.BASE_FIT.told(f"{base} on all shots"), 0.0)
    problem, nuisances = with_start(problem)
    fitted = fit_from_start(problem, nuisances)
    told(MethodStep.STRUCTURE.told("or is the residual noise?"), 0.0)
    return Selection([Step(told.over(problem), fitted)], []), usual_place(problem, nuisances)


def effect_leads(
    default: tuple[Selection, joint.Fitted], mixed: tuple[Selection, joint.Fitted], told: Watch
) -> bool:
    """Tell whether the records obey the default base and one effect, and no mixed base.

    The effect leaves noise, and more evidence than the best one on top of the mixed base does.
    """
    told(MethodStep.CANDIDATES.told("do the records obey the closed base and one effect?"), 0.05)
    leaves_noise, cost = best_on_part(*default, told)
    return leaves_noise and best_on_part(*mixed, told)[1] - cost > CRITERIA.least_lead


def mixed_base(default: Step) -> str | None:
    """Return the name of the default base without the laws that the records do not obey.

    None where every such base leaves more than *little* of what the better of the default and the
    paper's leaves beyond the noise: effects of a rig make some of them fit better too, but by less.
    Asked of shots that stand for all, where these leave more than noise. The default's fit to all
    is known, and begins there: from its start it may end elsewhere than on all.

    Where none is taken, `_beside_another_loss` asks again.
    """
    problem = default.problem
    places = thinned(problem, FEW)
    samples = sum(problem.shots[at].expected_squares for at in places)
    of_default = part_of(problem, default.fitted, places)[1].cost - samples
    if of_default <= chance_of(samples):
        return None
    others = [one.base_name for one in MIXED]
    of_paper, *of_others = _beyond_noise(problem, places, [*RINGING_BASES[1:], *others])
    of_ringing, least = min(of_default, of_paper), min(of_others)
    if of_ringing <= chance_of(samples):
        return None
    if least < CRITERIA.little * of_ringing:
        return others[of_others.index(least)]
    return _beside_another_loss(problem, places, of_ringing)


def _beside_another_loss(problem: JointProblem, places: list[int], of_ringing: float) -> str | None:
    """Return the mixed base that leaves next to nothing once it has another law of loss.

    That law hides which laws of mechanics a rig obeys. The best of the ringing bases and of the
    mixed ones, by the few shots that differ most, are compared on ``places``; ``of_ringing`` is
    what the ringing bases leave there with their own law.
    """
    losses = [f"+{law}" for law in _other_losses()]
    best = [name for _, name in _best(problem, different(problem, FEWEST), losses)]
    with_loss, mixed = _beyond_noise(problem, places, best)
    obeyed = _stands_out(mixed, min(of_ringing, with_loss), problem, places)
    return _mechanics(best[1]) if obeyed else None


def base_beside_effect(
    campaign: Campaign, found: tuple[Selection, joint.Fitted], told: Watch
) -> tuple[Selection, Selection, joint.Fitted] | None:
    """Return the mixed base that a rig obeys beside an effect, where none stands out alone.

    It is asked where no effect leaves noise of a part of the shots on the base that stands,
    ``found``. The base that three shots choose is taken if its own best effect leaves noise of that
    part. Returned are its fit, the same with stated numbers uncertain, and its usual place.
    """
    last = found[0].last
    if found[0].adequate or not few_show_much(last.problem, last.fitted):
        return None
    told(MethodStep.CANDIDATES.told("or does an effect hide which laws the rig obeys?"), 0.05)
    if best_on_part(*found, told)[0]:
        return None
    tried = tried_on_part(*found, told).last.refits
    likely = sorted((r for r in tried if r.effect_id != LOSS_LAW), key=lambda r: -r.gain)
    name = next(filter(None, map(_beside, likely[:FIRSTS_TRIED])), None)
    if name is None:
        return None
    start, usual = fitted_base(campaign, name, told)
    other = start if start.adequate else with_uncertain_numbers(start)
    obeyed = start.adequate or best_on_part(other, usual, told)[0]
    return (start, other, usual) if obeyed else None


def _beside(effect: Refit) -> str | None:
    """Return the mixed base that leaves next to nothing of three shots once it has an effect.

    Next to nothing is *little* of what the ringing bases leave with the same effect; each with its
    own loss or another. The shots are some of those that the effect was fitted to.
    """
    three = different(effect.problem, FEWEST)
    losses = ["", *(f"+{law}" for law in _other_losses())]
    (of_ringing, _), (mixed, name) = _best(effect.problem, three, losses, effect)
    obeyed = _stands_out(mixed, of_ringing, effect.problem, three)
    return _mechanics(name) if obeyed else None


def _stands_out(mixed: float, of_ringing: float, problem: JointProblem, places: list[int]) -> bool:
    """Tell whether a mixed base leaves *little* of what the ringing bases leave beyond the noise.

    And that this is more than chance, on the shots at ``places``.
    """
    samples = sum(problem.shots[at].expected_squares for at in places)
    return of_ringing > chance_of(samples) and mixed < CRITERIA.little * of_ringing


def _best(
    problem: JointProblem, places: list[int], losses: list[str], effect: Refit | None = None
) -> list[tuple[float, str]]:
    """Return the best of the ringing bases and of the mixed ones, each with one of some losses.

    That is what it leaves beyond the noise of some shots, and its name. Of those that differ by
    chance the first is the best, which leaves fewer laws out.
    """
    best = []
    for bases in (RINGING_BASES, [one.base_name for one in MIXED]):
        names = [base + law for base in bases for law in losses]
        left = _beyond_noise(problem, places, names, effect)
        most = min(left) + CRITERIA.least_lead
        ways = zip(left, names, strict=True)
        best.append(next(way for way in ways if way[0] <= most))
    return best


def _other_losses() -> list[str]:
    loss = effect_named(LOSS_LAW)
    return [one.id for one in (loss, *loss.variants)]


def _mechanics(model: str) -> str:
    """Return a model's base: the law of loss is an effect, and is searched for as one."""
    return model.partition("+")[0]


def _beyond_noise(
    problem: JointProblem, places: list[int], names: list[str], effect: Refit | None = None
) -> list[float]:
    """Return the squares that bases, or models, leave beyond the noise of some shots.

    Each has ``effect`` as well, if there is one, and begins where its fit to these shots, among
    others, ended. Infinite without a fit.
    """
    shots = tuple(problem.shots[at].shot for at in places)
    some = dataclasses.replace(problem.campaign, shots=shots)

    def beyond_noise(name: str) -> float:
        """Return the squares that one leaves."""
        part, nuisances = with_start(build(some, _base_model(name)))
        theta = None
        if effect is not None:
            row = {id(item.shot): at for at, item in enumerate(effect.problem.shots)}
            part, theta, _ = extended_like(part, nuisances, effect)
            nuisances = effect.fitted.nuisances[[row[id(item.shot)] for item in part.shots]]
        fitted = joint.fit_to_compare(part, nuisances, theta=theta, max_iterations=FIRST_LOOK)
        return fitted.cost - sum(item.expected_squares for item in part.shots)

    return list(problem.each(beyond_noise, names))
