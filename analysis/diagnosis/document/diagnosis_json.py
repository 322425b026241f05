"""A diagnosis as JSON: ``impactd-diagnosis/1``."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.aliases import Json
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.discrepancy.fit import Learned
from analysis.diagnosis.discrepancy.mean_waveform import mean_waveform
from analysis.diagnosis.document import residual, wording
from analysis.diagnosis.document.moduli_stated import (
    STRUCTURE_LEFT,
    family_members,
    is_noise_without_statements,
    widen_over_family,
    widen_over_forms,
    withhold_sought,
    without_uncertainty,
)
from analysis.diagnosis.grouping_search import seen_on
from analysis.diagnosis.held_out import as_fit_result, heldout_or_none
from analysis.diagnosis.linearised import Explained
from analysis.diagnosis.localisation import Located
from analysis.diagnosis.named_model import definition_of
from analysis.diagnosis.noise_check import Background
from analysis.diagnosis.procedure import Diagnosis
from analysis.diagnosis.progress import BudgetSpentError
from analysis.diagnosis.selection import Step
from analysis.effects.acts_on import ActsOn
from analysis.effects.effect import Effect
from analysis.effects.library import library
from analysis.fit.freed_inputs import inputs_freed
from analysis.fit.physical_range import advice
from analysis.fit.problem import FitShot
from analysis.fit.result import FitResult
from analysis.fit.statements import cell_json, effect_parameters_json, withhold_fitted
from analysis.noise import NoiseModel
from analysis.parameters import of_effect


def diagnosis_json(diagnosis: Diagnosis, *, software: str) -> Json:
    """Return a diagnosis as ``impactd-diagnosis/1``.

    Parameters
    ----------
    diagnosis : Diagnosis
        From ``diagnose_campaign``.

    Returns
    -------
    dict
        JSON-ready; NaN and infinity never appear.
    """
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    before = as_fit_result(first.problem, first.fitted)
    after = before if last is first else as_fit_result(last.problem, last.fitted)
    # masses, heights and the like are exactly as stated here, and uncertain in what is stated below
    explained_by_effect = diagnosis.leaves_noise and bool(diagnosis.chosen)
    free_before = _with_free_inputs(
        dataclasses.replace(before, lacks_effect=explained_by_effect), first
    )
    free_after = free_before if after is before else _with_free_inputs(after, last)
    base, stated = _block(free_before), _block(free_after)
    located = diagnosis.located
    explained = False
    if not diagnosis.leaves_noise:
        explained = explained_before = is_noise_without_statements(last.problem, free_after)
        if after is not before:
            explained_before = is_noise_without_statements(first.problem, free_before)
        withhold_sought(base, free_before, explained=explained_before)
        withhold_sought(stated, free_after, explained=explained)
    elif diagnosis.rivals or diagnosis.forms_as_good:
        widen_over_family(stated, family_members(diagnosis, free_after))
    if diagnosis.open_names:
        withhold_fitted(stated["moduli"], "the name of the other effect is not certain")
    if diagnosis.verdict == "unknown" and located is not None:
        _add_discrepancy(stated, free_after, located)
    mean = mean_waveform(first.problem) if located is None or located.mean is None else located.mean
    # these look at held-out shots, where the time allows: only then is it known whether it did
    candidates = _candidates(diagnosis, first)
    turns = [_turn(diagnosis, step) for step in diagnosis.steps]
    ended = diagnosis.watch.ended
    effects = [_effect(diagnosis, refit, free_after) for refit in diagnosis.chosen]
    said = [
        *wording.base_sentences(diagnosis),
        *wording.set_aside_sentences(diagnosis.set_aside),
        *wording.polarity_sentences(before),
        wording.verdict_sentence(
            diagnosis, before, after, wording.moved_moduli(base["moduli"], stated["moduli"])
        ),
        *wording.form_sentences(diagnosis),
        *wording.seen_on_sentences(effects),
        *wording.heldout_sentences(diagnosis, stated, free_after.problem),
        *wording.beside_mean_waveform(mean, stated.get("heldout_rms_V"), first.problem),
        *_on_moduli(stated, free_after),
        *_provisos(free_after, blames=diagnosis.leaves_noise or explained),
    ]
    accepted = diagnosis.chosen and diagnosis.leaves_noise and not free_after.out_of_range
    document: Json = {
        "format": "impactd-diagnosis/1",
        "verdict": diagnosis.verdict,
        "sentence": " ".join(said if ended is None else [*said, ended.sentence]),
        "ended_early": None if ended is None else ended.to_json(),
        "undetermined": [one.to_json() for one in free_after.undetermined],
        "p_value": _p_value(diagnosis, first),
        "noise_rms_V": before.noise_rms,
        "noise": noise_json(before, diagnosis.check_noise),
        "effects": [*effects, *_mistake(diagnosis)],
        "set_aside": [dataclasses.asdict(one) for one in diagnosis.set_aside],
        "slot": diagnosis.slot,
        "slots": {} if located is None else _slots(last, located),
        "also_possible_slots": [] if located is None else located.also,
        "before": base,
        "after": stated,
        "mean_waveform": mean.to_json(),
        "accepted_model": definition_of(free_after.problem, free_after.fitted)
        if accepted
        else None,
        "remaining": _remaining(diagnosis, last),
        "closure": _discrepancy(last, located),
        "candidates": candidates,
        "trail": turns,
        "next_drop": None if diagnosis.next_drop is None else diagnosis.next_drop.to_json(),
        "campaign": _campaign(before),
        "residual": {
            "before": residual.describe(before, structured=_structured(diagnosis, first)),
            "after": None
            if after is before
            else residual.describe(after, structured=_structured(diagnosis, last)),
        },
        "rejected": [dataclasses.asdict(r) for r in first.problem.rejected],
        "assumptions": list(first.problem.assumptions),
        "software": software,
    }
    finite: Json = _finite(document)
    return finite


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


def _campaign(result: FitResult) -> Json:
    items = result.problem.shots
    heights = {s.shot.drop_height_m for s in items}
    return {
        "shots": len(items),
        "spheres": sorted({str(s.shot.sphere) for s in items}),
        "surfaces": sorted({str(s.shot.surface) for s in items}),
        "drop_heights_m": sorted(h for h in heights if h is not None),
    }


# -- the models before and after -----------------------------------------------------------------
def _with_free_inputs(result: FitResult, step: Step) -> FitResult:
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


def _on_moduli(block: Json, result: FitResult) -> list[str]:
    """Return why moduli that were sought are not stated: what is missing, what is in the way."""
    held = [name for name, one in block["moduli"].items() if one.get("reason") == STRUCTURE_LEFT]
    said = [one.sentence for one in result.undetermined]
    if held:
        said.append(f"The modulus of {', '.join(held)} is withheld: {STRUCTURE_LEFT}.")
    return said


def _provisos(result: FitResult, *, blames: bool) -> list[str]:
    """Return what must be said beside a verdict: impossible numbers, contradicted statements.

    A model that misses something bends every number, so it contradicts statements that are right:
    nobody is sent to check a label unless noise is left, or would be without the statement.
    """
    said = result.contradictions() if result.shots and blames else []
    return [advice(result.out_of_range), *said] if result.out_of_range else said


# -- the noise -----------------------------------------------------------------------------------
def noise_json(result: FitResult, seen: Background | None = None) -> Json:
    """Return the noise of each instrument, what else is on the line all the time, and its words."""
    noises: dict[tuple[str, float], NoiseModel] = {}
    for item in (shot.item for shot in result.shots):
        noises.setdefault((item.shot.quantity, item.frame.sample_rate_hz), item.noise)
    said = [s for (_, rate), noise in noises.items() for s in wording.noise_sentences(noise, rate)]
    said = list(dict.fromkeys(said))
    if seen is not None and seen.clear:
        said.append(f"It is not plain noise: {wording.background_words(seen)}.")
    return {
        "instruments": [
            {
                "sample_rate_Hz": rate,
                "rms": noise.rms,
                "kind": wording.noise_kind(noise),
                "autoregressive_order": int(
                    (noise.coefficients if noise.short is None else noise.short).size
                ),
                "corner_Hz": noise.corner * rate if noise.corner else None,
                "filter_samples": noise.order,
                "converter_step": None if noise.coarse is None else noise.coarse.step,
                "drift_rms": noise.drift_rms,
                "drift_expected_rms": None if noise.drift_rms is None else noise.drift_expected_rms,
                "quiet_samples": noise.samples,
                "source": noise.source,
                "quantity": quantity,
            }
            for (quantity, rate), noise in noises.items()
        ],
        "background": None if seen is None else _background_json(seen),
        "said": said,
    }


def _background_json(seen: Background) -> Json:
    spikes, tone = seen.spikes, seen.tone
    return {
        "clear": seen.clear,
        "spikes": {
            "clear": spikes.clear,
            "quiet_samples": spikes.samples,
            "beyond_five_deviations": spikes.far,
            "excess_kurtosis": spikes.excess_kurtosis,
            "p_value": spikes.p_value,
        },
        "tone": None
        if tone is None
        else {
            "clear": tone.clear,
            "frequency_Hz": tone.frequency_hz,
            "times_its_neighbours": tone.times,
            "p_value": tone.p_value,
        },
    }


# -- effects and candidates ----------------------------------------------------------------------
def _effect(diagnosis: Diagnosis, refit: Refit, after: FitResult) -> Json:
    """Return a named effect with its numbers as they stand in the last model."""
    found: Json = {}
    if after.shots and refit.effect.replaces_base:  # its numbers are the new base's own
        found = cell_json(after.problem, after.fitted)
    elif after.shots:
        every = effect_parameters_json(after.problem, after.fitted)
        found = {name.short: one for name, one in every.items() if name.is_of(refit.effect.id)}
    forms = diagnosis.forms_as_good.get(refit.effect_id, [])
    widen_over_forms(found, forms)
    exact = {p.name for p in refit.effect.parameters if p.exact is not None}
    # a group of whom the effect asks nothing has no finite value (a stiffness without limit)
    parameters = {
        name: value
        if value and diagnosis.leaves_noise and name not in exact
        else without_uncertainty(value)
        for name, value in found.items()
    }
    shown = next((one for one in diagnosis.shown if one.form == refit.effect.id), None)
    if shown is not None:  # nobody knows how far what is missing moves what the records say
        parameters = {
            one.name: {
                "value": float(f"{shown.values[one.name]:.2g}") if shown.measured else None,
                "u": None,
                "unit": one.unit,
            }
            for one in refit.effect.parameters
        }
    return {
        "id": refit.effect_id,
        "form": refit.effect.id,
        "slot": refit.effect.slot,
        "title": refit.effect.title,
        "scope": refit.scope,
        "acts_on": _acts_on(refit),
        "seen_on": _seen_on(diagnosis, refit),
        "parameters": parameters | _parameters_by_shot(refit.effect, after),
        "forms_as_good": [one.effect.id for one in forms],
        "confusable_with": diagnosis.confusable_with(refit.effect_id),
    }


def _mistake(diagnosis: Diagnosis) -> list[Json]:
    """Return the mistake of the record that was named, in the form of an effect."""
    return [
        {
            "id": one.id,
            "form": one.id,
            "slot": diagnosis.slot,
            "title": one.sentence,
            "scope": {one.kind: one.name},
            "acts_on": None,
            "seen_on": [],
            "parameters": {
                name: {"value": value, "u": u, "unit": unit}
                for name, (value, u, unit) in one.parameters.items()
            },
            "confusable_with": [
                *(other.id for other in diagnosis.mistakes[1:]),
                *diagnosis.effects_as_good,
            ],
        }
        for one in diagnosis.mistakes[:1]
    ]


def _acts_on(refit: Refit) -> Json | None:
    """Return the materials that an effect acts on, None of one that acts on everything."""
    only = refit.effect.only
    return None if only is None else _materials(only, refit)


def _materials(some: ActsOn, refit: Refit) -> Json:
    words = wording.on_materials(some, refit.problem)
    return {"kind": some.kind, "names": list(some.names), "words": words}


def _seen_on(diagnosis: Diagnosis, refit: Refit) -> list[Json]:
    """Return the surfaces and spheres whose shots show an effect, nothing where all do.

    Nothing as well where structure remains: the squares of one material may be those of what is
    missing.
    """
    if not diagnosis.leaves_noise:
        return []
    last = diagnosis.steps[-1]
    return [_materials(one, refit) for one in seen_on(refit.effect, last.problem, last.fitted)]


def _parameters_by_shot(effect: Effect, result: FitResult) -> Json:
    """Return the numbers of an effect that belong to single shots, by parameter.

    ``size_rms`` stands for the free sizes of a shot: the rms of what they add to the record.
    """
    problem, model, nuisances = result.problem, result.problem.model, result.fitted.nuisances
    own = next((e for e in model.effects if e.id == effect.id), None)
    if own is None or not result.shots:
        return {}
    found: Json = {}
    felt = [own.acts_on(s.shot.sphere, s.shot.surface) for s in problem.shots]
    shots = [s for s, acts in zip(problem.shots, felt, strict=True) if acts]
    for parameter in own.parameters:
        if parameter.scope == "shot":
            at = model.nuisances.index(of_effect(own.id, parameter.name))
            values = [parameter.value(float(x)) for x in nuisances[felt, at]]
            found[parameter.name] = _over_shots(values, parameter.unit, shots)
    if own.basis is not None:
        unit = "V" if problem.shots[0].shot.quantity == "voltage" else "of the signal"
        sizes = [_rms_of_basis(own, result, row) for row in range(len(problem.shots))]
        found["size_rms"] = _over_shots(sizes, unit, problem.shots)
    return found


def _rms_of_basis(effect: Effect, result: FitResult, row: int) -> float:
    """Return the rms of what an effect's free sizes add to one shot. [unit of the signal]"""
    model, item = result.problem.model, result.problem.shots[row]
    shared, _ = result.problem.shared_local(item, result.fitted.theta)
    local = np.concatenate([shared, result.fitted.nuisances[row]])
    without = local.copy()
    first = model.names.index(of_effect(effect.id, "basis0"))
    without[first : first + effect.basis_size] = 0.0
    added = model.predict(local, item.frame).signal - model.predict(without, item.frame).signal
    return float(np.sqrt(np.mean(added**2)))


