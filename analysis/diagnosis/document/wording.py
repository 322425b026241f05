"""A diagnosis in words: verdict, noise, families of columns, reasons for rejection."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kruskal, norm, spearmanr

from analysis.aliases import Array, Json
from analysis.base_models import DEFAULT_BASE
from analysis.campaign import shot_words
from analysis.diagnosis.basis.proposals import scopes_of
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.fit import Learned
from analysis.diagnosis.discrepancy.mean_waveform import MeanWaveform
from analysis.diagnosis.noise_check import Background
from analysis.diagnosis.odd_shots import SetAside
from analysis.diagnosis.procedure import Diagnosis
from analysis.diagnosis.selection import Step
from analysis.effects.acts_on import ActsOn
from analysis.effects.library import effect_named, library
from analysis.fit.physical_range import out_of_range
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.result import FitResult
from analysis.model.impact_model import COUPON, FORCE_END, LAWS, REACTION
from analysis.noise import NoiseModel

WITHOUT_LAW = {
    REACTION: "a dashpot that does not load the crystal",
    COUPON: "a coupon without mass",
    FORCE_END: "a contact that ends with its indentation",
}
FAMILIES = {
    "response": "a linear chain: delays, slow decays, resonances",
    "static": "a nonlinearity of the signal",
    "dynamic": "a nonlinearity of the signal's slope",
    "contact": "a contact force over depth and rate",
    "loss": "a force on the sphere alone",
    "cell": "the cell's own numbers",
    "speed": "the impact speed that follows from a height",
    "waveform": "a waveform locked to the record, from before touch-down on",
    "mean_waveform": "the mean waveform of a pair's other hits, in place of the model",
    "locked": "anything at a fixed time after touch-down",
    "law": "more than the usual error of a published law",
    "background": "a disturbance that is always on the line",
    "ringing": "resonances after the signal",
    "memory": "delays and slow decays after the signal",
    "bend": "a smooth nonlinearity of the signal",
    "top": "a nonlinearity at the signal's top",
    "outline": "a waveform locked to touch-down",
    "curve": "a nonlinearity of the signal",
    "fine": "a nonlinearity of the signal, in small steps",
    "ripple": "a periodic function of the signal, as of uneven steps of a converter",
    "path": "a nonlinearity that differs between rise and fall",
    "creep": "a memory from microseconds to milliseconds",
    "impulse": "a linear chain of any impulse response",
    "slew": "a limit of the signal's slope",
    "seat": "a force on the crystal that is a nonlinear function of its motion",
    "droop": "a gain that falls with the past signal",
    "alternate": "a difference between odd and even samples, as of a converter with two halves",
    "baseline": "a baseline that is not constant",
    "warmth": "a memory of the signal's square or cube, as of something that warms",
    "blow": "a second impact, at its own time in every shot",
    "pieces": "a gain that changes within the contact",
    "jump": "a clock that jumps once, as when samples are lost",
    "clock": "a clock that oscillates",
    "swing": "an oscillation that is also there before the impact",
    "mode": "a resonance that the impact sets off",
    "damped": "a resonance that the impact sets off",
    "gain": "the cell's gain",
    "pitch": "the cell's frequency and damping",
    "stiffness": "the stiffness of the contact",
    "force_elastic": "a free contact force over depth",
    "force_rate": "a free contact force over the rate of depth",
}
"""What each takes up; more are said by their name."""

UNITS = {
    "voltage": ("mV", 1e3),
    "force_N": ("N", 1.0),
    "acceleration_m_per_s2": ("m/s^2", 1.0),
}
"""Unit in which a signal is given, and a number's factor in it."""


# -- numbers -------------------------------------------------------------------------------------
def times_noise(squares: float) -> str:
    """Return whitened squares a sample as a ratio of rms to noise.

    To three digits, or more where three would make it 1, which it is not.
    """
    ratio = math.sqrt(max(squares, 0.0))
    if ratio >= 1000:
        return f"{ratio:,.0f}"
    digits = next((n for n in range(3, 7) if f"{ratio:.{n}g}" != "1"), 3)
    return f"{ratio:.{digits}g}"


