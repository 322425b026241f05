"""Invented: what the chain does with the signal. No library knows these effects."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine, Gain, Memoryless, StateSpaceStage
from drivers.simulated.recursion import run_on


@njit(cache=True)
def _switch(volts, upper, threshold, gain, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        size = abs(volts[i])
        upper = size > threshold or (upper and size > 0.5 * threshold)
        out[i] = volts[i] * (gain if upper else 1.0)
    return upper


class _TwoRanges:
    def __init__(self, change: float, threshold_v: float) -> None:
        self._gain, self._threshold_v, self._upper = 1.0 + change, threshold_v, False

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        self._upper = bool(_switch(volts, self._upper, self._threshold_v, self._gain, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return True


class AutoRange(Effect):
    """The amplifier changes its range within the pulse, and the two do not quite agree.

    Above a threshold the gain is ``1 + a`` times what it was, back below half of it. Source:
    own; a switched divider with a wrong resistor. Steps in the trace, and at two heights.
    """

    id = "x_auto_range"
    slot = "electronics"
    order = 65
    parameters = (
        Parameter("change", "1", 1e-3, 0.1, 0.0, "a", either_sign=True),
        Parameter("threshold_v", "V", 0.3, 4.0, 1.0, "of the upper range"),
    )

    def stage(self, shot: Shot) -> _TwoRanges | None:
        """Return the amplifier."""
        v = self.values
        return None if v["change"] == 0.0 else _TwoRanges(v["change"], v["threshold_v"])


class _Wander:
    def __init__(self, amplitude_s: float, frequency_hz: float, phase: float) -> None:
        self._amplitude_s, self._w, self._phase = amplitude_s, 2.0 * math.pi * frequency_hz, phase
        self._past = DelayLine(2.0 * amplitude_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        return self._past.at(t - self._amplitude_s * (1.0 + np.sin(self._w * t + self._phase)))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class ClockWander(Effect):
    """The converter's clock wanders, so that samples are not evenly spaced.

    ``V(t - A (1 + sin(2 pi f t + phase)))``, the phase free from shot to shot; the mean delay
    is only a later touch. Source: own; phase noise of an oscillator on an unquiet supply.
    Largest where the signal is steepest.
    """

    id = "x_clock_wander"
    slot = "electronics"
    order = 85
    fine_grid = True
    parameters = (
        Parameter("amplitude_s", "s", 3e-9, 1e-6, 0.0, "A"),
        Parameter("frequency_hz", "Hz", 1e3, 3e4, 5e3, "f of the wander"),
    )

    def stage(self, shot: Shot) -> _Wander | None:
        """Return the clock at this shot's phase."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        if self.values["amplitude_s"] == 0.0:
            return None
        return _Wander(self.values["amplitude_s"], self.values["frequency_hz"], phase)


class _Charge:
    def __init__(self, amplitude_v: float, leak_s: float) -> None:
        self._amplitude_v, self._leak_s, self._area = amplitude_v, leak_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        widest = np.maximum.accumulate(np.maximum(volts, 0.0)) ** (2.0 / 3.0)
        grown = np.diff(widest, prepend=0.0)
        area = run_on(grown, math.exp(-step_s / self._leak_s), self._area)
        self._area = float(area[-1])
        return np.asarray(volts + self._amplitude_v * area)

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._amplitude_v * self._area) < threshold_v


class ContactCharge(Effect):
    """Sphere and coupon part with charge, as much as they had touched.

    ``V + a A``, A grows with the greatest area of contact so far, ``(V/1 V)^(2/3)`` after
    Hertz, and leaks away in ``tau``. Source: own; contact electrification in proportion to the
    area (Lowell & Rose-Innes 1980), seen by the cell's unshielded cap. Rises with the pulse to
    its peak, stays when the sphere has gone, and falls behind the force as drops get higher.
    """

    id = "x_contact_charge"
    slot = "electronics"
    order = 3
    per_material = True
    parameters = (
        Parameter("amplitude_v", "V", 3e-4, 0.08, 0.0, "a, at a signal of 1 V", either_sign=True),
        Parameter("leak_s", "s", 2e-4, 2e-2, 2e-3, "tau"),
    )

    def stage(self, shot: Shot) -> _Charge | None:
        """Return the charge of this hit."""
        v = self.values
        return None if v["amplitude_v"] == 0.0 else _Charge(v["amplitude_v"], v["leak_s"])


