"""What a diagnosis says, as JSON: ``impactd-diagnosis/1``."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from analysis.discovery.candidates import Refit
from analysis.discovery.closure_curve import closure_curves
from analysis.discovery.description import describe
from analysis.discovery.diagnosis import Diagnosis
from analysis.discovery.evidence import Explained
from analysis.discovery.named_model import definition_of
from analysis.discovery.omnibus import ask
from analysis.discovery.quality import heldout_or_none, quality
from analysis.discovery.reasons import not_refitted, why_not
from analysis.discovery.trail import Step
from analysis.discovery.verdict_sentence import sentence
from analysis.effects.library import library
from analysis.fit.measurand import Json
from analysis.fit.result import FitResult
from analysis.fit.statements import effect_parameters_json, parameters_json

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
    stated = _block(after)
    if diagnosis.verdict == "unknown" and diagnosis.closure is not None:
        stated = with_closure(after, last, diagnosis.closure)
    slots = {} if diagnosis.verdict == "adequate" else _slots(first)
    next_drop = getattr(diagnosis, "next_drop", None)
    document: Json = {
        "format": FORMAT,
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis, before, after),
        "p_value": first.omnibus.p_value,
        "noise_rms_V": before.noise_rms,
        "effects": [
            _effect(refit, after, diagnosis.confusable if place == 0 else [])
            for place, refit in enumerate(diagnosis.chosen)
        ],
        "slot": diagnosis.slot,
        "slots": slots,
        "before": _block(before),
        "after": stated,
        "accepted_model": definition_of(after.problem, after.fitted) if diagnosis.chosen else None,
        "remaining": _remaining(last),
        "closure": _closure(diagnosis, before),
        "candidates": _candidates(diagnosis, first),
        "trail": [_turn(diagnosis, step) for step in diagnosis.steps],
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
        "pairs": result.pairs(),
        "parameters": result.parameters(),
        "flags": result.flags(),
    }


def with_closure(result: FitResult, step: Step, closure: Explained) -> Json:
    """Return the figures of a model with its learned closure, to first order.

    Parameters
    ----------
    result : FitResult
        The model without it.
    step : Step
        The turn whose residual the closure was learned from.
    closure : Explained
        What it explains.

    Returns
    -------
    dict
        As a block; ``first_order`` is true, and moduli that were to be found are withheld, because
        nobody knows how far something unnamed moves them.
    """
    chi2 = step.evidence.chi2
    floor = min(result.degrees_of_freedom / chi2, 1.0)

    def left(gain: float) -> float:
        """Return the share of the residual's rms that a gain leaves."""
        # no better than the noise, no worse than without: a closure that does harm is not used
        return math.sqrt(min(max(1.0 - gain / chi2, floor), 1.0))

    block = _block(result)
    share = left(closure.gain)
    block.update(
        model=f"{result.model}+closure({closure.family} by {closure.scope})",
        first_order=True,
        rms_V=result.rms * share,
        nrmse=result.nrmse * share,
        r2=1.0 - (1.0 - result.r2) * share**2,
        chi2_per_dof=result.chi2_per_dof * share**2,
        parameters={},
        pairs={},
    )
    if result.heldout_rms is not None:
        block["heldout_rms_V"] = result.heldout_rms * left(closure.heldout_gain)
    block["moduli"] = {
        name: entry if entry["status"] == "reference" else _withheld(entry)
        for name, entry in block["moduli"].items()
    }
    return block


def _withheld(entry: Json) -> Json:
    return {
        "youngs_modulus_Pa": None,
        "plane_strain_modulus_Pa": None,
        "side": entry["side"],
        "status": "withheld",
        "reason": "something unnamed acts on these shots, and nobody knows how far it moves this",
    }


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
    return {
        "id": refit.owner,
        "form": refit.effect.id,
        "slot": refit.effect.slot,
        "title": refit.effect.title,
        "scope": refit.scope,
        "parameters": {name: _quantity(value) for name, value in parameters.items()},
        "confusable_with": list(confusable),
    }


def _quantity(value: Json | None) -> Json:
    # an owner of whom the effect asks nothing has no finite value (a stiffness without limit)
    return {"value": None, "u": None, "unit": ""} if value is None else value


def _candidates(diagnosis: Diagnosis, step: Step) -> list[Json]:
    """Return every effect of the library with what became of it in one turn, best first."""
    found = []
    for refit in step.refits:
        held = heldout_or_none(refit.problem, refit.fitted)
        found.append(
            {
                "id": refit.owner,
                "form": refit.effect.id,
                "slot": refit.effect.slot,
                "scope": refit.scope,
                "numbers": refit.parameters,
                "heldout_rms_V": held,
                "delta_log_likelihood": refit.gain / 2.0,
                "at_bound": refit.at_bound,
                "converged": refit.fitted.converged,
                "why_not": why_not(diagnosis, step, refit),
            }
        )
    if not step.omnibus.structured:
        return found
    for owner, effect in library().items():
        if owner not in {r.owner for r in step.refits}:
            found.append(
                {
                    "id": owner,
                    "form": owner,
                    "slot": effect.slot,
                    "heldout_rms_V": None,
                    "delta_log_likelihood": None,
                    "at_bound": False,
                    "why_not": not_refitted(step, owner),
                }
            )
    return found


def _turn(diagnosis: Diagnosis, step: Step) -> Json:
    """Return one turn of the loop."""
    return {
        "model": step.problem.model.name,
        "structured": step.omnibus.structured,
        "p_value": step.omnibus.p_value,
        "evidence": [_explained(e, brief=True) for e in step.omnibus.answers.values()],
        "candidates": _candidates(diagnosis, step) if step is not diagnosis.steps[0] else [],
    }


def _remaining(step: Step) -> Json:
    strongest = step.omnibus.strongest
    return {
        "structured": step.omnibus.structured,
        "p_value": step.omnibus.p_value,
        "strongest": {"family": strongest.family, "scope": strongest.scope},
    }


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


def _closure(diagnosis: Diagnosis, before: FitResult) -> Json | None:
    learned = diagnosis.closure
    if learned is None:
        return None
    return {**_explained(learned), "curves": closure_curves(diagnosis.steps[0], before, learned)}


def _slots(step: Step) -> Json:
    """Return what any effect in each slot could explain on held-out shots."""
    chi2 = step.evidence.chi2
    gains = ask(step.evidence, heldout=True).slot_gains()
    return {
        slot: {"heldout_gain": gain, "share_of_residual": max(gain, 0.0) / chi2}
        for slot, gain in gains.items()
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
