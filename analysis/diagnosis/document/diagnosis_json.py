"""What a diagnosis says, as JSON: ``impactd-diagnosis/1``."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from analysis.diagnosis.candidates.refit import Refit
from analysis.diagnosis.discrepancy.fitted import Learned
from analysis.diagnosis.discrepancy.mean_waveform import mean_waveform
from analysis.diagnosis.document.description import describe
from analysis.diagnosis.document.discrepancy_curves import discrepancy_curves
from analysis.diagnosis.document.moduli_stated import (
    STRUCTURE,
    hold_for_all,
    members,
    withhold_sought,
)
from analysis.diagnosis.document.noise_words import noise_json
from analysis.diagnosis.document.per_shot import parameters_by_shot, told_of_shots
from analysis.diagnosis.document.reasons import not_refitted, to_the_end, why_not
from analysis.diagnosis.document.verdict_sentence import beside_mean_waveform, sentence
from analysis.diagnosis.held_out import heldout_or_none, quality
from analysis.diagnosis.linearised import Explained
from analysis.diagnosis.localisation import Located
from analysis.diagnosis.named_model import definition_of
from analysis.diagnosis.procedure import Diagnosis
from analysis.diagnosis.stepwise.forward import Step
from analysis.diagnosis.time_budget import BudgetSpentError
from analysis.effects.library import library
from analysis.fit.freed_inputs import inputs_freed
from analysis.fit.measurand import Json
from analysis.fit.physical_range import advice
from analysis.fit.result import FitResult
from analysis.fit.statements import (
    effect_parameters_json,
    parameters_json,
    withhold_fitted,
)

FORMAT = "impactd-diagnosis/1"


def diagnosis_json(diagnosis: Diagnosis, *, software: str) -> Json:
    """Return a diagnosis as ``impactd-diagnosis/1``.

    Parameters
    ----------
    diagnosis : Diagnosis
        From ``diagnose_campaign``.
    software : str
        Who made it, with version.

    Returns
    -------
    dict
        JSON-ready; NaN and infinity never appear.
    """
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    before = quality(first.problem, first.fitted)
    after = before if last is first else quality(last.problem, last.fitted)
    # the loop itself takes masses, heights and the like as exact; what it states does not
    honest = (_honest(before, first),) * 2
    if after is not before:
        honest = honest[0], _honest(after, last)
    base, stated = _block(honest[0]), _block(honest[1])
    accepted = diagnosis.chosen and diagnosis.leaves_noise and not honest[1].out_of_range
    located = diagnosis.located
    if not diagnosis.leaves_noise:
        withhold_sought(base, honest[0])
        withhold_sought(stated, honest[1])
    elif diagnosis.rivals:
        hold_for_all(stated, members(diagnosis, honest[1]))
    if diagnosis.open_names:
        withhold_fitted(stated["moduli"], "the name beside which it was found is not certain")
    if diagnosis.verdict == "unknown" and located is not None:
        _add_discrepancy(stated, honest[1], located)
    mean = mean_waveform(first.problem) if located is None or located.mean is None else located.mean
    next_drop = diagnosis.next_drop
    # these look at held-out shots, where the time allows: only then is it known whether it did
    candidates = _candidates(diagnosis, first)
    turns = [_turn(diagnosis, step) for step in diagnosis.steps]
    ended = diagnosis.watch.ended
    said = [
        sentence(diagnosis, before, after),
        *beside_mean_waveform(mean, stated.get("heldout_rms_V"), first.problem),
        *_on_moduli(stated, honest[1]),
        *_provisos(honest[1]),
    ]
    document: Json = {
        "format": FORMAT,
        "verdict": diagnosis.verdict,
        "sentence": " ".join(said if ended is None else [*said, ended.sentence]),
        "ended_early": None if ended is None else ended.to_json(),
        "undetermined": [one.to_json() for one in honest[1].undetermined],
        "p_value": _p_value(diagnosis, first),
        "noise_rms_V": before.noise_rms,
        "noise": noise_json(before, diagnosis.check_noise),
        "effects": [
            _effect(refit, after, diagnosis.confusable_with(refit.effect_id))
            for refit in diagnosis.chosen
        ],
        "slot": diagnosis.slot,
        "slots": {} if located is None else _slots(last, located),
        "also_possible_slots": [] if located is None else located.also,
        "before": base,
        "after": stated,
        "mean_waveform": mean.to_json(),
        "accepted_model": definition_of(after.problem, after.fitted) if accepted else None,
        "remaining": _remaining(diagnosis, last),
        "closure": _discrepancy(diagnosis, before),
        "candidates": candidates,
        "trail": turns,
        "next_drop": next_drop.to_json() if next_drop is not None else None,
        "campaign": _campaign(before),
        "residual": {
            "before": describe(before),
            "after": None if after is before else describe(after),
        },
        "rejected": [dataclasses.asdict(r) for r in first.problem.rejected],
        "assumptions": list(first.problem.assumptions),
        "software": software,
    }
    finite: Json = _finite(document)
    return finite


def _honest(result: FitResult, step: Step) -> FitResult:
    """Return a fit in which masses, heights and the like are as uncertain as stated.

    Whether its moduli rest on statements that the shots contradict takes one more fit, and is asked
    only where the time allows.
    """
    freed = inputs_freed(result)
    problem = dataclasses.replace(freed.problem, checkpoint=step.problem.checkpoint)
    timed = dataclasses.replace(freed, problem=problem)
    try:
        timed.moduli()
    except BudgetSpentError:
        return dataclasses.replace(freed, statements_asked=False)
    return timed


def _provisos(result: FitResult) -> list[str]:
    """Return what must be said beside a verdict: impossible numbers, contradicted statements.

    A model that misses something bends every number, so it contradicts statements that are right:
    nobody is sent to check a label unless noise is left, or would be without the statement.
    """
    blames = bool(result.shots) and (result.misfit <= 1 or result.explained_by_a_statement)
    said = result.contradictions() if blames else []
    return [advice(result.out_of_range), *said] if result.out_of_range else said


def _block(result: FitResult) -> Json:
    """Return the figures of one model: the part that `impactd fit` gives too."""
    if not result.shots:
        return {"model": result.model, "outcome": dataclasses.asdict(result.outcome), "moduli": {}}
    return {
        "model": result.model,
        "outcome": dataclasses.asdict(result.outcome),
        "rms_V": result.rms,
        "nrmse": result.nrmse,
        "r2": result.r2,
        "chi2_per_dof": result.chi2_per_dof,
        "heldout_rms_V": result.heldout_rms,
        "degrees_of_freedom": result.degrees_of_freedom,
        "uncertainty_widened_by": math.sqrt(result.misfit),
        "moduli": result.moduli(),
        "out_of_range": [one.to_json() for one in result.out_of_range],
        "conflicts": [c.to_json() for c in result.conflicts],
        "budget": result.budget(),
        "pairs": result.pairs(),
        "parameters": result.parameters(),
        "flags": result.flags(),
    }


def _on_moduli(block: Json, result: FitResult) -> list[str]:
    """Return why moduli that were sought are not stated: what is missing, what is in the way."""
    held = [name for name, one in block["moduli"].items() if one.get("reason") == STRUCTURE]
    said = [one.sentence for one in result.undetermined]
    return [*said, f"Withheld is the modulus of {', '.join(held)}: {STRUCTURE}."] if held else said


def _add_discrepancy(block: Json, result: FitResult, located: Located) -> None:
    """Give a block the figures of its model with the learned discrepancy, in place.

    Its parameters go: they are those of the model without the discrepancy.
    """
    block.update(parameters={}, pairs={})
    learned = located.learned
    if learned is None or not learned.rms < result.rms:
        return
    share = learned.rms / result.rms
    block.update(
        model=f"{result.model}+closure({learned.family} by {learned.scope})",
        rms_V=learned.rms,
        nrmse=result.nrmse * share,
        r2=1.0 - (1.0 - result.r2) * share**2,
        chi2_per_dof=learned.chi2 / result.degrees_of_freedom,
        heldout_rms_V=learned.heldout_rms,
    )


def _effect(refit: Refit, after: FitResult, confusable: list[str]) -> Json:
    """Return a named effect with its numbers as they stand in the last model."""
    prefix = f"{refit.effect.id}."
    found = effect_parameters_json(after.problem, after.fitted) if after.shots else {}
    parameters = {n.removeprefix(prefix): v for n, v in found.items() if n.startswith(prefix)}
    if refit.effect.replaces_base and after.shots:
        # its numbers are the new base's own
        cell = parameters_json(after.problem, after.fitted)
        parameters = {
            n.removeprefix("sensor."): v for n, v in cell.items() if n.startswith("sensor.")
        }
    told = {name: _quantity(value) for name, value in parameters.items()}
    return {
        "id": refit.effect_id,
        "form": refit.effect.id,
        "slot": refit.effect.slot,
        "title": refit.effect.title,
        "scope": refit.scope,
        "acts_on": _acts_on(refit),
        "parameters": told | parameters_by_shot(refit.effect, after),
        "confusable_with": list(confusable),
    }


def _acts_on(refit: Refit) -> Json | None:
    """Return the materials that an effect acts on, None of one that acts on everything."""
    only = refit.effect.only
    if only is None:
        return None
    present = {str(getattr(item.shot, only.kind)) for item in refit.problem.shots}
    return {"kind": only.kind, "names": list(only.names), "words": only.words(present)}


def _quantity(value: Json | None) -> Json:
    # a group of whom the effect asks nothing has no finite value (a stiffness without limit)
    return {"value": None, "u": None, "unit": ""} if value is None else value


def _candidates(diagnosis: Diagnosis, step: Step) -> list[Json]:
    """Return every effect of the library with what became of it in one turn, best first."""
    found = []
    for refit in step.refits:
        ended = to_the_end(refit)
        whole = ended and refit.on_all_shots
        held = heldout_or_none(refit.problem, refit.fitted) if whole else None
        found.append(
            {
                "id": refit.effect_id,
                "form": refit.effect.id,
                "slot": refit.effect.slot,
                "scope": refit.scope,
                "acts_on": _acts_on(refit),
                "numbers": refit.parameters,
                "heldout_rms_V": held,
                "delta_log_likelihood": refit.gain / 2.0 if ended else None,
                "at_bound": refit.at_bound,
                "converged": refit.fitted.converged,
                "why_not": why_not(diagnosis, step, refit),
            }
        )
    if not step.score_test.structured:
        return found
    for effect_id, effect in library().items():
        if effect_id not in {r.effect_id for r in step.refits}:
            found.append(
                {
                    "id": effect_id,
                    "form": effect_id,
                    "slot": effect.slot,
                    "heldout_rms_V": None,
                    "delta_log_likelihood": None,
                    "at_bound": False,
                    "why_not": not_refitted(step, effect_id),
                }
            )
    return found


def _turn(diagnosis: Diagnosis, step: Step) -> Json:
    """Return one turn of the loop."""
    return {
        "model": step.problem.model.name,
        "structured": step.score_test.structured,
        "p_value": step.score_test.p_value,
        "evidence": [_explained(e, brief=True) for e in step.score_test.answers.values()],
        "candidates": _candidates(diagnosis, step) if step is not diagnosis.steps[0] else [],
    }


def _remaining(diagnosis: Diagnosis, step: Step) -> Json:
    strongest = step.score_test.strongest
    seen = {"family": strongest.family, "scope": strongest.scope}
    if diagnosis.disturbed and diagnosis.located is None:
        seen = {"family": "background", "scope": "shot"}
    return {
        "structured": step.score_test.structured or diagnosis.disturbed,
        "p_value": _p_value(diagnosis, step),
        "strongest": seen,
    }


def _p_value(diagnosis: Diagnosis, step: Step) -> float:
    """Return the chance of what is seen if there were only noise."""
    seen = diagnosis.check_noise
    # what is not clear was asked in order to excuse structure, not to find some
    return min(step.score_test.p_value, seen.p_value if seen is not None and seen.clear else 1.0)


def _explained(found: Explained, *, brief: bool = False) -> Json:
    stated: Json = {
        "family": found.family,
        "scope": found.scope,
        "p_value": found.p_value,
        "gain": found.gain,
        "numbers": found.dof,
    }
    if not brief:
        stated["heldout_gain"] = found.heldout_gain
        stated["coefficients"] = dict(found.coefficients)
    return stated


def _discrepancy(diagnosis: Diagnosis, before: FitResult) -> Json | None:
    """Return the learned discrepancy: figures, coefficients, curves and, where short, formula."""
    located = diagnosis.located
    if located is None:
        return None
    step = diagnosis.steps[-1]
    stated = _explained(located.discrepancy)
    stated["formula"] = _formula(located)
    learned, other = located.learned, located.by_columns
    if learned is None:
        return {**stated, "learned": False, "curves": {"shots": [], "force": None}}
    return {
        **stated,
        "learned": True,
        **_numbers(step, learned),
        "curves": discrepancy_curves(step, learned),
        "by_columns": None if other is None or other is learned else _numbers(step, other),
    }


def _numbers(step: Step, learned: Learned) -> Json:
    """Return what a discrepancy consists of, its coefficients and its error."""
    return {
        "family": learned.family,
        "scope": learned.scope,
        "parts": [{"family": family, "scope": scope} for family, scope in learned.parts],
        "coefficients": dict(learned.coefficients),
        "by_shot": {
            label: told_of_shots(values.tolist(), "1", step.problem.shots)
            for label, values in learned.by_shot.items()
        },
        "heldout_rms_V": learned.heldout_rms,
    }


def _formula(located: Located) -> Json | None:
    """Return the few columns that do nearly all, in words and numbers."""
    if not located.formula:
        return None
    terms = " ".join(f"{value:+.3g} x [{label}]" for label, value in located.formula)
    return {
        "text": f"{located.discrepancy.family}: {terms}",
        "terms": [{"label": label, "coefficient": value} for label, value in located.formula],
    }


def _slots(step: Step, located: Located) -> Json:
    """Return what any effect in each slot could explain on held-out shots, and how likely each is.

    Shares are of the structure, what the noise alone would leave taken off.
    """
    return {
        slot: {
            "heldout_gain": gain,
            "share_of_structure": max(gain, 0.0) / located.structure,
            "share_of_residual": max(gain, 0.0) / step.linearised.chi2,
            "probability": located.probabilities[slot],
        }
        for slot, gain in located.gains.items()
    }


def _campaign(result: FitResult) -> Json:
    items = result.problem.shots
    heights = {s.shot.drop_height_m for s in items}
    return {
        "shots": len(items),
        "spheres": sorted({str(s.shot.sphere) for s in items}),
        "surfaces": sorted({str(s.shot.surface) for s in items}),
        "drop_heights_m": sorted(h for h in heights if h is not None),
    }


def _finite(value: Any) -> Any:
    """Return JSON without NaN and infinity, which are null instead."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    if isinstance(value, np.generic):
        return _finite(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