def told_apart(one: float, other: float, *beside: float) -> list[str]:
    """Return numbers as text: three digits each, and as many that the first two differ."""
    least = _decimals(min(one, other))
    decimals = next(
        (n for n in range(least, least + 4) if f"{one:.{n}f}" != f"{other:.{n}f}"), least
    )
    return [f"{value:.{max(decimals, _decimals(value))}f}" for value in (one, other, *beside)]


def _decimals(value: float) -> int:
    return max(0, 2 - math.floor(math.log10(value))) if value > 0.0 else 2


def frequency(hz: float) -> str:
    """Return a frequency to two digits, in Hz or kHz."""
    return f"{two_digits(hz / 1e3)} kHz" if hz >= 1e3 else f"{two_digits(hz)} Hz"


def two_digits(number: float) -> str:
    """Return a number to two digits as it is said: 4100, never 4.1e+03."""
    return f"{float(f'{number:.2g}'):.12g}"


def three_digits(number: float) -> str:
    """Return a number to three digits as it is said: 1050, never 1.05e+03."""
    return f"{float(f'{number:.3g}'):.12g}"


# -- the verdict ---------------------------------------------------------------------------------
def set_aside_sentences(set_aside: Sequence[SetAside]) -> list[str]:
    """Return which shots were set aside and why; nothing where there are none."""
    said = [
        f"S{shot_words(one.shot, one.name)[1:]} does not belong. {one.because}" for one in set_aside
    ]
    count = len(said)
    rest = "The other shots are judged without " + ("it." if count == 1 else f"these {count}.")
    return [*said, rest] if said else []


def polarity_sentences(result: FitResult) -> list[str]:
    """Return which records are upside down where others are not; nothing where all are alike."""
    turned = [one.item.shot.name for one in result.shots if one.is_upside_down]
    if not 0 < len(turned) < len(result.shots):
        return []
    records, are = ("record", "is") if len(turned) == 1 else ("records", "are")
    return [
        f"The {records} {', '.join(turned)} {are} upside down and the others are not: check how "
        "the load cell was wired then. They are judged with their sign turned."
    ]


def form_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each effect of which the data do not tell the form."""
    said = []
    for taken in diagnosis.chosen:
        forms = diagnosis.forms_as_good.get(taken.effect_id)
        if forms:
            others = " and ".join(one.effect.id for one in forms)
            said.append(
                f"These data do not distinguish the form {taken.effect.id} from {others}: the "
                "intervals of its numbers and of the moduli hold for each."
            )
    return said


def seen_on_sentences(effects: Sequence[Json]) -> list[str]:
    """Return a sentence for each effect that some materials do not show, as the document has it."""
    said = []
    for one in effects:
        where = " and ".join(some["words"] for some in one["seen_on"])
        if where:
            said.append(
                f"Only the shots {where} show {one['id']}: these data do not tell whether it acts "
                "on the others too."
            )
    return said


def base_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence where the records chose another base model than the default.

    Where structure is left what is missing may have chosen it.
    """
    model = diagnosis.steps[0].problem.model
    base = model.base_name
    if diagnosis.base_asked is not None or base == DEFAULT_BASE:
        return []
    left_out = " and ".join(WITHOUT_LAW[law] for law in LAWS if not model.obeys(law))
    if not diagnosis.leaves_noise:
        return [
            f"The diagnosis starts from {base} ({left_out}), which fits better than the closed "
            f"{DEFAULT_BASE}. Structure remains, so what is missing may be the reason for that."
        ]
    return [
        f"These records obey {base} rather than the closed {DEFAULT_BASE} ({left_out}), as only a "
        f"simulated rig can: the diagnosis starts from {base}."
    ]


