"""The loop: fit, ask, name, repair, ask again; and say so when nothing fits."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

from analysis.campaign import Campaign
from analysis.discovery.candidates import (
    Proposal,
    Refit,
    continued,
    proposals,
    refit,
    scopes_of,
)
from analysis.discovery.evidence import Evidence, Explained, gather
from analysis.discovery.omnibus import Omnibus, ask
from analysis.effects.effect import Effect
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import prepare
from analysis.model import solver
from analysis.model.impact_model import ImpactModel, model_named

PENALTY = 12.0
"""Price of one number in whitened squares, about ln of the number of samples."""
MIN_GAIN = 30.0
"""An effect that brings less than this beyond its price is not there."""
SHORTLIST = 6
STARTS_REFITTED = 2
STRUCTURE_STARTS = 4
FIRST_STEPS = 6
CONTINUE_SHARE = 0.3
"""A candidate this far behind after its first steps is not carried on."""
ALWAYS_TRIED = 3
ENOUGH = 0.98
"""Share of the strongest closure's gain at which no further effect is looked for."""
CONFUSED_WITHIN = 10.0
"""Candidates whose whitened squares differ by less than this cannot be told apart."""
MAX_EFFECTS = 3
HARDLY_BETTER = 0.6
"""Where this much of what closures could explain remains after an effect, the chain ends."""
PARTIAL_LEFT = 0.05
PARTIAL_AHEAD = 0.1
"""What may remain beside a partial finding, and how far ahead of other names it must be."""
STEP_SHARE = 0.75
"""Solver errors of 4e-6 of the peak, the same in every model that is compared."""

Progress = Callable[[str, float], None]


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
    """

    problem: JointProblem
    fitted: joint.Fitted
    evidence: Evidence
    omnibus: Omnibus
    refits: list[Refit] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """What was found.

    Attributes
    ----------
    verdict : str
        adequate, identified, family, partial, unknown or not_identifiable.
    steps : list of Step
        The trail; the last step is the model that stands.
    chosen : list of Refit
        The effects that were added, in order.
    confusable : list of str
        Ids that the data cannot tell from the first effect.
    slot : str or None
        Where the discrepancy lives.
    closure : Explained or None
        The learned closure, where no name was earned.
    """

    verdict: str
    steps: list[Step]
    chosen: list[Refit]
    confusable: list[str]
    slot: str | None
    closure: Explained | None


def _quiet(stage: str, share: float) -> None:
    del stage, share


def _without_restitution(campaign: Campaign) -> Campaign:
    """Return the campaign without stated rebounds: a trace tells its own loss better."""
    shots = tuple(dataclasses.replace(s, restitution=None) for s in campaign.shots)
    return dataclasses.replace(campaign, shots=shots)


def _look(problem: JointProblem, fitted: joint.Fitted) -> tuple[Step, list[Proposal]]:
    tried, refused = proposals(problem)
    evidence = gather(problem, fitted, tried)
    return Step(problem, fitted, evidence, ask(evidence), refused=refused), tried


Scored = tuple[float, Proposal, str, Explained]


def _scored(step: Step, tried: list[Proposal]) -> dict[str, list[Scored]]:
    """Return the cheap scores by library entry, best first."""
    found: dict[str, list[Scored]] = {}
    for proposal in tried:
        for scope in scopes_of(proposal.effect):
            seen = step.evidence.explain(proposal.key, scope, heldout=False)
            score = seen.gain - PENALTY * seen.dof
            found.setdefault(proposal.owner, []).append((score, proposal, scope, seen))
    for scores in found.values():
        scores.sort(key=lambda s: -s[0])
    return found


def _coefficients(seen: Explained) -> dict[str, float]:
    found = {}
    for label, value in seen.coefficients.items():
        owner = label.rpartition("[")[2].rstrip("]") if label.endswith("]") else ""
        found[owner] = value
    return found


def _first_round(step: Step, scores: list[Scored]) -> Refit:
    """Return the best of an effect's starts after a few steps each."""
    found = [
        refit(
            step.problem,
            step.fitted,
            proposal,
            scope=scope,
            coefficients=_coefficients(seen),
            linear_gain=seen.gain,
            max_iterations=FIRST_STEPS,
        )
        for _, proposal, scope, seen in _distinct(scores)
    ]
    return max(found, key=lambda r: r.score(PENALTY))


