"""Stages of the chain from crystal to converter; they keep their state over gaps.

A flight is a few milliseconds of impact on a fine grid, then a tenth of a second of nothing. The
filters keep their state as a continuous system does, so the step may change between stretches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.recursion import run_on


class Stage(Protocol):
    """One step of the chain, with a memory that lasts one flight."""

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Return the output of an input block, continued from the block before. [V]"""

    def is_quiet(self, threshold_v: float) -> bool:
        """Return whether the output stays below a threshold when nothing more goes in."""


class Memoryless:
    """A stage whose output depends on the present input only."""

    def is_quiet(self, threshold_v: float) -> bool:
        """Return True: nothing is remembered."""
        return True


class Gain(Memoryless):
    """The same factor for all that comes."""

    def __init__(self, gain: float) -> None:
        self._gain = gain

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Return the input times the gain. [V]"""
        return self._gain * volts


class DelayLine:
    """The input up to a longest delay ago, straight between samples."""

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._t, self._v = np.zeros(1), np.zeros(1)

    def hear(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Take in a stretch and return its times, counted from the first one's begin. [s]"""
        t: NDArray[np.float64] = self._t[-1] + step_s * np.arange(1, volts.size + 1)
        keep = self._counts()
        self._t = np.concatenate((self._t[keep], t))
        self._v = np.concatenate((self._v[keep], volts))
        return t

    def at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what went in at some times, nothing before the first stretch. [V]"""
        return np.asarray(np.interp(times_s, self._t, self._v, left=0.0))

    def is_quiet(self, threshold_v: float) -> bool:
        """Return whether the input of the last `longest_s` stays below a threshold."""
        return bool(np.all(np.abs(self._v[self._counts()]) < threshold_v))

    def _counts(self) -> NDArray[np.bool_]:
        """Return which of the past may still be asked for, with a step or two to spare."""
        return np.asarray(self._t >= self._t[-1] - self._longest_s - 2e-6)


class StateSpaceStage:
    """A linear filter ``x' = A x + B u, y = C x + D u``, exact for straight lines between samples.

    A has shape (n, n) [1/s], B and C (n,). First-order hold (Franklin, Powell & Workman 1998, ch.
    6). The recursion runs as a product of first-order sections in modal coordinates.
    """

    def __init__(
        self, A: NDArray[np.float64], B: NDArray[np.float64], C: NDArray[np.float64], D: float
    ) -> None:
        values, vectors = np.linalg.eig(np.asarray(A, dtype=complex))
        self._poles = values
        self._B = np.linalg.solve(vectors, np.asarray(B, dtype=complex))
        self._C = np.asarray(C, dtype=complex) @ vectors
        self._D = D
        self._x = np.zeros(len(values), dtype=complex)
        self._last_input = 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Return the filtered stretch. [V]"""
        if volts.size == 0:
            return volts
        before = np.concatenate(([self._last_input], volts[:-1]))
        result = self._D * volts
        for i, pole in enumerate(self._poles):
            z = pole * step_s
            grow = np.exp(z)
            # Integrals of exp(p (h - s)) times 1 and times s/h over one step.
            whole = step_s * (np.expm1(z) / z if z != 0 else 1.0)
            rising = step_s * ((np.expm1(z) - z) / (z * z) if abs(z) > 1e-4 else 0.5 + z / 6.0)
            drive = self._B[i] * ((whole - rising) * before + rising * volts)
            x = run_on(drive, grow, self._x[i])
            self._x[i] = x[-1]
            result = result + (self._C[i] * x).real
        self._last_input = float(volts[-1])
        return np.asarray(result, dtype=np.float64)

    def is_quiet(self, threshold_v: float) -> bool:
        """Return whether every mode is below a threshold of the output."""
        return bool(np.all(np.abs(self._C * self._x) < threshold_v))


class Chain:
    """Stages in series, in the order of the signal."""

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = list(stages)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        """Return the output of the last stage. [V]"""
        for stage in self._stages:
            volts = stage.process(volts, step_s)
        return volts

    def is_quiet(self, threshold_v: float) -> bool:
        """Return whether every stage is quiet."""
        return all(stage.is_quiet(threshold_v) for stage in self._stages)