def _mistake_sentence(diagnosis: Diagnosis, names: str, noise: str) -> str:
    """Return it; ``names`` are the effects beside the mistake, empty of none."""
    found, *near = (one.sentence for one in diagnosis.mistakes)
    kind, without = "A mistake, not an effect", "without it"
    if names:
        kind, without = f"Found: {names}, and a mistake", "with the effect and without the mistake"
    said = f"{kind}: {found}; {without} only noise is left ({noise})."
    rivals = [*near, *diagnosis.effects_as_good]
    if rivals:
        said += f" These data cannot distinguish it from: {'; '.join(rivals)}."
    elif diagnosis.confusable:
        said += f" Instead of the effect it may be {' or '.join(diagnosis.confusable)}."
    elif diagnosis.verdict == "family":
        said += " The time was over before it was compared with every effect."
    return said


def verdict_sentence(
    diagnosis: Diagnosis, before: FitResult, after: FitResult, moved: Sequence[str]
) -> str:
    """Return the verdict in one sentence, with a description of what has no name.

    ``before`` and ``after`` are the model without and with what was found, ``moved`` is what
    `moved_moduli` says of them.
    """
    names = " and ".join(_named(refit) for refit in diagnosis.chosen)
    unit, factor = UNITS[before.problem.shots[0].shot.quantity]
    had, left, floor = told_apart(
        factor * before.rms, factor * after.rms, factor * before.noise_rms
    )
    way = "falls" if after.rms < before.rms else "rises"
    gain = sum(refit.gain for refit in diagnosis.chosen) / 2.0
    rise = [f"the log-likelihood rises by {three_digits(gain)}"] if gain > 0.0 else []
    fall = ", ".join([*moved, *rise, f"the residual {way} from {had} to {left} {unit} rms"])
    noise = f"the noise is {floor} {unit}"
    structured = diagnosis.steps[-1].score_test.structured
    if diagnosis.mistakes:
        said = _mistake_sentence(diagnosis, names, f"{floor} {unit}")
    elif diagnosis.verdict == "adequate":
        said = f"The model {before.model} explains the data: its residual is {_noise_left(before)}."
    elif diagnosis.verdict == "identified":
        ends = f", which is noise ({noise})."
        if structured:
            ends = (
                f" ({noise}). The rest of the residual beyond the noise is less than 0.5 % of "
                "what the effect adds to the signal, which is the accuracy of its equation."
            )
        said = f"Found: {names}; with it {fall}{ends}"
    elif diagnosis.verdict == "family" and diagnosis.open_names:
        uncompared = "; ".join(
            f"{effect_id} was not compared with {', '.join(beside)}"
            for effect_id in diagnosis.effect_ids
            if (beside := diagnosis.confusable_with(effect_id))
        )
        but = f"but the names are not certain: {uncompared}"
        said = f"Found: {names}; with it {fall} ({noise}), {but}."
    elif diagnosis.verdict == "family":
        others = ", ".join(diagnosis.confusable)
        said = (
            f"Found: {names}, or another that these data cannot distinguish from it ({others}); "
            f"with it {fall}."
        )
    elif diagnosis.verdict == "partial":
        ends = f", but structure remains ({noise})"
        if diagnosis.disturbed:
            remains = "but structure remains, and" if structured else "but in addition"
            ends = f" ({noise}), {remains} {background_words(diagnosis.check_noise)}"
        why = "".join(f" The records show it: {one.sentence}." for one in diagnosis.shown)
        said = f"Found in part: {names}; with it {fall}{ends}.{why}"
    elif diagnosis.verdict == "unknown":
        said = _unknown(diagnosis, before)
    elif after.undetermined and not after.out_of_range:
        said = (
            f"The model {after.model} explains the data, but the data determine no modulus "
            "that was sought."
        )
    else:
        said = "These data could not show whether the model is complete."
    return said


def moved_moduli(before: Json, after: Json) -> list[str]:
    """Return by how much what was found moves each modulus that was sought and is stated."""
    said = []
    for name, entry in after.items():
        old = before.get(name, {}).get("plane_strain_modulus_Pa")
        new = entry.get("plane_strain_modulus_Pa")
        if entry["status"] != "fitted" or not old or not new:
            continue
        moved = new["value"] - old["value"]
        said.append(
            f"E/(1-nu^2) of {name} moves by {100.0 * moved / old['value']:+.2g} % "
            f"({two_digits(abs(moved) / new['u'])} times its standard uncertainty)"
        )
    return said


