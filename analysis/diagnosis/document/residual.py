"""A residual described for people, and the curves of a discrepancy.

Where, when, how fast and how often it deviates, in numbers and in sentences; the residual stacked
over shots against the time after touch-down; the learned discrepancy as curves over the same time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate, freqz, welch
from scipy.stats import spearmanr

from analysis.aliases import Array, Json
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.fit import FORCE, Learned
from analysis.diagnosis.document.before_and_after import said_before_and_after
from analysis.diagnosis.document.wording import frequency, times_noise, two_digits
from analysis.diagnosis.selection import Step
from analysis.effects.contact_closure import ELASTIC_POWERS, RATE_POWERS
from analysis.fit.result import FitResult
from analysis.fit.shot_fit import ShotFit, collect

RING_ENDS = 4.0
"""The ring is looked at until so many contact times after touch-down. A choice of words: no verdict
asks where one phase ends."""
PHASES = {
    "before": "before the contact begins, so the impact does not cause it",
    "contact": "while sphere and surface touch",
    "ring": f"in the ring after lift-off (until {RING_ENDS:g} contact times)",
    "later": "long after the contact: something slow, or a second touch",
}
DEPTHS = np.linspace(0.05, 1.5, 30)
"""Where a learned force is drawn, in a campaign's usual indentation. [1]"""
RATES = (1.0, 0.0, -1.0)
"""At which rate of indentation: loading, at rest and unloading, in the usual speed. [1]"""


def describe(result: FitResult, *, structured: bool) -> Json:
    """Return a residual in sentences, ``said``, the numbers they rest on, and its stacks.

    ``structured`` is what the tests say of it: the sentences do not contradict them.
    """
    shots = result.shots
    if not shots:
        return {"said": []}
    found: Json = {
        "phases": _phases(shots),
        "spectrum": _spectrum(shots),
        "lag": _lag(shots),
        "speed": _speed_dependence(shots),
        "by_surface": _by_material(shots, "surface"),
        "by_sphere": _by_material(shots, "sphere"),
        "order": _order(shots),
        "share_that_repeats": _share_that_repeats(shots),
        "stacks": stacks_json(shots),
    }
    records = said_before_and_after([shot.item for shot in shots])
    return {"said": _sentences(found, records, structured=structured), **found}


def _sentences(found: Json, records: list[str], *, structured: bool) -> list[str]:
    """Return a description in words, one thought each, what the records say among them."""
    share = found["share_that_repeats"]
    repeats = "" if share is None else f"{share:.0%} of its energy repeats from shot to shot"
    ratio = {n: p["chi2_per_sample"] for n, p in found["phases"].items() if p["chi2_per_sample"]}
    worst = max(ratio, key=lambda name: ratio[name])
    small = ratio[worst] < CRITERIA.noticeable
    if small and not structured:
        noise = "Before, during and after the contact the residual is noise"
        return [f"{noise}; {repeats}." if repeats else f"{noise}."]
    largest = (
        f"The residual is largest {PHASES[worst]}: {times_noise(ratio[worst])} times the noise"
    )
    if not structured:
        largest += ", which the tests ascribe to chance"
    said = [f"{largest}."]
    if small:
        said.append("Its size is hardly more than the noise, but the tests find structure in it.")
    if worst != "before" and "before" in ratio:
        quiet = "noise"
        if ratio["before"] >= CRITERIA.noticeable:
            quiet = f"{times_noise(ratio['before'])} times the noise"
        said.append(f"Before touch-down it is {quiet}.")
    said += records
    peak = found["spectrum"]
    if peak["peak_ratio"] > CRITERIA.twice:
        said.append(
            f"Its spectrum is highest above the noise at {frequency(peak['peak_Hz'])}, "
            f"{two_digits(peak['peak_ratio'])} times the noise."
        )
    lag = found["lag"]
    if abs(lag["correlation"]) > CRITERIA.half:
        sign = "with the same sign" if lag["correlation"] > 0 else "with the opposite sign"
        said.append(
            f"It has the shape of the pulse, {sign}, {lag['lag_s'] * 1e6:.3g} us later "
            f"(correlation {lag['correlation']:.2f})."
        )
    power = found["speed"]
    if power["exponent"] is not None and power["u"] < CRITERIA.uncertain_u:
        said.append(
            f"It grows with impact speed to the power {power['exponent']:.2f} +- {power['u']:.2f} "
            "(the pulse: 1.2)."
        )
    said += _contrast(found["by_surface"], "on") + _contrast(found["by_sphere"], "with")
    order = found["order"]
    if order["p_value"] is not None and order["p_value"] < CRITERIA.single_question_rate:
        way = "grows" if order["correlation"] > 0 else "shrinks"
        said.append(f"It {way} during the campaign (p = {order['p_value']:.1g}).")
    return [*said, f"{repeats}."] if repeats else said


