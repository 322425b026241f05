"""What the noise before the trigger is like, as JSON and in words, and residuals beside it."""

from __future__ import annotations

import math

from scipy.stats import norm

from analysis.discovery.spikes import FAR, Spikes
from analysis.fit.measurand import Json
from analysis.fit.result import FitResult
from analysis.noise import NoiseModel

DRIFTS = 1.5
"""Rms of what is slow in the quiet stretches, over what noise leaves there, worth a sentence."""


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


def noise_json(result: FitResult, spikes: Spikes | None = None) -> Json:
    """Return the noise that a fit is judged by.

    Parameters
    ----------
    result : FitResult
        With the noise as measured.
    spikes : Spikes, optional
        How spiky the records are before the trigger.

    Returns
    -------
    dict
        ``instruments``, one entry for each; ``spikes``, or None; ``said``, what a person should
        know before anything is said of a residual.
    """
    entries, said = [], []
    seen: set[tuple[str, float]] = set()
    for shot in result.shots:
        noise, rate = shot.item.noise, shot.item.frame.sample_rate_hz
        instrument = (shot.item.shot.quantity, rate)
        if instrument in seen:
            continue
        seen.add(instrument)
        entries.append(_entry(noise, rate) | {"quantity": instrument[0]})
        said += [s for s in noise_sentences(noise, rate) if s not in said]
    if spikes is None or spikes.samples == 0:
        return {"instruments": entries, "spikes": None, "said": said}
    if spikes.clear:
        said.append(f"It is no plain noise: {spikes_said(spikes)}.")
    return {"instruments": entries, "spikes": _spikes_entry(spikes), "said": said}


def _spikes_entry(seen: Spikes) -> Json:
    return {
        "clear": seen.clear,
        "excess_kurtosis": seen.excess_kurtosis,
        "p_value": seen.p_value,
        "quiet_samples": seen.samples,
        f"beyond_{FAR:g}_deviations": seen.far,
    }


def spikes_said(seen: Spikes) -> str:
    """Return in words how spiky the records are before the trigger.

    Parameters
    ----------
    seen : Spikes
        That no Gaussian noise is like.

    Returns
    -------
    str
        The part of a sentence.
    """
    if not seen.far:
        return (
            "spikes or jumps come at any time, also before the trigger (excess kurtosis "
            f"{seen.excess_kurtosis:.2g} of {seen.samples} quiet samples; Gaussian noise has 0)"
        )
    chance = 2.0 * float(norm.sf(FAR)) * seen.samples
    return (
        f"spikes or jumps come at any time, also before the trigger ({seen.far} of {seen.samples} "
        f"quiet samples lie beyond {FAR:g} standard deviations; Gaussian noise leaves {chance:.1g})"
    )


def _entry(noise: NoiseModel, rate_hz: float) -> Json:
    short = noise.coefficients if noise.short is None else noise.short
    return {
        "sample_rate_Hz": rate_hz,
        "rms": noise.rms,
        "kind": kind_of(noise),
        "autoregressive_order": int(short.size),
        "corner_Hz": noise.corner * rate_hz if noise.corner else None,
        "filter_samples": noise.order,
        "drift_rms": noise.drift_rms,
        "drift_expected_rms": None if noise.drift_rms is None else noise.drift_expected_rms,
        "quiet_samples": noise.samples,
        "source": noise.source,
    }


def kind_of(noise: NoiseModel) -> str:
    """Return ``white``, ``autoregressive``, ``1/f`` or ``unknown colour``."""
    if noise.source == "differences":
        return "unknown colour"
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
    if noise.drift_rms is not None and noise.drift_rms > DRIFTS * noise.drift_expected_rms:
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