def _refits(step: Step, tried: list[Proposal], progress: Progress) -> list[Refit]:
    """Refit the most promising effects: a few steps from several starts, the best to the end.

    The cheap look puts them in order. As soon as one takes up what the most flexible closure could,
    the rest is spared.
    """
    scored = _scored(step, tried)
    order = sorted(scored, key=lambda owner: -scored[owner][0][0])
    # a structure below the sphere changes everything at once: no slope shows how far it can go
    far = [o for o in order[SHORTLIST:] if scored[o][0][1].effect.structure is not None]
    order = order[:SHORTLIST] + far
    reach = max(a.gain for a in step.omnibus.answers.values())
    best: dict[str, Refit] = {}
    for place, owner in enumerate(order):
        ahead = max((r.score(PENALTY) for r in best.values() if not r.at_bound), default=0.0)
        if place >= ALWAYS_TRIED and ahead > ENOUGH * reach:
            break
        progress(f"trying {owner}", place / len(order))
        result = _first_round(step, scored[owner])
        if not result.fitted.converged and result.score(PENALTY) > CONTINUE_SHARE * ahead:
            progress(f"refining {owner}", (place + 0.5) / len(order))
            result = continued(step.fitted, result)
        best[owner] = result
    return sorted(best.values(), key=lambda r: -r.score(PENALTY))


def _distinct(scores: list[Scored]) -> list[Scored]:
    """Return the best few that differ in form or start, then one for the whole rig."""
    found: list[Scored] = []
    starts = STARTS_REFITTED
    if scores[0][1].effect.structure is not None:
        starts = STRUCTURE_STARTS
    for entry in scores:
        if all(entry[1].key != f[1].key for f in found):
            found.append(entry)
        if len(found) == starts:
            break
    if all(f[2] != "rig" for f in found):
        found += [s for s in scores if s[2] == "rig"][:1]
    return found


def diagnose_campaign(
    campaign: Campaign, base: str = "kv", *, progress: Progress | None = None
) -> Diagnosis:
    """Close the loop on a campaign.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    base : str
        Model to start from.
    progress : callable, optional
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    Diagnosis
        Always with a verdict.
    """
    told = progress or _quiet
    model = dataclasses.replace(model_named(base), step_share=STEP_SHARE)
    problem = build(_without_restitution(campaign), model)
    told("fitting the base model", 0.0)
    fitted = joint.fit(problem, prepare(problem))
    steps: list[Step] = []
    chosen: list[Refit] = []
    confusable: list[str] = []
    step, tried = _look(problem, fitted)
    steps.append(step)
    if model.kind == solver.HSD and step.omnibus.structured:
        told("trying crystal_dynamics", 0.1)
        crystal = _crystal(campaign, step)
        step.refits = [crystal]
        if crystal.score(PENALTY) > MIN_GAIN:
            chosen.append(crystal)
            step, tried = _look(crystal.problem, crystal.fitted)
            steps.append(step)
    while step.omnibus.structured and len(chosen) < MAX_EFFECTS:
        step.refits += _refits(step, tried, told)
        best = next((r for r in step.refits if not r.at_bound), None)
        if best is None or best.score(PENALTY) < MIN_GAIN:
            break
        reach = max(a.gain for a in step.omnibus.answers.values())
        chosen.append(best)
        step, tried = _look(best.problem, best.fitted)
        steps.append(step)
        left = max(a.gain for a in step.omnibus.answers.values())
        if step.omnibus.structured and left > HARDLY_BETTER * reach:
            break  # another effect on top of one that explains so little would only mimic
        if not step.omnibus.structured and len(chosen) == 1:
            confusable = [
                r.owner
                for r in steps[0].refits
                if r is not best and not r.at_bound and best.gain - r.gain < CONFUSED_WITHIN
            ]
    steps, chosen = _backward(steps, chosen)
    return _judge(steps, chosen, confusable)