def _contrast(by: Json, word: str) -> list[str]:
    """Return on which material the residual is largest and smallest, where they differ clearly."""
    most, least = max(by, key=lambda n: by[n]), min(by, key=lambda n: by[n])
    needed = max(CRITERIA.noticeable * by[least], CRITERIA.noticeable)
    if len(by) < 2 or by[most] < needed:
        return []
    return [
        f"It is largest {word} {most} ({times_noise(by[most])} times the noise) and smallest "
        f"{word} {least} ({times_noise(by[least])})."
    ]


# -- numbers -------------------------------------------------------------------------------------
def _phase_masks(shot: ShotFit) -> dict[str, NDArray[np.bool_]]:
    """Return which samples fall into each of `PHASES`."""
    t, contact = time_us(shot), shot.contact_time_s * 1e6
    return {
        "before": t < -0.05 * contact,
        "contact": (t >= -0.05 * contact) & (t < contact),
        "ring": (t >= contact) & (t < RING_ENDS * contact),
        "later": t >= RING_ENDS * contact,
    }


def _phases(shots: Sequence[ShotFit]) -> Json:
    """Return the residual's rms [unit of the signal] and whitened squares a sample, by phase."""
    sums = {name: np.zeros(3) for name in PHASES}  # squares, whitened squares, samples
    for shot in shots:
        noise, residual, masks = shot.item.noise, shot.residual, _phase_masks(shot)
        before = masks["before"]
        # a misfit pulls the fitted baseline away; that is no event before the trigger
        level = float(np.mean(residual[before])) if before.any() else 0.0
        whitened = np.zeros(residual.size)
        whitened[noise.history :] = np.where(
            before[noise.history :], noise.whiten(residual - level), noise.whiten(residual)
        )
        for name, mask in masks.items():
            sums[name] += np.sum(residual[mask] ** 2), np.sum(whitened[mask] ** 2), mask.sum()
    return {
        name: {
            "rms": math.sqrt(squares / count) if count else None,
            "chi2_per_sample": float(white / count) if count else None,
            "samples": int(count),
        }
        for name, (squares, white, count) in sums.items()
    }


def _spectrum(shots: Sequence[ShotFit]) -> Json:
    """Return the residual's one-sided power density beside the noise's [unit^2/Hz], and their peak.

    Shots of the commonest sample rate are used, of them those that record what the first does. The
    peak is where the ratio of the two is largest.
    """
    rates = [s.item.frame.sample_rate_hz for s in shots]
    rate = max(set(rates), key=rates.count)
    used = [s for s in shots if s.item.frame.sample_rate_hz == rate]
    used = [s for s in used if s.item.shot.quantity == used[0].item.shot.quantity]
    size = min(1024, *(s.residual.size for s in used))
    densities = [welch(s.residual, rate, nperseg=size, detrend=False)[1] for s in used]
    f = np.fft.rfftfreq(size, 1.0 / rate)[1:]
    noises = [s.item.noise for s in used]
    filters = [freqz(n.innovation_rms, [1.0, *-n.coefficients], worN=f, fs=rate)[1] for n in noises]
    residual = np.mean(densities, axis=0)[1:]
    noise = np.mean(2 / rate * np.abs(filters) ** 2, axis=0)
    edges = np.geomspace(f[0] * 0.99, f[-1] * 1.01, 61)  # as many points as a picture shows
    place = np.searchsorted(edges, f) - 1
    at, left, floor = (
        np.array([np.mean(values[place == b]) for b in np.unique(place)])
        for values in (f, residual, noise)
    )
    best = int(np.argmax(left / floor))
    return {
        "frequency_Hz": _rounded(at),
        "residual": _rounded(left),
        "noise": _rounded(floor),
        "peak_Hz": float(at[best]),
        "peak_ratio": float(left[best] / floor[best]),
    }


