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
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named

PENALTY = 12.0
"""Price of one number in whitened squares, about ln of the number of samples."""
MIN_GAIN = 30.0
"""An effect that brings less than this beyond its price is not there."""
SHORTLIST = 6
STARTS_REFITTED = 2
FIRST_STEPS = 6
CONTINUE_SHARE = 0.3
"""A candidate this far behind after its first steps is not carried on."""
CONFUSED_WITHIN = 10.0
"""Candidates whose whitened squares differ by less than this cannot be told apart."""
MAX_EFFECTS = 3
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


def _refits(step: Step, tried: list[Proposal], progress: Progress) -> list[Refit]:
    """Refit the most promising effects: a few steps from several starts, the best to the end."""
    scored = _scored(step, tried)
    order = sorted(scored, key=lambda owner: -scored[owner][0][0])[:SHORTLIST]
    first: list[Refit] = []
    for place, owner in enumerate(order):
        progress(f"trying {owner}", place / len(order))
        for _, proposal, scope, seen in _distinct(scored[owner]):
            first.append(
                refit(
                    step.problem,
                    step.fitted,
                    proposal,
                    scope=scope,
                    coefficients=_coefficients(seen),
                    linear_gain=seen.gain,
                    max_iterations=FIRST_STEPS,
                )
            )
    ahead = max((r.score(PENALTY) for r in first), default=0.0)
    best: dict[str, Refit] = {}
    for result in sorted(first, key=lambda r: -r.score(PENALTY)):
        if result.owner in best:
            continue
        if not result.fitted.converged and result.score(PENALTY) > CONTINUE_SHARE * ahead:
            progress(f"refining {result.owner}", 0.9)
            result = continued(step.fitted, result)  # noqa: PLW2901 - the better form replaces it
        best[result.owner] = result
    return sorted(best.values(), key=lambda r: -r.score(PENALTY))


def _distinct(scores: list[Scored]) -> list[Scored]:
    """Return the best few that differ in form or start, then one for the whole rig."""
    found: list[Scored] = []
    for entry in scores:
        if all(entry[1].key != f[1].key for f in found):
            found.append(entry)
        if len(found) == STARTS_REFITTED:
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
    while step.omnibus.structured and len(chosen) < MAX_EFFECTS:
        step.refits = _refits(step, tried, told)
        best = next((r for r in step.refits if not r.at_bound), None)
        if best is None or best.score(PENALTY) < MIN_GAIN:
            break
        chosen.append(best)
        step, tried = _look(best.problem, best.fitted)
        steps.append(step)
        if not step.omnibus.structured and len(chosen) == 1:
            confusable = [
                r.owner
                for r in steps[0].refits
                if r is not best and not r.at_bound and best.gain - r.gain < CONFUSED_WITHIN
            ]
    return _judge(steps, chosen, confusable)


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