def _over_shots(values: Sequence[float], unit: str, shots: Sequence[FitShot]) -> Json:
    """Return one number a shot as their median and range, and in words what they go with.

    ``u`` is null: the shots differ, and that is not an uncertainty.
    """
    return {
        "value": float(np.median(values)),
        "u": None,
        "unit": unit,
        "least": float(np.min(values)),
        "most": float(np.max(values)),
        "shots": len(values),
        "goes_with": wording.dependence(values, shots),
    }


def _candidates(diagnosis: Diagnosis, step: Step) -> list[Json]:
    """Return every effect of the library with what became of it in one turn, best first."""
    found: list[Json] = []
    refits = _with_the_taken(step, wording.taken_in(diagnosis, step))
    for refit in refits:
        ended = wording.fitted_to_the_end(refit)
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
                "why_not": wording.why_not(diagnosis, step, refit),
            }
        )
    if not step.score_test.structured:
        return found
    refitted = {refit.effect_id for refit in refits}
    return found + [
        {
            "id": effect_id,
            "form": effect_id,
            "slot": effect.slot,
            "heldout_rms_V": None,
            "delta_log_likelihood": None,
            "at_bound": False,
            "why_not": wording.not_refitted(step, effect_id),
        }
        for effect_id, effect in library().items()
        if effect_id not in refitted
    ]


