"""What the noise before the trigger is like, as JSON and in words, and residuals beside it."""

from __future__ import annotations

import math

from scipy.stats import norm

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.noise_check import Background
from analysis.fit.measurand import Json
from analysis.fit.result import FitResult
from analysis.noise import NoiseModel


def times_noise(squares: float) -> str:
    """Return whitened squares a sample as a multiple of the noise.

    Parameters
    ----------
    squares : float
        Mean square of a whitened residual. [1]

    Returns
    -------
    str
        The ratio of the two rms values, to three digits.
    """
    ratio = math.sqrt(max(squares, 0.0))
    return f"{ratio:.3g}" if ratio < 1000 else f"{ratio:,.0f}"


def noise_json(result: FitResult, seen: Background | None = None) -> Json:
    """Return the noise that a fit is judged by.

    Parameters
    ----------
    result : FitResult
        With the noise as measured.
    seen : Background, optional
        What is on the line all the time.

    Returns
    -------
    dict
        ``instruments``, one entry for each; ``background``, or None; ``said``, what a person should
        know before anything is said of a residual.
    """
    entries, said = [], []
    known: set[tuple[str, float]] = set()
    for shot in result.shots:
        noise, rate = shot.item.noise, shot.item.frame.sample_rate_hz
        instrument = (shot.item.shot.quantity, rate)
        if instrument in known:
            continue
        known.add(instrument)
        entries.append(_entry(noise, rate) | {"quantity": instrument[0]})
        said += [s for s in noise_sentences(noise, rate) if s not in said]
    if seen is not None and seen.clear:
        said.append(f"It is no plain noise: {background_said(seen)}.")
    return {
        "instruments": entries,
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


def background_said(seen: Background) -> str:
    """Return in words what is on the line all the time.

    Parameters
    ----------
    seen : Background
        With something that is no noise.

    Returns
    -------
    str
        The part of a sentence.
    """
    said = []
    spikes, tone = seen.spikes, seen.tone
    if spikes.clear:
        told = (
            f"excess kurtosis {spikes.excess_kurtosis:.2g} of {spikes.samples} quiet samples; "
            "Gaussian noise has 0"
        )
        if spikes.far:
            chance = 2.0 * float(norm.sf(CRITERIA.noise.far_deviations)) * spikes.samples
            told = (
                f"{spikes.far} of {spikes.samples} quiet samples lie beyond "
                f"{CRITERIA.noise.far_deviations:g} standard deviations; "
                f"Gaussian noise leaves {chance:.1g}"
            )
        said.append(f"spikes or jumps come at any time, also before the trigger ({told})")
    if tone is not None and tone.clear:
        said.append(
            f"a tone of {frequency(tone.frequency_hz)} is there all the time, also before the "
            f"trigger ({tone.times:.3g} times the noise beside it)"
        )
    return " and ".join(said)


def _entry(noise: NoiseModel, rate_hz: float) -> Json:
    short = noise.coefficients if noise.short is None else noise.short
    return {
        "sample_rate_Hz": rate_hz,
        "rms": noise.rms,
        "kind": kind_of(noise),
        "autoregressive_order": int(short.size),
        "corner_Hz": noise.corner * rate_hz if noise.corner else None,
        "filter_samples": noise.order,
        "converter_step": None if noise.coarse is None else noise.coarse.step,
        "drift_rms": noise.drift_rms,
        "drift_expected_rms": None if noise.drift_rms is None else noise.drift_expected_rms,
        "quiet_samples": noise.samples,
        "source": noise.source,
    }


def kind_of(noise: NoiseModel) -> str:
    """Return ``white``, ``autoregressive``, ``1/f``, ``quantisation`` or ``unknown colour``."""
    if noise.source == "differences":
        return "unknown colour"
    if noise.coarse is not None:
        return "quantisation"
    if noise.corner > 0.0:
        return "1/f"
    return "autoregressive" if noise.order else "white"


def noise_sentences(noise: NoiseModel, rate_hz: float) -> list[str]:
    """Return what a person should know of a noise before a residual is judged by it.

    Parameters
    ----------
    noise : NoiseModel
        Of one instrument.
    rate_hz : float
        Its sample rate.

    Returns
    -------
    list of str
        One thought each.
    """
    kind = kind_of(noise)
    if kind == "unknown colour":
        return [
            "No record has a quiet stretch: the level of the noise is a guess from differences of "
            "neighbouring samples, its colour is not known, and structure may be colour."
        ]
    if noise.coarse is not None:
        return [
            f"Quantisation limits: the converter's step is {two_digits(1.0 / noise.coarse.noise)} "
            "times the noise before the trigger, or more. Its rounding error, step over sqrt(12), "
            "is taken for noise, and samples within a step of one another count as one value."
        ]
    if kind == "1/f":
        said = [
            "The noise before the trigger rises like 1/f below "
            f"{frequency(noise.corner * rate_hz)}; residuals are judged with that taken into "
            "account."
        ]
    elif kind == "autoregressive":
        said = [
            "The noise before the trigger is correlated from sample to sample (autoregressive, "
            f"order {noise.order}); residuals are judged with that taken into account."
        ]
    else:
        said = ["The noise before the trigger is white."]
    if (
        noise.drift_rms is not None
        and noise.drift_rms > CRITERIA.words.drift_ratio * noise.drift_expected_rms
    ):
        times = noise.drift_rms / noise.drift_expected_rms
        said.append(
            f"Before the trigger the records also drift slowly, {times:.3g} times as far as noise "
            "makes them, as hum does. That is not taken for noise."
        )
    return said


def frequency(hz: float) -> str:
    """Return a frequency to two digits, in Hz or kHz."""
    return f"{two_digits(hz / 1e3)} kHz" if hz >= 1e3 else f"{two_digits(hz)} Hz"


def two_digits(number: float) -> str:
    """Return a number to two digits as it is said: 4100, never 4.1e+03."""
    return f"{float(f'{number:.2g}'):.12g}"