def _lag(shots: Sequence[ShotFit]) -> Json:
    """Return at which lag after the pulse the residual correlates most with the pulse itself."""
    contact = float(np.median([s.contact_time_s for s in shots]))
    rate = shots[0].item.frame.sample_rate_hz
    most = max(1, int(2 * RING_ENDS * contact * rate))
    total, power, pulse_power = np.zeros(most), 0.0, 0.0
    for shot in shots:
        if shot.item.frame.sample_rate_hz != rate:
            continue
        pulse = shot.prediction - float(shot.own[3])
        later = correlate(shot.residual, pulse, method="fft")[pulse.size - 1 :][:most]
        total[: later.size] += later
        power += float(shot.residual @ shot.residual)
        pulse_power += float(pulse @ pulse)
    best = int(np.argmax(np.abs(total)))
    scale = math.sqrt(power * pulse_power) or 1.0
    return {"lag_s": best / rate, "correlation": float(total[best] / scale)}


def _excess(shot: ShotFit) -> float:
    """Return the rms beyond the noise from touch-down to the ring's end. [unit of the signal]"""
    masks = _phase_masks(shot)
    near = masks["contact"] | masks["ring"]
    if not near.any():
        return 0.0
    return math.sqrt(max(float(np.mean(shot.residual[near] ** 2)) - shot.item.noise.rms**2, 0.0))


def _speed_dependence(shots: Sequence[ShotFit]) -> Json:
    """Return the power of the impact speed with which the residual grows within a pair, and its u.

    A linear effect has the pulse's own exponent, 1.2; a smaller one grows at low speed. Null where
    speeds or residuals do not allow it.
    """
    x, y = [], []
    for group in _by_pair(shots, by_height=False).values():
        seen = [(float(s.own[0]), _excess(s)) for s in group]
        kept = np.array([(ln_v, math.log(excess)) for ln_v, excess in seen if excess > 0])
        if len(kept) > 1:
            x.extend(kept[:, 0] - kept[:, 0].mean())
            y.extend(kept[:, 1] - kept[:, 1].mean())
    across, up = np.array(x), np.array(y)
    spread = float(across @ across)
    if across.size < CRITERIA.least_shots or spread == 0.0:
        return {"exponent": None, "u": None}
    exponent = float(across @ up) / spread
    left = float(np.sum((up - exponent * across) ** 2))
    return {"exponent": exponent, "u": math.sqrt(left / max(across.size - 2, 1) / spread)}


def _by_material(shots: Sequence[ShotFit], side: str) -> Json:
    """Return chi2 per degree of freedom by surface or sphere."""
    names = [str(getattr(s.item.shot, side)) for s in shots]
    squares = np.array([s.chi2_per_dof for s in shots])
    return {n: float(np.mean(squares[np.array(names) == n])) for n in sorted(set(names))}


def _order(shots: Sequence[ShotFit]) -> Json:
    """Return Spearman's correlation of the residual's size with the order of shots, and its p.

    Sizes are those relative to the mean of the same pair and height; null with too few shots.
    """
    mean = {
        id(shot): float(np.mean([s.chi2_per_dof for s in group]))
        for group in _by_pair(shots, by_height=True).values()
        for shot in group
    }
    relative = [s.chi2_per_dof / mean[id(s)] for s in shots]
    if len(shots) < CRITERIA.least_shots or np.ptp(relative) == 0.0:
        return {"correlation": None, "p_value": None}
    found = spearmanr(np.arange(len(shots)), relative)
    return {"correlation": float(found.statistic), "p_value": float(found.pvalue)}


