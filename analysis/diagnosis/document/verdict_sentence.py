"""The verdict of a diagnosis in one sentence."""

from __future__ import annotations

from analysis.diagnosis.candidates.refit import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.fit import Learned
from analysis.diagnosis.discrepancy.mean_waveform import MeanWaveform
from analysis.diagnosis.document.family_words import FAMILIES
from analysis.diagnosis.document.noise_words import background_said, frequency
from analysis.diagnosis.procedure import Diagnosis
from analysis.effects.library import library
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult

UNITS = {
    "voltage": ("mV", 1e3),
    "force_N": ("N", 1.0),
    "acceleration_m_per_s2": ("m/s^2", 1.0),
}
"""What signals are told in, and a number's factor in it."""
COARSE_NOISE = (
    "what the converter's rounding leaves; its step is larger than the noise, so that quantisation "
    "limits what these data can show"
)


def sentence(diagnosis: Diagnosis, before: FitResult, after: FitResult) -> str:
    """Return the verdict in one sentence, and for what has no name what it looks like.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    before, after : FitResult
        The model without and with what was found.

    Returns
    -------
    str
        For people.
    """
    names = " and ".join(_named(r) for r in diagnosis.chosen)
    unit = (
        "mV" if before.problem.shots[0].shot.quantity == "voltage" else "e-3 of the signal's unit"
    )
    had, left, floor = (f"{1e3 * v:.3g}" for v in (before.rms, after.rms, before.noise_rms))
    fall = f"the residual falls from {had} to {left} {unit} rms"
    noise = f"the noise is {floor} {unit}"
    if diagnosis.verdict == "adequate":
        noise = f"noise{_rising(before)}" if not _coarse(before) else COARSE_NOISE
        return f"The model {before.model} explains the data: its residual is {noise}."
    if diagnosis.verdict == "identified":
        ends = f", which is noise ({noise})."
        if _structured(diagnosis):
            ends = (
                f" ({noise}). What remains beside the noise is less than 0.5 % of what it adds to "
                "the signal, as far as its equation can be trusted."
            )
        return f"Found: {names}; with it {fall}{ends}"
    if diagnosis.verdict == "family":
        if diagnosis.open_names:
            said = f"Found: {names}; with it {fall} ({noise}), but {_not_compared(diagnosis)}."
        else:
            others = ", ".join(diagnosis.confusable)
            said = f"Found: {names}, or what these data cannot tell from it ({others}); {fall}."
        return said
    if diagnosis.verdict == "partial":
        ends = f", but structure remains ({noise})"
        if diagnosis.disturbed and not _structured(diagnosis):
            ends = f" ({noise}), but beside it {_background(diagnosis)}"
        return f"Found in part: {names}; {fall}{ends}."
    if diagnosis.verdict == "unknown":
        return _unknown(diagnosis, before)
    return _not_identifiable(after)


def _named(found: Refit) -> str:
    """Return an effect's title and id, and where it acts unless it acts on everything."""
    said = f"{library()[found.effect_id].title} ({found.effect_id})"
    only = found.effect.only
    if only is None:
        return said
    present = {str(getattr(item.shot, only.kind)) for item in found.problem.shots}
    return f"{said} {only.words(present)}"


def _not_identifiable(result: FitResult) -> str:
    if result.undetermined and not result.out_of_range:
        return (
            f"The model {result.model} explains the data, but no modulus that was sought can be "
            "told from them."
        )
    return "These data could not show whether the model is complete."


def _not_compared(diagnosis: Diagnosis) -> str:
    """Return which names were not held against what was found."""
    said = "; ".join(
        f"{effect_id} was not held against {', '.join(diagnosis.confusable_with(effect_id))}"
        for effect_id in diagnosis.effect_ids
        if diagnosis.confusable_with(effect_id)
    )
    return f"the names are not certain: {said}"