def heldout_sentences(diagnosis: Diagnosis, block: Json, problem: JointProblem) -> list[str]:
    """Return what it means that a model leaves noise, but errs more on shots left out.

    ``block`` has the figures of that model. More is what `CRITERIA` calls a surplus of squares.
    """
    rms, held = block.get("rms_V"), block.get("heldout_rms_V")
    surplus = CRITERIA.little
    if not diagnosis.leaves_noise or not rms or not held or held**2 <= (1.0 + surplus) * rms**2:
        return []
    quantities = {item.shot.quantity for item in problem.shots}
    unit, factor = UNITS[quantities.pop()] if len(quantities) == 1 else ("of each record", 1.0)
    on_held, on_all = told_apart(factor * held, factor * rms)
    return [
        f"On held-out shots its error is {on_held} {unit} rather than {on_all} {unit}: the other "
        f"shots do not determine the {len(problem.names)} shared numbers well enough to predict "
        "these. The verdict is about the shots at hand; more drop heights and repetitions would "
        "test it further."
    ]


def _named(found: Refit) -> str:
    """Return an effect's title and id, and where it acts unless it acts on everything."""
    where = where_it_acts(found)
    title = found.effect.title or library()[found.effect_id].title
    said = f"{title} ({found.effect_id})"
    return f"{said} {where}" if where else said


def where_it_acts(found: Refit) -> str:
    """Return on which materials an effect acts; nothing of one that acts on everything."""
    only = found.effect.only
    return "" if only is None else on_materials(only, found.problem)


def on_materials(some: ActsOn, problem: JointProblem) -> str:
    """Return some of a campaign's materials in words."""
    return some.words({str(getattr(item.shot, some.kind)) for item in problem.shots})


def _noise_left(result: FitResult) -> str:
    """Return what a residual is that is noise, and below which frequency it rises."""
    noises = [s.item.noise for s in result.shots]
    if any(noise.coarse is not None for noise in noises):
        return (
            "the converter's rounding error; its step is larger than the noise, so quantisation "
            "limits what these data can show"
        )
    rates = [s.item.frame.sample_rate_hz for s in result.shots]
    slow = [(n.corner * rate, n) for n, rate in zip(noises, rates, strict=True) if n.corner > 0.0]
    if not slow:
        return "noise"
    corner, noise = max(slow, key=lambda one: one[0])
    return f"noise, which rises like {noise_kind(noise)} below {frequency(corner)}"


def _unknown(diagnosis: Diagnosis, before: FitResult) -> str:
    """Return what is known of an unnamed effect: slot, appearance, best discrepancy."""
    located = diagnosis.located
    if located is None and diagnosis.search_ended:
        leaves = "explains the impact"
        if diagnosis.steps[-1].score_test.structured:
            leaves = "leaves only what is always on the line"
        disturbance = background_words(diagnosis.check_noise)
        return (
            f"The model {before.model} {leaves}, but {disturbance}; no effect of the library does "
            "that: check plugs, cables and the supply."
        )
    what = "that no effect of the library explains" if diagnosis.search_ended else "not yet named"
    said = f"The model {before.model} misses something {what}{_place(diagnosis)}"
    if located is None:
        return said
    looks = _repair("It looks like", located.by_columns, before)
    if located.learned is not located.by_columns:
        looks += _repair(
            "Best on other shots is" if looks else "It looks like", located.learned, before
        )
    return said + looks


def _repair(begin: str, learned: Learned | None, before: FitResult) -> str:
    """Return what a discrepancy is and does on held-out shots, where that is worth a sentence."""
    if learned is None or not before.heldout_rms or not learned.heldout_rms:
        return ""
    fold = before.heldout_rms / learned.heldout_rms
    if fold < CRITERIA.noticeable:
        return ""
    like = ", together with ".join(FAMILIES.get(f, f) for f, _ in learned.parts[:2])
    return f" {begin} {like}: with it the error on held-out shots falls {fold:.2g}-fold."