def _with_the_taken(step: Step, taken: Refit | None) -> list[Refit]:
    """Return a turn's candidates with the one it took, in the place of its own earlier fit."""
    if taken is None or any(taken is refit for refit in step.refits):
        return list(step.refits)
    others = [r for r in step.refits if (r.effect.id, r.scope) != (taken.effect.id, taken.scope)]
    return [taken, *others]


# -- the turns of the selection, and what remains ------------------------------------------------
def _turn(diagnosis: Diagnosis, step: Step) -> Json:
    """Return one turn of the selection."""
    return {
        "model": step.problem.model.name,
        "structured": step.score_test.structured,
        "p_value": step.score_test.p_value,
        "evidence": [_explained(one) for one in step.score_test.answers.values()],
        "candidates": _candidates(diagnosis, step) if step is not diagnosis.steps[0] else [],
    }


def _remaining(diagnosis: Diagnosis, step: Step) -> Json:
    strongest = step.score_test.strongest
    seen = {"family": strongest.family, "scope": strongest.scope}
    if diagnosis.disturbed and diagnosis.located is None:
        seen = {"family": "background", "scope": "shot"}
    return {
        "structured": _structured(diagnosis, step),
        "p_value": _p_value(diagnosis, step),
        "strongest": seen,
    }


def _structured(diagnosis: Diagnosis, step: Step) -> bool:
    """Return whether a residual is more than noise, or something else is always on the line."""
    return step.score_test.structured or diagnosis.disturbed


