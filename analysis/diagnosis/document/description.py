"""A residual described so that a person can picture it: where, when, how fast, how often."""

from __future__ import annotations

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.document.noise_words import frequency, times_noise, two_digits
from analysis.diagnosis.document.residual_numbers import (
    RING_ENDS,
    by_material,
    lag,
    order,
    phases,
    share_that_repeats,
    spectrum,
    speed_dependence,
)
from analysis.diagnosis.document.stack import (
    stacks_json,
)
from analysis.fit.measurand import Json
from analysis.fit.result import FitResult


def describe(result: FitResult) -> Json:
    """Return what a residual looks like, as numbers and in sentences.

    Parameters
    ----------
    result : FitResult
        A fit with its residuals.

    Returns
    -------
    dict
        ``said`` has the sentences; the rest is what they rest on, and the stacked residual.
    """
    shots = result.shots
    if not shots:
        return {"said": []}
    found: Json = {
        "phases": phases(shots),
        "spectrum": spectrum(shots),
        "lag": lag(shots),
        "speed": speed_dependence(shots),
        "by_surface": by_material(shots, "surface"),
        "by_sphere": by_material(shots, "sphere"),
        "order": order(shots),
        "share_that_repeats": share_that_repeats(shots),
        "stacks": stacks_json(shots),
    }
    return {"said": sentences(found), **found}


def sentences(found: Json) -> list[str]:
    """Return a description in words.

    Parameters
    ----------
    found : dict
        As `describe` collects it.

    Returns
    -------
    list of str
        One thought each.
    """
    said = []
    ratio = {n: p["chi2_per_sample"] for n, p in found["phases"].items() if p["chi2_per_sample"]}
    worst = max(ratio, key=lambda name: ratio[name])
    where = {
        "before": "before the contact begins, so it is not locked to the impact",
        "contact": "while sphere and surface touch",
        "ring": f"in the ring after lift-off (until {RING_ENDS:g} contact times)",
        "later": "long after the contact: something slow, or a second touch",
    }
    if ratio[worst] < CRITERIA.words.residual_ratio:
        return [f"Before, during and after the contact the residual is noise{_repeats(found)}."]
    said.append(
        f"The residual is largest {where[worst]}: {times_noise(ratio[worst])} times the noise."
    )
    if worst != "before" and "before" in ratio:
        quiet = "noise"
        if ratio["before"] >= CRITERIA.words.residual_ratio:
            quiet = f"{times_noise(ratio['before'])} times the noise"
        said.append(f"Before touch-down it is {quiet}.")
    peak = found["spectrum"]
    if peak["peak_ratio"] > CRITERIA.words.spectrum_ratio:
        said.append(
            f"Its spectrum stands out most at {frequency(peak['peak_Hz'])}, "
            f"{two_digits(peak['peak_ratio'])} times above the noise."
        )
    if abs(found["lag"]["correlation"]) > CRITERIA.words.lag_correlation:
        sign = "upright" if found["lag"]["correlation"] > 0 else "upside down"
        said.append(
            f"It looks like the pulse itself, {sign}, {found['lag']['lag_s'] * 1e6:.3g} us later "
            f"(correlation {found['lag']['correlation']:.2f})."
        )
    power = found["speed"]
    if power["exponent"] is not None and power["u"] < CRITERIA.words.speed_exponent_u:
        said.append(
            f"It grows with impact speed to the power {power['exponent']:.2f} +- {power['u']:.2f} "
            "(the pulse itself: 1.2)."
        )
    said += _contrast(found["by_surface"], "on") + _contrast(found["by_sphere"], "with")
    when = found["order"]
    if when["p_value"] is not None and when["p_value"] < CRITERIA.words.trend_p_value:
        way = "grows" if when["correlation"] > 0 else "shrinks"
        said.append(f"It {way} in the course of the campaign (p = {when['p_value']:.1g}).")
    share = found["share_that_repeats"]
    if share is not None:
        said.append(f"{share:.0%} of its energy repeats from shot to shot.")
    return said


def _repeats(found: Json) -> str:
    share = found["share_that_repeats"]
    return "" if share is None else f"; {share:.0%} of its energy repeats from shot to shot"


def _contrast(by: Json, word: str) -> list[str]:
    if len(by) < 2:
        return []
    most, least = max(by, key=lambda n: by[n]), min(by, key=lambda n: by[n])
    if (
        by[most] < CRITERIA.words.contrast_ratio * by[least]
        or by[most] < CRITERIA.words.residual_ratio
    ):
        return []
    return [
        f"It is largest {word} {most} ({times_noise(by[most])} times the noise) and smallest "
        f"{word} {least} ({times_noise(by[least])})."
    ]
