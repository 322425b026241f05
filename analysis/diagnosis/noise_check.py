"""A test of the noise before the trigger for spikes, jumps and tones.

No impact causes them, so nothing of them repeats from shot to shot, and every test for structure
takes them for noise. But the noise of amplifiers and converters is Gaussian, and no line stands
out of its spectrum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import get_window, periodogram
from scipy.stats import chi2, norm

from analysis.aliases import Array
from analysis.diagnosis.criteria import CRITERIA
from analysis.fit.problem import FitShot
from analysis.fit.window import quiet_part
from analysis.quiet_spectrum import drift_basis, drift_degree, pieces_of, without_drift

FIRST_LINE = 2
"""Below it lies what a record's mean smears."""
NEAR, BESIDE = 2, 12
"""Lines to either side that a window smears a tone over, and those that tell the level there."""
WINDOW = "hann"
NORMAL_QUARTILES = 1.349
"""Between the quartiles of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Spikes:
    """How far the noise before the trigger is from Gaussian."""

    samples: int
    """Whitened quiet samples that were looked at."""
    far: int
    """Of these, beyond ``CRITERIA.deviations``, as the median tells them."""
    excess_kurtosis: float
    """Fourth moment over the squared second, less 3."""
    share: float
    """Of the variance, that those far samples hold."""

    @property
    def clear(self) -> bool:
        """Whether no Gaussian noise is like that."""
        return self._deviation > CRITERIA.deviations

    @property
    def p_value(self) -> float:
        """Return the chance of as large a kurtosis in Gaussian noise."""
        return float(norm.sf(self._deviation))

    @property
    def _deviation(self) -> float:
        if self.samples < CRITERIA.least_pooled_samples:
            return -math.inf
        return self.excess_kurtosis / math.sqrt(24.0 / self.samples)


@dataclass(frozen=True)
class Tone:
    """The line that stands out most of the spectrum before the trigger."""

    frequency_hz: float
    """To within the width of a line."""
    times: float
    """Its power over that of the lines beside it."""
    p_value: float
    """Chance of one as high, anywhere, in noise."""
    share: float
    """Of the variance, that it holds beyond the level beside it."""

    @property
    def clear(self) -> bool:
        """Whether no noise of smooth spectrum is like that."""
        return self.p_value < CRITERIA.single_question_rate


@dataclass(frozen=True)
class Background:
    """What is on the line before anything falls."""

    spikes: Spikes
    """And jumps."""
    tone: Tone | None
    """None where no quiet stretch is long enough."""

    @property
    def clear(self) -> bool:
        """Whether there is a disturbance that is not noise."""
        return bool(self._found)

    @property
    def p_value(self) -> float:
        """Return the chance of what is clear, 1 where nothing is."""
        return min((one.p_value for one in self._found), default=1.0)

    @property
    def share(self) -> float:
        """Return the share of the variance that is not noise, 0 where nothing is significant."""
        return min(sum(one.share for one in self._found), 1.0)

    @property
    def _found(self) -> list[Spikes | Tone]:
        return [one for one in (self.spikes, self.tone) if one is not None and one.clear]


def check_noise(shots: Sequence[FitShot]) -> Background:
    """Return spikes, jumps and tones in the noise before the impact.

    Each record is measured by its own level, so that records of different noise make no tail. The
    standard error of the kurtosis of n Gaussian samples is sqrt(24/n) (Kendall and Stuart, *The
    Advanced Theory of Statistics* 1, 12.18); whitened samples are as good as independent. A line of
    the mean of m periodograms of independent Gaussian noise is chi-square with 2 m degrees of
    freedom (Percival and Walden, *Spectral Analysis for Physical Applications*, 6.6), of records
    with common noise with less.
    """
    kept = [(item, quiet) for item in shots if (quiet := _quiet(item)).size]
    whole = [_whitened(item, quiet - quiet.mean()) for item, quiet in kept]
    return Background(_spikes(whole), _tone(kept))


def _quiet(item: FitShot) -> Array:
    """Return a record's quiet samples; none where they are few or the converter's step hides them.

    What a step leaves of a smaller noise are rare single steps, which are no spikes.
    """
    quiet = quiet_part(item.shot)
    quiet = quiet[: round(item.noise.calm_share * quiet.size)]
    if quiet.size < CRITERIA.least_quiet_samples:
        return np.zeros(0)
    steps = np.diff(np.unique(quiet))
    if steps.size == 0 or np.std(quiet) < CRITERIA.least_deviation_in_steps * steps.min():
        return np.zeros(0)
    return quiet


def _whitened(item: FitShot, quiet: Array) -> Array:
    """Return samples whitened, of mean 0 and standard deviation 1."""
    white = item.noise.whiten(quiet)
    white = white - white.mean()
    return np.asarray(white / np.std(white))


def _spikes(whole: list[Array]) -> Spikes:
    if not whole:
        return Spikes(0, 0, 0.0, 0.0)
    pooled = np.concatenate(whole)
    most = CRITERIA.deviations
    far = np.concatenate([w[np.abs(w) > most * np.median(np.abs(w)) / 0.6745] for w in whole])
    share = float(far @ far) / pooled.size
    return Spikes(pooled.size, far.size, float(np.mean(pooled**4)) - 3.0, share)


def _tone(kept: list[tuple[FitShot, Array]]) -> Tone | None:
    """Return the highest line of the mean spectrum, hum taken off first."""
    rates = {item.frame.sample_rate_hz for item, _ in kept}
    if len(rates) != 1:
        return None  # lines of records sampled otherwise lie elsewhere
    rate_hz = rates.pop()
    shortest = min((quiet for _, quiet in kept), key=np.size)
    size = pieces_of(shortest, rate_hz)[-1].size
    degree = drift_degree(size, rate_hz)
    calm = [without_drift(quiet[-size:], degree) for _, quiet in kept]
    white = [_whitened(item, samples) for (item, _), samples in zip(kept, calm, strict=True)]
    first = _first_line(size, degree)
    found = _highest(white, rate_hz, first)
    loud = _highest([samples / np.std(samples) for samples in calm], rate_hz, first)
    # a loud tone is taken for colour, and whitened away with it
    return loud if loud.times > CRITERIA.far_larger else found


def _first_line(size: int, degree: int) -> int:
    """Return the first line that is left nearly whole where drift has been taken off.

    Beside lines that are not, noise stands out as a tone does.
    """
    window = get_window(WINDOW, size)[:, None]
    taken = np.abs(np.fft.rfft(window * drift_basis(size, degree), axis=0)) ** 2
    left = 1.0 - np.sum(taken, axis=1) / float(np.sum(window**2))
    short = np.flatnonzero(left[FIRST_LINE : size // 4] < CRITERIA.half)
    return FIRST_LINE + (int(short[-1]) + 1 if short.size else 0)


def _highest(records: list[Array], rate_hz: float, first: int) -> Tone:
    """Return the line of the mean spectrum that is highest above its neighbours."""
    size = min(record.size for record in records)
    spectra = [periodogram(r[-size:], rate_hz, WINDOW, detrend=False) for r in records]
    at_hz, power = spectra[0][0][first:], np.mean([p for _, p in spectra], axis=0)[first:]
    lines = range(power.size - 1)  # the last has half the freedom of the others
    times = np.array([power[k] / _level(power, k) for k in lines])
    highest = int(np.argmax(times))
    # records that share noise have less freedom than two a record and line; the lines tell
    spread = float(np.subtract(*np.percentile(times, (75, 25)))) / NORMAL_QUARTILES
    freedom = min(2.0 * len(records), 2.0 / spread**2)
    p = float(chi2.sf(freedom * times.max(), freedom)) * times.size
    around = power[max(0, highest - NEAR + 1) : highest + NEAR]
    share = float(np.sum(around - _level(power, highest)) / np.sum(power))
    return Tone(float(at_hz[highest]), float(times.max()), min(p, 1.0), max(share, 0.0))


def _level(power: Array, k: int) -> float:
    """Return the level around a line, from its neighbours."""
    below = power[max(0, k - BESIDE) : max(0, k - NEAR + 1)]
    above = power[k + NEAR : k + BESIDE + 1]
    return float(np.median(np.concatenate([below, above])))