FEEDTHROUGH_END_HZ = 5e5  # half the sample rate


class Feedthrough(Effect):
    """A neighbouring wire picks up the slope of the signal and gives it back.

    ``V + c V'``, taken below 500 kHz as no circuit differentiates beyond. Source: own; stray
    capacitance across a resistor. To first order the pulse is only earlier, so what is left
    grows with the curvature.
    """

    id = "x_feedthrough"
    slot = "electronics"
    order = 47
    fine_grid = True
    parameters = (Parameter("lead_s", "s", 2e-7, 1.5e-5, 0.0, "c of the slope", either_sign=True),)

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the wire: ``1 + c w s/(s + w)``."""
        lead, w = self.values["lead_s"], 2.0 * math.pi * FEEDTHROUGH_END_HZ
        if lead == 0.0:
            return None
        one = np.array([1.0])
        return StateSpaceStage(np.array([[-w]]), one, -lead * w * w * one, 1.0 + lead * w)


class _PairedEcho:
    def __init__(self, ratio: float, spacing_s: float) -> None:
        self._ratio, self._spacing_s = ratio, spacing_s
        self._past = DelayLine(2.0 * spacing_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        middle, late = (self._past.at(t - n * self._spacing_s) for n in (1, 2))
        return np.asarray(middle + self._ratio * (volts + late))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class FilterPreEcho(Effect):
    """The converter's digital filter is symmetric in time and rings before the signal.

    ``V(t) + r (V(t - T) + V(t + T))``: a ripple of the pass band. The record's start is free,
    so all of it comes later by T. Source: paired echoes (Wheeler 1939). A copy comes before
    what it copies.
    """

    id = "x_filter_pre_echo"
    slot = "electronics"
    order = 87
    fine_grid = True
    parameters = (
        Parameter("ratio", "1", 5e-4, 0.05, 0.0, "r", either_sign=True),
        Parameter("spacing_s", "s", 5e-6, 5e-5, 2e-5, "T"),
    )

    def stage(self, shot: Shot) -> _PairedEcho | None:
        """Return the filter."""
        v = self.values
        return None if v["ratio"] == 0.0 else _PairedEcho(v["ratio"], v["spacing_s"])


class GainDrift(Effect):
    """The amplifier warms up and its gain drifts from shot to shot.

    Gain ``1 + a (1 - exp(-n/n0))`` at the n-th shot. The library has a straight drift only,
    which the search for effects does not try.
    """

    id = "x_gain_drift"
    slot = "electronics"
    order = 45
    parameters = (
        Parameter("final_change", "1", 0.005, 0.15, 0.0, "a", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 100.0, 20.0, "n0"),
    )

    def stage(self, shot: Shot) -> Gain:
        """Return this shot's gain."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        return Gain(1.0 + self.values["final_change"] * settled)


SAMPLE_PERIOD_S = 1e-6  # of a converter at 1 MHz


class _Turns(Memoryless):
    def __init__(self, mismatch: float, skew_s: float, first: int) -> None:
        self._mismatch, self._skew_s, self._count = mismatch, skew_s, first

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size < 2:
            return volts
        finer = max(round(SAMPLE_PERIOD_S / step_s), 1)
        k = self._count + np.arange(volts.size) // finer
        self._count += volts.size // finer
        error = self._mismatch * volts + self._skew_s * np.gradient(volts, step_s)
        return np.asarray(volts + np.where(k % 2 == 0, 0.5, -0.5) * error)


class InterleavedConverter(Effect):
    """Two converters take turns, and do not quite agree on size and moment.

    ``V + (-1)^k (a V + s V')/2``, k the number of the sample; which of the two comes first is
    chance. Source: time-interleaved converters (Black & Hodges 1980). Neighbouring samples
    differ in proportion to the signal and to its slope: a zigzag at half the rate, and none at
    rest.
    """

    id = "x_interleaved_converter"
    slot = "electronics"
    order = 93
    parameters = (
        Parameter("mismatch", "1", 5e-4, 0.05, 0.0, "a, of the gains", either_sign=True),
        Parameter("skew_s", "s", 2e-9, 1e-7, 0.0, "s, of the moments", either_sign=True),
    )

    def stage(self, shot: Shot) -> _Turns | None:
        """Return the two; either of them takes the first sample."""
        v = self.values
        first = int(shot.rng.integers(2))
        if v["mismatch"] == 0.0 and v["skew_s"] == 0.0:
            return None
        return _Turns(v["mismatch"], v["skew_s"], first)