def _place(diagnosis: Diagnosis) -> str:
    """Return where it lives, with the slots that the data cannot rule out."""
    slot, located = diagnosis.slot, diagnosis.located
    if slot is None or located is None:
        return "."
    if located.hardly_anywhere:
        share = located.gains[slot] / located.structure
        return (
            f"; no slot's discrepancy explains much of it on other shots, {slot} most with "
            f"{100 * share:.0f} %."
        )
    names = [slot, *located.also]
    if len(names) == 1:
        return f"; it is in the {slot} slot."
    if len(names) == len(located.probabilities):
        return "; the data do not say in which slot it is."
    return f"; the data cannot distinguish the slots {' and '.join(names)}."


def beside_mean_waveform(
    mean: MeanWaveform, after_rms: float | None, problem: JointProblem
) -> list[str]:
    """Return a sentence where no model predicts as well as a mean of the other hits, or none.

    ``after_rms`` is the error of the repaired model on held-out shots. [unit of the signal]
    """
    if mean.heldout_rms is None or after_rms is None or mean.heldout_rms > after_rms:
        return []
    quantities = {item.shot.quantity for item in problem.shots}
    unit, factor = UNITS[quantities.pop()] if len(quantities) == 1 else ("of each record", 1.0)
    does = "better" if mean.heldout_rms < after_rms else "as well"
    return [
        f"A mean of the other hits, without any model, does {does} on held-out shots: "
        f"{' against '.join(told_apart(factor * mean.heldout_rms, factor * after_rms))} {unit}."
    ]


# -- the noise -----------------------------------------------------------------------------------
def noise_kind(noise: NoiseModel) -> str:
    """Return the kind of noise in a word or two, from ``white`` to ``unknown colour``."""
    if noise.source == "differences":
        return "unknown colour"
    if noise.coarse is not None:
        return "quantisation"
    if noise.corner > 0.0:
        return "1/f" if noise.slope == 1 else f"1/f^{noise.slope}"
    return "autoregressive" if noise.order else "white"


def noise_sentences(noise: NoiseModel, rate_hz: float) -> list[str]:
    """Return sentences about an instrument's noise."""
    kind = noise_kind(noise)
    if kind == "unknown colour":
        return [
            "No record has a quiet interval: the level of the noise is estimated from "
            "differences of neighbouring samples, its colour is not known, and structure may be "
            "colour."
        ]
    if noise.source == "end":
        return [
            "No record has a quiet interval before the pulse: the noise is that of the ends of the "
            "records, once the ringing has died away."
        ]
    if noise.coarse is not None:
        return [
            f"Quantisation limits: the converter's step is {two_digits(1.0 / noise.coarse.noise)} "
            "times the noise before the trigger, or more. Its rounding error, step over "
            "sqrt(12), is treated as noise, and samples within a step of one another count as "
            "one value."
        ]
    like = {
        "autoregressive": (
            f"is correlated from sample to sample (autoregressive, order {noise.order})"
        ),
        "white": "is white",
    }.get(kind, f"rises like {kind} below {frequency(noise.corner * rate_hz)}")
    judged = "" if kind == "white" else "; the tests of residuals account for that"
    said = [f"The noise before the trigger {like}{judged}."]
    far = CRITERIA.twice * noise.drift_expected_rms
    if noise.drift_rms is not None and noise.drift_rms > far:
        times = noise.drift_rms / noise.drift_expected_rms
        said.append(
            f"Before the trigger the records also drift slowly, {times:.3g} times as far as noise "
            "would, as hum does. The drift is not counted as noise."
        )
    if noise.calm_share < 1.0:
        said.append(
            f"The last {1.0 - noise.calm_share:.0%} of the record before the pulse are louder "
            "than the noise: a precursor, or a non-causal filter. The noise is estimated from "
            "the quiet beginning alone."
        )
    return said