def _share_that_repeats(shots: Sequence[ShotFit]) -> float | None:
    """Return which share of the residual's energy is the same in repetitions, None without any.

    Between 0 (noise, or another residual each time) and 1.
    """
    edges_us = bin_edges_us(shots)
    same, whole = 0.0, 0.0
    for group in _by_pair(shots, by_height=True).values():
        if len(group) < 2:
            continue
        each = np.nan_to_num([mean_in_bins(edges_us, [s], [s.residual]) for s in group])
        total = np.sum(each, axis=0)
        # products of different shots only: noise does not repeat
        own = float(np.sum(each**2))
        same += (float(total @ total) - own) / (len(group) - 1)
        whole += own
    return min(max(same / whole, 0.0), 1.0) if whole else None


# -- stacks --------------------------------------------------------------------------------------
def time_us(shot: ShotFit) -> Array:
    """Return each fitted sample's time after touch-down. Shape (n,). [us]"""
    step = 1e6 / shot.item.frame.sample_rate_hz
    return np.asarray(np.arange(shot.prediction.size) * step - float(shot.own[2]))


def _contact_us(shots: Sequence[ShotFit]) -> float:
    """Return the median contact time. [us]"""
    return float(np.median([s.contact_time_s for s in shots])) * 1e6


def bin_edges_us(shots: Sequence[ShotFit]) -> Array:
    """Return edges of bins of time after touch-down, none finer than a sample. Shape (b + 1,)."""
    contact = _contact_us(shots)
    sample = max(1e6 / s.item.frame.sample_rate_hz for s in shots)
    start = max(min(float(time_us(s)[0]) for s in shots), -4.0 * contact)
    end = max(float(time_us(s)[-1]) for s in shots)
    edges, at = [], start
    while at < end:
        edges.append(at)
        share = at / contact  # fine while something happens
        bins = 30 if -1.0 <= share < RING_ENDS else 10 if share < 10.0 else 2
        at += max(sample, contact / bins)
    return np.array([*edges, at])


def binned(edges_us: Array, shot: ShotFit, values: Array) -> tuple[Array, Array]:
    """Return sum and count, each of shape (b,), of a shot's values (n,) in each bin."""
    bins = edges_us.size - 1
    place = np.searchsorted(edges_us, time_us(shot), side="right") - 1
    inside = (place >= 0) & (place < bins)
    place, values = place[inside], values[inside]
    counts: Array = np.bincount(place, minlength=bins).astype(np.float64)
    return np.bincount(place, values, minlength=bins).astype(np.float64), counts


def mean_in_bins(edges_us: Array, shots: Sequence[ShotFit], values: Sequence[Array]) -> Array:
    """Return the mean of some shots' values in each bin, NaN where there is none. Shape (b,)."""
    each = [binned(edges_us, shot, own) for shot, own in zip(shots, values, strict=True)]
    sums, counts = np.sum(each, axis=0)
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan)


def _by_pair(
    shots: Sequence[ShotFit], *, by_height: bool
) -> dict[tuple[str, float | None], list[ShotFit]]:
    """Return shots by pair and height [m], rounded so that repetitions fall together."""
    found: dict[tuple[str, float | None], list[ShotFit]] = {}
    for shot in shots:
        height = shot.item.shot.drop_height_m if by_height else None
        key = shot.item.pair, None if height is None else round(height, 4)
        found.setdefault(key, []).append(shot)
    return dict(sorted(found.items(), key=lambda item: (item[0][0], item[0][1] or 0.0)))