def _unknown(diagnosis: Diagnosis, before: FitResult) -> str:
    if diagnosis.located is not None or not diagnosis.search_ended:
        what = (
            "that no effect of the library explains" if diagnosis.search_ended else "not yet named"
        )
        return (
            f"The model {before.model} misses something {what}"
            + _place(diagnosis)
            + _looks_like(diagnosis, before)
        )
    leaves = "explains what an impact causes"
    if _structured(diagnosis):
        leaves = "leaves no more than what is on the line anyway"
    return (
        f"The model {before.model} {leaves}, but {_background(diagnosis)}; nothing in the library "
        "does that: look at plugs, cables and the supply."
    )


def _looks_like(diagnosis: Diagnosis, before: FitResult) -> str:
    """Return what takes most of it up on held-out shots, where something does."""
    located = diagnosis.located
    if located is None:
        return ""
    said = _repair(located.by_columns, before, "It looks like {}")
    if located.learned is located.by_columns:
        return said
    return said + _repair(
        located.learned, before, "Best on other shots is {}" if said else "It looks like {}"
    )


def _repair(learned: Learned | None, before: FitResult, words: str) -> str:
    """Return what a discrepancy is and does on held-out shots, where that is worth a sentence."""
    if learned is None or not before.heldout_rms or not learned.heldout_rms:
        return ""
    fold = before.heldout_rms / learned.heldout_rms
    if fold < CRITERIA.words.heldout_fold:
        return ""
    like = ", and beside it ".join(FAMILIES.get(f, f) for f, _ in learned.parts[:2])
    return f" {words.format(like)}: with that the error on held-out shots falls {fold:.2g}-fold."


def beside_mean_waveform(
    mean: MeanWaveform, after_rms: float | None, problem: JointProblem
) -> list[str]:
    """Return what must be said where no model predicts as well as a mean of the other hits.

    Parameters
    ----------
    mean : MeanWaveform
        Of the same shots.
    after_rms : float or None
        Error of the repaired model on held-out shots. [unit of the signal]
    problem : JointProblem
        Says what the signals are.

    Returns
    -------
    list of str
        One sentence, or none.
    """
    if mean.heldout_rms is None or after_rms is None or mean.heldout_rms > after_rms:
        return []
    quantities = {item.shot.quantity for item in problem.shots}
    unit, factor = UNITS[quantities.pop()] if len(quantities) == 1 else ("of each record", 1.0)
    does = "better" if mean.heldout_rms < after_rms else "as well"
    return [
        f"A mean of the other hits, without any model, does {does} on held-out shots: "
        f"{factor * mean.heldout_rms:.3g} against {factor * after_rms:.3g} {unit}."
    ]


def _structured(diagnosis: Diagnosis) -> bool:
    return diagnosis.steps[-1].score_test.structured


def _background(diagnosis: Diagnosis) -> str:
    assert diagnosis.check_noise is not None
    return background_said(diagnosis.check_noise)


def _coarse(result: FitResult) -> bool:
    return any(s.item.noise.coarse is not None for s in result.shots)


def _rising(result: FitResult) -> str:
    """Return what a reader would else take for structure: that the noise rises like 1/f."""
    corners = [
        s.item.noise.corner * s.item.frame.sample_rate_hz
        for s in result.shots
        if s.item.noise.corner > 0.0
    ]
    return f", which rises like 1/f below {frequency(max(corners))}" if corners else ""


def _place(diagnosis: Diagnosis) -> str:
    """Return where it lives, with the slots that the data cannot rule out."""
    if diagnosis.slot is None or diagnosis.located is None:
        return "."
    if diagnosis.located.hardly_anywhere:
        share = diagnosis.located.gains[diagnosis.slot] / diagnosis.located.structure
        return (
            f"; no slot's closure explains much of it on other shots, {diagnosis.slot} most with "
            f"{100 * share:.0f} %."
        )
    if not diagnosis.located.also:
        return f"; it lives in the {diagnosis.slot} slot."
    names = [diagnosis.slot, *diagnosis.located.also]
    if len(names) == len(diagnosis.located.probabilities):
        return "; nothing says in which slot it lives."
    others = " or ".join(names)
    return f"; the data cannot tell whether it lives in the slot {others}."