GAP_WINDOW_S = (2e-5, 1e-3)  # of the gap, after the touch


class _Gap:
    """Late by the gap until it comes: a record's start is free, only the step is seen."""

    def __init__(self, lost_s: float, at_s: float) -> None:
        self._lost_s, self._at_s = lost_s, at_s
        self._past = DelayLine(lost_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        return self._past.at(t - np.where(t < self._at_s, self._lost_s, 0.0))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class LostSamples(Effect):
    """The transfer loses a few samples, and the record closes the gap as if nothing was.

    From a time on, drawn anew in each shot, everything comes too early by so many whole
    microseconds. Source: own; a buffer that overruns.
    """

    id = "x_lost_samples"
    slot = "electronics"
    order = 92
    fine_grid = True
    parameters = (Parameter("lost_s", "s", 1e-6, 1.2e-5, 0.0, "length of the gap"),)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a whole number of microseconds."""
        values = super().draw(rng)
        values["lost_s"] = round(values["lost_s"] * 1e6) * 1e-6
        return values

    def stage(self, shot: Shot) -> _Gap | None:
        """Return this shot's gap."""
        at_s = math.exp(shot.rng.uniform(math.log(GAP_WINDOW_S[0]), math.log(GAP_WINDOW_S[1])))
        return None if self.values["lost_s"] == 0.0 else _Gap(self.values["lost_s"], at_s)


class _Breathing(Memoryless):
    def __init__(self, depth: float, frequency_hz: float, phase: float) -> None:
        self._depth, self._w, self._phase = depth, 2.0 * math.pi * frequency_hz, phase
        self._now_s = 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._now_s + step_s * np.arange(1, volts.size + 1)
        self._now_s += step_s * volts.size
        return np.asarray(volts * (1.0 + self._depth * np.sin(self._w * t + self._phase)))


class ModulatedGain(Effect):
    """The gain breathes with a ripple on the supply, at any phase.

    ``V (1 + a sin(2 pi f t + phase))``, the phase free from shot to shot. Source: own;
    amplitude modulation. Nothing on the line while nothing falls.
    """

    id = "x_modulated_gain"
    slot = "electronics"
    order = 49
    parameters = (
        Parameter("depth", "1", 5e-4, 0.05, 0.0, "a"),
        Parameter("frequency_hz", "Hz", 50.0, 2e4, 1e3, "f of the ripple"),
    )

    def stage(self, shot: Shot) -> _Breathing | None:
        """Return the gain at this shot's phase."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        if self.values["depth"] == 0.0:
            return None
        return _Breathing(self.values["depth"], self.values["frequency_hz"], phase)


class _Jitter(Memoryless):
    def __init__(self, jitter_s: float, rng: np.random.Generator) -> None:
        self._jitter_s, self._rng = jitter_s, rng

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size < 2:
            return volts
        late = self._jitter_s * self._rng.standard_normal(volts.size)
        return np.asarray(volts - late * np.gradient(volts, step_s))


class SampleJitter(Effect):
    """The moments of the samples scatter, each by itself.

    ``V(t - s z)``, z a standard normal number of every sample; to first order noise of the size
    of the slope. Source: own; aperture jitter of any converter. A scatter that nothing repeats,
    and that is there only while the signal moves.
    """

    id = "x_sample_jitter"
    slot = "electronics"
    order = 89
    parameters = (Parameter("jitter_s", "s", 3e-9, 3e-7, 0.0, "s"),)

    def stage(self, shot: Shot) -> _Jitter | None:
        """Return the jitter of this shot."""
        jitter = self.values["jitter_s"]
        return None if jitter == 0.0 else _Jitter(jitter, shot.rng)


@njit(cache=True)
def _chase(volts, level, most, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        level += min(max(volts[i] - level, -most), most)
        out[i] = level
    return level


class _Slew:
    def __init__(self, limit_v_per_s: float) -> None:
        self._limit, self._level_v = limit_v_per_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        self._level_v = float(_chase(volts, self._level_v, self._limit * step_s, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._level_v) < threshold_v


class SlewLimit(Effect):
    """The amplifier's output cannot move faster than so many volts per second."""

    id = "x_slew_limit"
    slot = "electronics"
    order = 55
    fine_grid = True
    parameters = (Parameter("limit_v_per_s", "V/s", 3e4, 5e5, math.inf, "fastest change"),)

    def stage(self, shot: Shot) -> _Slew | None:
        """Return the limiter."""
        limit = self.values["limit_v_per_s"]
        return None if math.isinf(limit) else _Slew(limit)


class _Droop(Memoryless):
    def __init__(self, loss_per_v_s: float, recovery_s: float) -> None:
        self._loss, self._recovery_s, self._q = loss_per_v_s, recovery_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        keep = math.exp(-step_s / self._recovery_s)
        q = run_on(step_s * np.abs(volts), keep, self._q)
        self._q = float(q[-1])
        return np.asarray(volts * (1.0 - self._loss * q))


class SupplyDroop(Effect):
    """The amplifier's supply droops with the charge it has given, and its gain with it.

    ``V (1 - a q)``, ``q' = |V| - q/tau``. Source: own; a reservoir capacitor behind a resistor.
    Grows through the pulse, is largest after it, and heals within milliseconds.
    """

    id = "x_supply_droop"
    slot = "electronics"
    order = 48
    parameters = (
        Parameter("loss_per_v_s", "1/(V s)", 5.0, 500.0, 0.0, "a, loss of gain by charge given"),
        Parameter("recovery_s", "s", 2e-4, 5e-3, 1e-3, "tau of the supply"),
    )

    def stage(self, shot: Shot) -> _Droop:
        """Return the supply."""
        return _Droop(self.values["loss_per_v_s"], self.values["recovery_s"])


class _Heat:
    def __init__(self, offset: float, cooling_s: float) -> None:
        self._offset, self._cooling_s, self._warmth = offset, cooling_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        keep = math.exp(-step_s / self._cooling_s)
        warmth = run_on(step_s * volts * volts, keep, self._warmth)
        self._warmth = float(warmth[-1])
        return np.asarray(volts + self._offset * warmth)

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._offset * self._warmth) < threshold_v