def stacks_json(shots: Sequence[ShotFit]) -> Json:
    """Return the mean residual of each pair and height, and of early, middle and late shots.

    Of a pair and height the mean ``signal``, too. Over ``time_us``, null where a bin is empty
    [unit of the signal]; of shots in order of time.
    """
    edges_us = bin_edges_us(shots)
    groups = _by_pair(shots, by_height=True)
    if len(groups) > 40:  # more curves nobody reads
        groups = _by_pair(shots, by_height=False)
    third = max(1, (len(shots) + 2) // 3)
    parts = {
        name: shots[at * third : (at + 1) * third]
        for at, name in enumerate(("early", "mid", "late"))
    }

    def stack(own: Sequence[ShotFit]) -> Json:
        """Return the mean of some shots and their number."""
        mean = mean_in_bins(edges_us, own, [s.residual for s in own])
        return {"shots": len(own), "mean": _rounded(mean)}

    def signal(own: Sequence[ShotFit]) -> list[float | None]:
        """Return the mean signal of some shots."""
        return _rounded(mean_in_bins(edges_us, own, [s.prediction + s.residual for s in own]))

    return {
        "time_us": _rounded((edges_us[1:] + edges_us[:-1]) / 2),
        "contact_us": _contact_us(shots),
        "by_pair_and_height": [
            {"pair": pair, "drop_height_m": height, "signal": signal(own)} | stack(own)
            for (pair, height), own in groups.items()
        ],
        "by_order": [{"part": name} | stack(own) for name, own in parts.items() if own],
    }


def _rounded(values: Array) -> list[float | None]:
    """Return numbers that are only drawn, to four digits."""
    return [float(f"{v:.4g}") if np.isfinite(v) else None for v in values]


# -- what a learned discrepancy adds -------------------------------------------------------------
def discrepancy_curves(step: Step, learned: Learned) -> Json:
    """Return the curves of a discrepancy, model and discrepancy fitted to each other.

    ``shots``: of at most six groups, as many as somebody reads, the shot to which it adds most: the
    pulse, the residual, what is added and what is left [unit of the signal], over ``time_us``.
    ``force``: of a contact discrepancy the added share of the elastic force over indentation, at
    each of `RATES`; else null.
    """
    problem = step.problem
    shots = collect(problem, step.fitted, scale=1.0)
    edges_us = bin_edges_us(shots)
    scope = learned.parts[0][1]
    groups = ["+".join(group for group, _ in own) for own in step.linearised.groups(scope)]
    added = [float(np.sqrt(np.mean(np.square(a)))) for a in learned.added]
    # where every shot has its own numbers, one of each pair
    keys = [s.pair for s in problem.shots] if scope == "shot" else groups
    largest: dict[str, int] = {}
    for place, key in enumerate(keys):
        if key not in largest or added[place] > added[largest[key]]:
            largest[key] = place
    curves = []
    for place in sorted(sorted(largest.values(), key=lambda place: -added[place])[:6]):
        item, residual = problem.shots[place], step.linearised.shots[place].residual
        traces = {
            "pulse": item.window.signal - residual,
            "residual": residual,
            "added": learned.added[place],
            "left": learned.residual[place],
        }
        curve = {
            "owner": groups[place],
            "shot": item.shot.name,
            "pair": item.pair,
            "drop_height_m": item.shot.drop_height_m,
            "time_us": _rounded((edges_us[1:] + edges_us[:-1]) / 2),
        }
        for name, trace in traces.items():
            curve[name] = _rounded(mean_in_bins(edges_us, [shots[place]], [trace]))
        curves.append(curve)
    return {"shots": curves, "force": _forces(learned)}


def _forces(learned: Learned) -> Json | None:
    """Return the added share of the elastic force over indentation, one list per rate.

    The share is that of `analysis.effects.contact_closure`: a polynomial in u, times the rate
    unless it is elastic.
    """
    forms = [f.removeprefix(FORCE) for f, _ in learned.parts if f.startswith(FORCE)]
    if not forms:
        return None
    # what was learned on top of the force has groups of its own
    begins = tuple(f"{form}.u^" for form in forms)
    own = [label for label in learned.coefficients if label.startswith(begins)]
    groups = sorted({label.rpartition("[")[2] for label in own if "[" in label})
    curves = []
    for group in groups or [""]:
        share = np.zeros((len(RATES), DEPTHS.size))
        for form in forms:
            rates = np.ones(len(RATES)) if form == "elastic" else np.array(RATES)
            for power in ELASTIC_POWERS if form == "elastic" else RATE_POWERS:
                label = f"{form}.u^{power:g}" + (f"[{group}" if group else "")
                share += np.outer(rates, learned.coefficients.get(label, 0.0) * DEPTHS**power)
        curves.append(
            {
                "owner": group.strip("[]"),
                "rate": list(RATES),
                "share": [_rounded(one) for one in share],
            }
        )
    return {"indentation": _rounded(DEPTHS), "curves": curves}