def background_words(seen: Background | None) -> str:
    """Return the part of a sentence that says what is on the line all the time."""
    assert seen is not None
    said = []
    spikes, tone = seen.spikes, seen.tone
    if spikes.clear:
        why = (
            f"excess kurtosis {spikes.excess_kurtosis:.2g} of {spikes.samples} quiet samples; "
            "Gaussian noise has 0"
        )
        if spikes.far:
            far = CRITERIA.deviations
            chance = 2.0 * float(norm.sf(far)) * spikes.samples
            why = (
                f"{spikes.far} of {spikes.samples} quiet samples lie beyond {far:g} standard "
                f"deviations; Gaussian noise leaves {chance:.1g}"
            )
        said.append(f"spikes or jumps occur at any time, also before the trigger ({why})")
    if tone is not None and tone.clear:
        said.append(
            f"a tone of {frequency(tone.frequency_hz)} is always there, also before the trigger "
            f"({tone.times:.3g} times the noise next to it)"
        )
    return " and ".join(said)


# -- why a candidate was not named ---------------------------------------------------------------
def why_not(diagnosis: Diagnosis, step: Step, refit: Refit) -> str | None:
    """Return why a candidate was not taken in a turn of the loop; None for the one that was."""
    taken = taken_in(diagnosis, step)
    if refit is taken:
        return None
    if not fitted_to_the_end(refit):
        return "not fitted to the end: its fit was far behind the others when those were continued"
    if refit.at_bound:
        return _not_physical(refit)
    if refit.score() < CRITERIA.least_lead:
        cost = "number costs" if refit.parameters == 1 else f"{refit.parameters} numbers cost"
        return (
            f"it lowers the misfit by {max(refit.gain, 0.0):.3g}, less than its {cost} by chance "
            "alone"
        )
    return _beaten(diagnosis, step, refit, taken)


def taken_in(diagnosis: Diagnosis, step: Step) -> Refit | None:
    """Return the candidate that a turn of the loop took; None where it took none.

    What the selection put in another's place afterwards is among no turn's candidates: it belongs
    to the turn whose model it extends.
    """
    chosen, tried = diagnosis.chosen, [r for one in diagnosis.steps for r in one.refits]
    for place, one in enumerate(chosen):
        if any(one is r for r in step.refits):
            return one
        in_turn = place < len(diagnosis.steps) and diagnosis.steps[place] is step
        if in_turn and not any(one is r for r in tried):
            return one
    return None


def fitted_to_the_end(refit: Refit) -> bool:
    """Tell whether a candidate's fit got as far as the model that it extends.

    With its effect at nothing it fits as well; one that fits worse is still on its way from afar.
    """
    return refit.gain > -CRITERIA.no_difference


def _not_physical(refit: Refit) -> str:
    """Return why a fit has not found the effect whose numbers it has."""
    if refit.effect.basis is not None:
        return (
            "it is not there before the trigger, or its sizes and phases are alike in all shots, "
            "but the mains are not synchronous with a drop"
        )
    if refit.gain < CRITERIA.price_of_number * refit.own:
        return "every shot needs its own number, and these lower the misfit too little"
    outside = out_of_range(refit.problem, refit.fitted)
    if outside:
        return "; ".join(one.sentence for one in outside)
    bounds = "; ".join(
        f"{p.name} within {p.low:g} .. {p.high:g} {p.unit}".removesuffix(" 1")
        for p in refit.effect.parameters
    )
    return f"its best fit leaves what is physically possible ({bounds})"


def _beaten(diagnosis: Diagnosis, step: Step, refit: Refit, taken: Refit | None) -> str:
    """Return why a candidate that helps and is possible was still not taken."""
    seen_without_model = taken is not None and taken.effect.id in {o.form for o in diagnosis.shown}
    if taken is None and step is not diagnosis.steps[-1]:
        return "an effect that was added later explains it better"
    if taken is None or seen_without_model:  # no fit was compared with what records show alone
        left = f"it leaves a residual of {_left(refit)} times the noise"
        return f"{left}; what remains is still structured"
    if refit.effect_id in diagnosis.confusable and step is diagnosis.steps[0]:
        return f"these data cannot distinguish it from {taken.effect_id}"
    behind = (taken.gain - refit.gain) / 2.0
    if refit.effect_id == taken.effect_id:
        said = "the effect was taken in another form or grouping"
    elif behind > 0.0:
        said = f"its log-likelihood is {three_digits(behind)} below that of {taken.effect_id}"
    elif not refit.on_all_shots:  # what it explains of a part says little of all
        said = f"on the part of the shots that it was fitted to, {taken.effect_id} was ahead"
    else:
        said = (
            f"its log-likelihood is {three_digits(-behind)} above that of {taken.effect_id}, less "
            "than what its further numbers cost"
        )
    return said