def _crystal(campaign: Campaign, step: Step) -> Refit:
    """Return the model in which the cell is no longer rigid."""
    effect = effect_named("crystal_dynamics")
    model = dataclasses.replace(model_named(effect.replaces_base), step_share=STEP_SHARE)
    problem = build(_without_restitution(campaign), model)
    fitted = joint.fit(problem, prepare(problem))
    count = len(problem.names) - len(step.problem.names)
    gain = step.fitted.cost - fitted.cost
    return Refit(effect, effect.id, "rig", problem, fitted, gain, count, not fitted.blocks, gain)


def _backward(steps: list[Step], chosen: list[Refit]) -> tuple[list[Step], list[Refit]]:
    """Take out an effect that a later one has made needless."""
    if len(chosen) < 2 or steps[-1].omnibus.structured:
        return steps, chosen
    last = steps[-1]
    for place, old in enumerate(chosen[:-1]):
        if old.effect.replaces_base:
            continue
        kept = tuple(e for e in last.problem.model.effects if e.id != old.effect.id)
        without = _reduced(last, kept)
        if without.fitted.cost - last.fitted.cost < MIN_GAIN:
            others = [c for at, c in enumerate(chosen) if at != place]
            return [*steps[:-1], without], others
    return steps, chosen


def _reduced(step: Step, effects: tuple[Effect, ...]) -> Step:
    """Return a step's model with fewer effects, fitted again."""
    model = dataclasses.replace(step.problem.model, effects=effects)
    keep = [
        j
        for j, name in enumerate(step.problem.names)
        if not _is_effect(name, step.problem.model) or _is_effect(name, model)
    ]
    problem = dataclasses.replace(
        step.problem,
        model=model,
        names=[step.problem.names[j] for j in keep],
        start=step.fitted.theta[keep],
        prior_mean=step.problem.prior_mean[keep],
        prior_precision=step.problem.prior_precision[keep][:, keep],
    )
    nuisances = step.fitted.nuisances[:, : len(model.nuisances)]
    fitted = joint.fit(problem, nuisances, theta=problem.start)
    evidence = gather(problem, fitted)
    return Step(problem, fitted, evidence, ask(evidence))


def _is_effect(name: str, model: ImpactModel) -> bool:
    return any(name.startswith(f"{e.id}.") for e in model.effects)


def _judge(steps: list[Step], chosen: list[Refit], confusable: list[str]) -> Diagnosis:
    """Return the verdict that a trail allows.

    A chain of effects earns its names only if it ends in noise. Where it does not, what was piled
    on top of the first effect is taken off again: it only mimicked what is missing.
    """
    first, last = steps[0], steps[-1]
    if not first.omnibus.structured:
        return Diagnosis("adequate", steps, [], [], None, None)
    if chosen and not last.omnibus.structured:
        verdict = "family" if confusable else "identified"
        return Diagnosis(verdict, steps, chosen, confusable, chosen[0].effect.slot, None)
    full = ask(first.evidence, heldout=True)
    gains = full.slot_gains()
    slot = max(gains, key=lambda s: gains[s])
    closure = max(full.answers.values(), key=lambda e: e.heldout_gain)
    if chosen and _stands_alone(steps, chosen):
        return Diagnosis(
            "partial", steps[:2], chosen[:1], confusable, chosen[0].effect.slot, closure
        )
    return Diagnosis("unknown", steps[:1], [], [], slot, closure)


def _stands_alone(steps: list[Step], chosen: list[Refit]) -> bool:
    """Tell whether the first effect is certain although something else remains.

    It must take up nearly all that any closure could, and be far ahead of every other name.
    """
    first, second = steps[0], steps[1]
    explained = first.fitted.cost - second.fitted.cost
    left = max((a.gain for a in second.omnibus.answers.values()), default=0.0)
    others = [r.gain for r in first.refits if r.owner != chosen[0].owner and not r.at_bound]
    ahead = explained - max(others, default=0.0)
    return left < PARTIAL_LEFT * explained and ahead > PARTIAL_AHEAD * explained
