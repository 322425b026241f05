"""What a residual is like, in numbers: by phase, frequency, lag, speed, material and order."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.stats import spearmanr

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.document.stack import (
    by_pair_and_height,
    grid_for,
    groups_of,
    mean_of,
    time_us,
)
from analysis.fit.measurand import Json
from analysis.fit.shot_fit import ShotFit
from analysis.noise import NoiseModel

Array = NDArray[np.float64]

PHASES = ("before", "contact", "ring", "later")
RING_ENDS = 4.0
"""The ring is looked at until so many contact times after touch-down."""
SEGMENT = 1024
"""Samples of a stretch of Welch's, where shots are that long."""
SPECTRUM_POINTS = 60
"""Bins of the picture, evenly over the logarithm of the frequency."""


def _phase_masks(shot: ShotFit) -> dict[str, NDArray[np.bool_]]:
    t, contact = time_us(shot), shot.contact_time_s * 1e6
    return {
        "before": t < -0.05 * contact,
        "contact": (t >= -0.05 * contact) & (t < contact),
        "ring": (t >= contact) & (t < RING_ENDS * contact),
        "later": t >= RING_ENDS * contact,
    }


def phases(shots: Sequence[ShotFit]) -> Json:
    """Return the residual before, during and after the contact, each against the noise.

    Parameters
    ----------
    shots : sequence of ShotFit
        At least one.

    Returns
    -------
    dict
        ``rms`` [unit of the signal] and ``chi2_per_sample`` [1] of each phase; null where no sample
        falls into it.
    """
    squares, white, count = (dict.fromkeys(PHASES, 0.0) for _ in range(3))
    for shot in shots:
        whitened = np.zeros(shot.residual.size)
        whitened[shot.item.noise.history :] = shot.item.noise.whiten(shot.residual)
        masks = _phase_masks(shot)
        # a misfit pulls the fitted baseline away; that is no event before the trigger
        level = float(np.mean(shot.residual[masks["before"]])) if masks["before"].any() else 0.0
        quiet = np.zeros(shot.residual.size)
        quiet[shot.item.noise.history :] = shot.item.noise.whiten(shot.residual - level)
        whitened[masks["before"]] = quiet[masks["before"]]
        for name, mask in masks.items():
            squares[name] += float(np.sum(shot.residual[mask] ** 2))
            white[name] += float(np.sum(whitened[mask] ** 2))
            count[name] += float(mask.sum())
    return {
        name: {
            "rms": math.sqrt(squares[name] / count[name]) if count[name] else None,
            "chi2_per_sample": white[name] / count[name] if count[name] else None,
            "samples": int(count[name]),
        }
        for name in PHASES
    }


def _noise_density(noise: NoiseModel, frequency: Array, rate: float) -> Array:
    """Return the one-sided power density of the measured noise. [unit^2/Hz]"""
    response = np.ones(frequency.size, dtype=complex)
    for j, a in enumerate(noise.coefficients, start=1):
        response -= a * np.exp(-2j * math.pi * frequency / rate * j)
    return np.asarray(2 * noise.innovation_rms**2 / rate / np.abs(response) ** 2)