def _left(refit: Refit) -> str:
    """Return the rms that a candidate leaves over the noise, four nuisances a shot counted."""
    used = sum(s.expected_squares - 4 for s in refit.problem.shots) - len(refit.problem.names)
    return times_noise(sum(b.chi2 for b in refit.fitted.blocks) / max(used, 1))


def not_refitted(step: Step, effect_id: str) -> str:
    """Return why an effect of the library was not refitted in a step of the search."""
    if effect_id in step.refused:
        return f"not tried: {step.refused[effect_id]}"
    if effect_id in (e.id.partition(":")[0] for e in step.problem.model.effects):
        return "already in the model"
    gains = [
        step.linearised.explain(key, scope, heldout=False).gain
        for key in step.linearised.families
        if "@" in key and key.partition("@")[0].partition(":")[0] == effect_id
        for scope in scopes_of(effect_named(key.partition("@")[0]))
    ]
    if not gains:
        return "not tried before the time was over" if step.unfinished else "not tried"
    share = max(gains) / max(step.linearised.chi2, 1e-300)
    return (
        f"to first order it explains {share:.1%} of the residual's energy; others explained more "
        "and were fitted"
    )


# -- numbers of single shots ---------------------------------------------------------------------
def dependence(values: Sequence[float], shots: Sequence[FitShot]) -> list[str]:
    """Return what a number of every shot goes with; nothing where chance could order them so.

    Shots are in order of time. Ranks only, so that neither a wild shot nor the law of the
    dependence matters: Kruskal-Wallis between materials, with a p-value below
    ``CRITERIA.single_question_rate``; Spearman's rank correlation with order and height, over
    all shots and over each coupon's, of which the smallest p-value times their number is.
    """
    found = np.asarray(values, dtype=np.float64)
    if found.size < CRITERIA.least_shots or np.ptp(found) == 0.0:
        return []
    coupons = np.array([s.shot.surface or "?" for s in shots])
    spheres = np.array([s.shot.sphere or "?" for s in shots])
    said, largest_p = [], CRITERIA.single_question_rate
    for what, names in (("coupon", coupons), ("sphere", spheres)):
        by_name = {name: found[names == name] for name in sorted(set(names.tolist()))}
        if len(by_name) > 1 and kruskal(*by_name.values()).pvalue <= largest_p:
            medians = ", ".join(f"{name} {np.median(own):.3g}" for name, own in by_name.items())
            said.append(f"correlates with the {what}: {medians}")
    groups = {"": np.full(found.size, fill_value=True)}
    groups |= {f" on {name}": coupons == name for name in sorted(set(coupons.tolist()))}
    said += _along("from drop to drop", found, np.arange(found.size, dtype=np.float64), groups)
    heights = [s.shot.drop_height_m for s in shots]
    if None not in heights:
        said += _along("with the drop height", found, np.array(heights, dtype=np.float64), groups)
    return said


def _along(
    what: str, values: Array, place: Array, groups: dict[str, NDArray[np.bool_]]
) -> list[str]:
    """Return whether a number rises or falls along something, where it does so most clearly."""
    found = []
    for where, group in groups.items():
        one, other = values[group], place[group]
        enough = one.size >= CRITERIA.least_shots
        if enough and np.ptp(one) > 0.0 and np.ptp(other) > 0.0:
            correlation, p = map(float, spearmanr(one, other))
            found.append((p, correlation, where))
    p, correlation, where = min(found, key=lambda one: one[0], default=(1.0, 0.0, ""))
    if p * len(groups) > CRITERIA.single_question_rate:
        return []
    turn = "rises" if correlation > 0.0 else "falls"
    return [f"{turn} {what}{where}, rank correlation {correlation:.2f}"]
