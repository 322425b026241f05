"""From the local parameters of one shot to its trace, its rebound and their derivatives.

Local parameters are logarithms wherever the quantity is positive, so no bound is ever needed and
nothing is clamped. Shared ones belong to rig, pair or material; nuisances to the shot.

========== ============================ ======================================================
name       quantity                     unit of its exponential
========== ============================ ======================================================
ln_K       contact stiffness            N m^-1.5 (N m^-1.5 per kg in reduced units)
ln_S       gain S = k c; S of Eq. 7     N/V (kg or 1 for acceleration and force recordings)
ln_w       crystal frequency omega0     rad/s (KV)
ln_z       crystal damping ratio zeta   1 (KV)
ln_M       crystal mass                 kg (KV; acts only through the recoil)
ln_v0      impact speed                 m/s (nuisance)
ln_e       Eq. 6's restitution          1 (nuisance)
t0_us      touch-down, in microseconds  after the window's first sample (nuisance)
baseline   offset                       unit of the signal (nuisance)
========== ============================ ======================================================

The output is ``k Delta / S`` (KV) or ``F_el / S`` (HSD), plus the baseline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.errors import UnknownModelError
from analysis.model import solver
from analysis.model.hertz import contact_time, damping_coefficient

SHARED = {solver.HSD: ("ln_K", "ln_S"), solver.KV: ("ln_K", "ln_S", "ln_w", "ln_z", "ln_M")}
NUISANCE = ("ln_v0", "ln_e", "t0_us", "baseline")

_LOG_STEP = 1e-4
_TIME_STEP_US = 2e-2


@dataclass(frozen=True)
class ShotFrame:
    """What of a shot is fixed during a fit.

    Attributes
    ----------
    sample_rate_hz : float
        [Hz]
    samples : int
        Length of the fit window.
    mass_kg : float
        Sphere mass; 1 in reduced units. [kg]
    gravity_m_per_s2 : float
        [m/s^2]
    """

    sample_rate_hz: float
    samples: int
    mass_kg: float
    gravity_m_per_s2: float


@dataclass(frozen=True)
class Prediction:
    """A trace with what the fit needs beside it.

    Attributes
    ----------
    signal : ndarray, shape (n,)
        Baseline included. [unit of the signal]
    rebound_ratio : float
        Sphere's rebound speed over its impact speed. [1]
    contact_time_s : float
        [s]
    deepest_indentation_m : float
        [m]
    """

    signal: NDArray[np.float64]
    rebound_ratio: float
    contact_time_s: float
    deepest_indentation_m: float


@dataclass(frozen=True)
class ImpactModel:
    """A base model by name.

    Attributes
    ----------
    name : str
        ``hsd`` or ``kv``.
    kind : int
        `solver.HSD` or `solver.KV`.
    """

    name: str
    kind: int

    @property
    def shared(self) -> tuple[str, ...]:
        """Return the names of the shared local parameters, in order."""
        return SHARED[self.kind]

    @property
    def names(self) -> tuple[str, ...]:
        """Return all local parameters: shared, then nuisances."""
        return self.shared + NUISANCE

    def steps(self, local: NDArray[np.float64], frame: ShotFrame) -> int:
        """Return the solver's steps for these parameters; kept while derivatives are taken."""
        duration = contact_time(
            math.exp(local[0]), frame.mass_kg, math.exp(local[len(self.shared)])
        )
        omega0 = math.exp(local[2]) if self.kind == solver.KV else 0.0
        return solver.contact_steps(omega0, duration)

    def predict(
        self, local: NDArray[np.float64], frame: ShotFrame, *, steps: int | None = None
    ) -> Prediction:
        """Return the trace of one shot.

        Parameters
        ----------
        local : ndarray, shape (len(names),)
            Local parameters in the order of ``names``.
        frame : ShotFrame
            The shot's fixed part.
        steps : int, optional
            Solver steps; by default from `steps`.

        Returns
        -------
        Prediction
            NaN rebound when the contact did not end.
        """
        signal = np.zeros(frame.samples)
        if steps is None:
            steps = self.steps(local, frame)
        duration, rebound, deepest = self._add_to(signal, local, frame, steps)
        signal += local[-1]
        return Prediction(signal, rebound / math.exp(local[-4]), duration, deepest)

    def _add_to(
        self, signal: NDArray[np.float64], local: NDArray[np.float64], frame: ShotFrame, steps: int
    ) -> tuple[float, float, float]:
        """Integrate into ``signal``; the crystal's M, k, mu come from its identifiable forms."""
        ln_v0, ln_e, t0_us = local[-4:-1]
        if self.kind == solver.KV:
            omega0, zeta, crystal_mass = np.exp(local[2:5])
            k = crystal_mass * omega0**2
            mu = 2 * zeta * crystal_mass * omega0
            gain = k * math.exp(-local[1])
        else:
            crystal_mass, k, mu, gain = math.nan, math.nan, math.nan, math.exp(-local[1])
        found = solver.integrate(
            signal,
            self.kind,
            -t0_us * 1e-6,
            1.0 / frame.sample_rate_hz,
            math.exp(local[0]),
            frame.mass_kg,
            math.exp(ln_v0),
            damping_coefficient(math.exp(ln_e)),
            frame.gravity_m_per_s2,
            crystal_mass,
            k,
            mu,
            gain,
            steps,
        )
        return float(found[0]), float(found[1]), float(found[2])

    def linearise(
        self, local: NDArray[np.float64], frame: ShotFrame
    ) -> tuple[Prediction, NDArray[np.float64], NDArray[np.float64]]:
        """Return the trace with the derivatives of signal and rebound ratio.

        Parameters
        ----------
        local : ndarray, shape (p,)
            Local parameters.
        frame : ShotFrame
            The shot's fixed part.

        Returns
        -------
        prediction : Prediction
            At ``local``.
        jacobian : ndarray, shape (n, p)
            Derivative of the signal. [unit of the signal per unit of the parameter]
        rebound_gradient : ndarray, shape (p,)
            Derivative of the rebound ratio.

        Notes
        -----
        Central differences on one grid: the solver is smooth in every parameter, so a step of
        1e-4 leaves 1e-8 relative. Gain and baseline are analytic.
        """
        steps = self.steps(local, frame)
        centre = self.predict(local, frame, steps=steps)
        jacobian = np.empty((frame.samples, local.size), order="F")
        gradient = np.zeros(local.size)
        for j, name in enumerate(self.names):
            if name == "baseline":
                jacobian[:, j] = 1.0
            elif name == "ln_S":
                jacobian[:, j] = local[-1] - centre.signal
            else:
                step = _TIME_STEP_US if name == "t0_us" else _LOG_STEP
                moved = local.copy()
                moved[j] = local[j] + step
                above = self.predict(moved, frame, steps=steps)
                moved[j] = local[j] - step
                below = self.predict(moved, frame, steps=steps)
                jacobian[:, j] = (above.signal - below.signal) / (2 * step)
                if name != "t0_us":
                    gradient[j] = (above.rebound_ratio - below.rebound_ratio) / (2 * step)
        return centre, jacobian, gradient


MODELS = {"hsd": ImpactModel("hsd", solver.HSD), "kv": ImpactModel("kv", solver.KV)}


def model_named(name: str) -> ImpactModel:
    """Return a model by its name.

    Parameters
    ----------
    name : str
        ``hsd`` or ``kv``.

    Returns
    -------
    ImpactModel
        The model.

    Raises
    ------
    UnknownModelError
        If there is no such model; the message lists those there are.
    """
    try:
        return MODELS[name]
    except KeyError:
        raise UnknownModelError(
            f"There is no model {name!r}; known are {', '.join(sorted(MODELS))}."
        ) from None