class ThermalTail(Effect):
    """The input transistor warms itself with each pulse, and its offset follows.

    ``V + b W``, ``W' = V^2 - W/tau``: the output moves with the heat, whatever the sign of the
    signal. Source: own; heat that couples back to the input (Solomon 1974). A slow tail after
    the pulse in proportion to its energy, hence with the square of the pulse.
    """

    id = "x_thermal_tail"
    slot = "electronics"
    order = 46
    parameters = (
        Parameter("offset_per_v_s", "1/(V s)", 0.4, 120.0, 0.0, "b", either_sign=True),
        Parameter("cooling_s", "s", 3e-4, 1e-2, 2e-3, "tau"),
    )

    def stage(self, shot: Shot) -> _Heat | None:
        """Return the transistor, cold."""
        v = self.values
        return None if v["offset_per_v_s"] == 0.0 else _Heat(v["offset_per_v_s"], v["cooling_s"])


class TwoPoleCoupler(Effect):
    """A coupler with two poles, whose undershoot swings back through zero.

    High-pass ``s^2/(s^2 + 2 zeta w s + w^2)``. Source: own; an IEPE coupler before an
    AC-coupled input and a transformer. The library has it under a name that the search for
    effects does not try.
    """

    id = "x_two_pole_coupler"
    slot = "electronics"
    order = 61
    parameters = (
        Parameter("frequency_hz", "Hz", 3.0, 500.0, 0.0, "w / 2 pi"),
        Parameter("damping_ratio", "1", 0.15, 0.85, 0.5, "zeta"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the high-pass."""
        w, zeta = 2.0 * math.pi * self.values["frequency_hz"], self.values["damping_ratio"]
        if w == 0.0:
            return None
        system = np.array([[0.0, 1.0], [-w * w, -2.0 * zeta * w]])
        leaves = np.array([-w * w, -2.0 * zeta * w])
        return StateSpaceStage(system, np.array([0.0, 1.0]), leaves, 1.0)