def spectrum(shots: Sequence[ShotFit]) -> Json:
    """Return the residual's power density beside the noise's, and where it stands out most.

    Parameters
    ----------
    shots : sequence of ShotFit
        Those of the commonest sample rate and quantity are used.

    Returns
    -------
    dict
        ``frequency_Hz``, ``residual`` and ``noise`` as lists [unit^2/Hz]; ``peak_Hz`` where their
        ratio is largest, and that ``peak_ratio``.
    """
    rates = [s.item.frame.sample_rate_hz for s in shots]
    rate = max(set(rates), key=rates.count)
    used = [s for s in shots if s.item.frame.sample_rate_hz == rate]
    used = [s for s in used if s.item.shot.quantity == used[0].item.shot.quantity]
    size = min(SEGMENT, *(s.residual.size for s in used))
    densities = [welch(s.residual, rate, nperseg=size, detrend=False)[1] for s in used]
    frequency: Array = np.asarray(np.arange(1, size // 2 + 1) * (rate / size), dtype=np.float64)
    residual = np.mean(densities, axis=0)[1:]
    noise = np.mean([_noise_density(s.item.noise, frequency, rate) for s in used], axis=0)
    edges = np.geomspace(frequency[0] * 0.99, frequency[-1] * 1.01, SPECTRUM_POINTS + 1)
    place = np.searchsorted(edges, frequency) - 1
    bins = [place == b for b in range(SPECTRUM_POINTS) if np.any(place == b)]
    at, left, floor = (
        np.array([float(np.mean(v[b])) for b in bins]) for v in (frequency, residual, noise)
    )
    best = int(np.argmax(left / floor))
    return {
        "frequency_Hz": [float(f"{x:.4g}") for x in at],
        "residual": [float(f"{x:.4g}") for x in left],
        "noise": [float(f"{x:.4g}") for x in floor],
        "peak_Hz": float(at[best]),
        "peak_ratio": float(left[best] / floor[best]),
    }


def lag(shots: Sequence[ShotFit]) -> Json:
    """Return at which lag after the pulse the residual looks most like the pulse itself.

    Parameters
    ----------
    shots : sequence of ShotFit
        At least one.

    Returns
    -------
    dict
        ``lag_s`` and ``correlation``, between -1 and 1.
    """
    contact = float(np.median([s.contact_time_s for s in shots]))
    rate = shots[0].item.frame.sample_rate_hz
    most = max(1, int(2 * RING_ENDS * contact * rate))
    total, power, pulse_power = np.zeros(most), 0.0, 0.0
    for shot in shots:
        if shot.item.frame.sample_rate_hz != rate:
            continue
        pulse = shot.prediction - float(shot.own[3])
        size = 1 << (2 * pulse.size - 1).bit_length()
        across = np.fft.irfft(
            np.fft.rfft(shot.residual, size) * np.conj(np.fft.rfft(pulse, size)), size
        )
        total[: min(most, size)] += across[:most]
        power += float(shot.residual @ shot.residual)
        pulse_power += float(pulse @ pulse)
    best = int(np.argmax(np.abs(total)))
    scale = math.sqrt(power * pulse_power) or 1.0
    return {"lag_s": best / rate, "correlation": float(total[best] / scale)}


def _excess(shot: ShotFit) -> float:
    """Return the residual beyond the noise from touch-down to the end of the ring."""
    masks = _phase_masks(shot)
    near = masks["contact"] | masks["ring"]
    if not near.any():
        return 0.0
    return math.sqrt(max(float(np.mean(shot.residual[near] ** 2)) - shot.item.noise.rms**2, 0.0))


def speed_dependence(shots: Sequence[ShotFit]) -> Json:
    """Return how the residual grows with impact speed within a pair, as a power.

    Parameters
    ----------
    shots : sequence of ShotFit
        At least one.

    Returns
    -------
    dict
        ``exponent`` and ``u``; null where speeds or residuals do not allow it. A linear effect has
        the pulse's own exponent, 1.2; a smaller one grows at low speed.
    """
    x, y = [], []
    for group in groups_of(shots, lambda s: (s.item.pair, None)).values():
        seen = [(float(s.own[0]), _excess(s)) for s in group]
        kept = np.array([(v, math.log(e)) for v, e in seen if e > 0])
        if len(kept) > 1:
            x.extend(kept[:, 0] - kept[:, 0].mean())
            y.extend(kept[:, 1] - kept[:, 1].mean())
    across, up = np.array(x), np.array(y)
    spread = float(across @ across) if across.size else 0.0
    if across.size < CRITERIA.words.least_shots or spread < CRITERIA.words.least_speed_spread:
        return {"exponent": None, "u": None}
    exponent = float(across @ up) / spread
    left = float(np.sum((up - exponent * across) ** 2))
    u = math.sqrt(left / max(across.size - 2, 1) / spread)
    return {"exponent": exponent, "u": u}


def by_material(shots: Sequence[ShotFit], side: str) -> Json:
    """Return chi2 per degree of freedom by surface or sphere."""
    found: dict[str, list[float]] = {}
    for shot in shots:
        found.setdefault(str(getattr(shot.item.shot, side)), []).append(shot.chi2_per_dof)
    return {name: float(np.mean(values)) for name, values in sorted(found.items())}


def order(shots: Sequence[ShotFit]) -> Json:
    """Return whether the residual's size follows the order of the shots.

    Parameters
    ----------
    shots : sequence of ShotFit
        In order of time.

    Returns
    -------
    dict
        Spearman's ``correlation`` and its ``p_value``; null with too few shots.
    """
    means = {
        key: float(np.mean([s.chi2_per_dof for s in group]))
        for key, group in groups_of(shots, by_pair_and_height).items()
    }
    relative = [s.chi2_per_dof / means[by_pair_and_height(s)] for s in shots]
    if len(shots) < CRITERIA.words.least_shots or np.ptp(relative) == 0.0:
        return {"correlation": None, "p_value": None}
    found = spearmanr(np.arange(len(shots)), relative)
    return {"correlation": float(found.statistic), "p_value": float(found.pvalue)}


def share_that_repeats(shots: Sequence[ShotFit]) -> float | None:
    """Return which share of the residual's energy is the same in repetitions, None without any.

    Parameters
    ----------
    shots : sequence of ShotFit
        At least one.

    Returns
    -------
    float or None
        Between 0 (noise, or another one each time) and 1. [1]
    """
    grid = grid_for(shots)
    same, whole = 0.0, 0.0
    for group in groups_of(shots, by_pair_and_height).values():
        if len(group) < 2:
            continue
        each = np.nan_to_num(np.array([mean_of(grid, [s]) for s in group]))
        total = np.sum(each, axis=0)
        # products of different shots only: noise does not repeat
        own = float(np.sum(each**2))
        same += (float(total @ total) - own) / (len(group) - 1)
        whole += own
    return min(max(same / whole, 0.0), 1.0) if whole else None