def _p_value(diagnosis: Diagnosis, step: Step) -> float:
    """Return the chance of what is seen if there were only noise."""
    seen = diagnosis.check_noise
    # what is not clear was asked in order to excuse structure, not to find some
    return min(step.score_test.p_value, seen.p_value if seen is not None and seen.clear else 1.0)


def _explained(found: Explained) -> Json:
    return {
        "family": found.family,
        "scope": found.scope,
        "p_value": found.p_value,
        "gain": found.gain,
        "numbers": found.dof,
    }


def _discrepancy(step: Step, located: Located | None) -> Json | None:
    """Return the learned discrepancy: figures, coefficients, curves and, where short, formula."""
    if located is None:
        return None
    by_family = located.discrepancy
    stated: Json = _explained(by_family) | {
        "heldout_gain": by_family.heldout_gain,
        "coefficients": dict(by_family.coefficients),
        "formula": _formula(located),
    }
    learned, other = located.learned, located.by_columns
    if learned is None:
        return {**stated, "learned": False, "curves": {"shots": [], "force": None}}
    return {
        **stated,
        "learned": True,
        **_learned(step, learned),
        "curves": residual.discrepancy_curves(step, learned),
        "by_columns": None if other is None or other is learned else _learned(step, other),
    }


def _learned(step: Step, learned: Learned) -> Json:
    """Return what a discrepancy consists of, its coefficients and its error."""
    return {
        "family": learned.family,
        "scope": learned.scope,
        "parts": [{"family": family, "scope": scope} for family, scope in learned.parts],
        "coefficients": dict(learned.coefficients),
        "by_shot": {
            label: _over_shots(values.tolist(), "1", step.problem.shots)
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
