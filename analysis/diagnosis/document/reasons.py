"""Why a candidate was not named, in words a person can check against the numbers beside them."""

from __future__ import annotations

from analysis.diagnosis.basis.proposals import scopes_of
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.document.noise_words import times_noise
from analysis.diagnosis.forward_selection import Step
from analysis.diagnosis.procedure import Diagnosis
from analysis.effects.library import effect_named
from analysis.fit.physical_range import out_of_range


def why_not(diagnosis: Diagnosis, step: Step, refit: Refit) -> str | None:
    """Return why a refitted candidate was not taken in a turn of the loop.

    Parameters
    ----------
    diagnosis : Diagnosis
        The whole.
    step : Step
        The turn.
    refit : Refit
        One of its candidates.

    Returns
    -------
    str or None
        None for the one that was taken.
    """
    taken = _taken(diagnosis, step)
    if refit is taken:
        return None
    if not to_the_end(refit):
        return "not fitted to the end: its search was far behind the others when they were taken on"
    if refit.at_bound:
        return _not_physical(refit)
    if refit.score() < CRITERIA.comparison.least_lead:
        return (
            f"it lowers the misfit by {max(refit.gain, 0.0):.3g}, less than its "
            f"{'number costs' if refit.parameters == 1 else f'{refit.parameters} numbers cost'} "
            "by chance alone"
        )
    return _beaten(diagnosis, step, refit, taken)


def _not_physical(refit: Refit) -> str:
    """Return why a fit has not found the effect whose numbers it has."""
    if refit.effect.basis is not None:
        return (
            "it is not there before the trigger, or its sizes and phases are alike in all shots, "
            "and the mains do not know of a drop"
        )
    if refit.gain < CRITERIA.comparison.least_gain_per_shot * refit.own:
        return "every shot needs a number of its own, and they bring too little to be believed"
    outside = out_of_range(refit.problem, refit.fitted)
    if outside:
        return "; ".join(one.sentence for one in outside)
    bounds = "; ".join(
        f"{p.name} within {p.low:g} .. {p.high:g} {p.unit}".removesuffix(" 1")
        for p in refit.effect.parameters
    )
    return f"its best fit leaves what is physically possible ({bounds})"


def to_the_end(refit: Refit) -> bool:
    """Tell whether a candidate's fit got as far as the model that it extends.

    Parameters
    ----------
    refit : Refit
        A candidate.

    Returns
    -------
    bool
        With its effect at nothing it would fit as well as the model without; one that fits worse
        is still on its way from afar.
    """
    return refit.gain > -CRITERIA.words.nested_shortfall


def _beaten(diagnosis: Diagnosis, step: Step, refit: Refit, taken: Refit | None) -> str:
    """Return why a candidate that helps and is possible was still not taken."""
    if taken is None and step is not diagnosis.steps[-1]:
        return "what was added later explains it better"
    if taken is None:
        return _left(refit) + "; what remains is still structured"
    if refit.effect_id in diagnosis.confusable and step is diagnosis.steps[0]:
        return f"these data cannot tell it from {taken.effect_id}"
    return f"{_left(refit)}; {taken.effect_id} leaves {_times_noise(taken)}"


def not_refitted(step: Step, effect_id: str) -> str:
    """Return why a library effect was not refitted at all.

    Parameters
    ----------
    step : Step
        The turn.
    effect_id : str
        Id of the library's entry.

    Returns
    -------
    str
        In words.
    """
    if effect_id in step.refused:
        return f"not tried: {step.refused[effect_id]}"
    if effect_id in (e.id.partition(":")[0] for e in step.problem.model.effects):
        return "already in the model"
    seen = [
        step.linearised.explain(key, scope, heldout=False)
        for key in step.linearised.families
        if "@" in key and key.partition("@")[0].partition(":")[0] == effect_id
        for scope in scopes_of(effect_named(key.partition("@")[0]))
    ]
    if not seen:
        return "not tried: the time was over before" if step.unfinished else "not tried"
    best = max(seen, key=lambda e: e.gain)
    share = best.gain / max(step.linearised.chi2, 1e-300)
    return (
        f"to first order it explains {share:.1%} of the residual's energy; "
        "others promised more and were refitted"
    )


def _taken(diagnosis: Diagnosis, step: Step) -> Refit | None:
    return next((c for c in diagnosis.chosen if any(c is r for r in step.refits)), None)


def _chi2_per_dof(refit: Refit) -> float:
    """Return the whitened squares left per degree of freedom."""
    shots = refit.problem.shots
    used = sum(s.data - 4 for s in shots) - len(refit.problem.names)
    return sum(b.chi2 for b in refit.fitted.blocks) / max(used, 1)


def _left(refit: Refit) -> str:
    return f"it leaves a residual of {_times_noise(refit)} times the noise"


def _times_noise(refit: Refit) -> str:
    return times_noise(_chi2_per_dof(refit))
