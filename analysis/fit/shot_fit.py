"""One shot's part of a joint fit: prediction, residual, quality, flags."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.fit.joint import Fitted, nuisance_covariance
from analysis.fit.measurand import Json, measurand
from analysis.fit.problem import FitShot, JointProblem

MISFIT_ABOVE = 1.2
"""chi2 per degree of freedom beyond which the stated uncertainty no longer covers the model."""


@dataclass(frozen=True)
class ShotFit:
    """One shot's part of a joint fit.

    Attributes
    ----------
    item : FitShot
        The shot.
    prediction : ndarray, shape (n,)
        Model over the fit window. [unit of the signal]
    local : ndarray, shape (p,)
        Local parameters.
    nuisance_covariance : ndarray, shape (4, 4)
        Of ln v0, ln e, t0 [us], baseline.
    rebound_ratio : float
        Sphere's rebound over impact speed. [1]
    contact_time_s : float
        [s]
    deepest_indentation_m : float
        [m]
    chi2 : float
        Whitened squares, by the noise seen before the trigger.
    """

    item: FitShot
    prediction: NDArray[np.float64]
    local: NDArray[np.float64]
    nuisance_covariance: NDArray[np.float64]
    rebound_ratio: float
    contact_time_s: float
    deepest_indentation_m: float
    chi2: float

    @property
    def own(self) -> NDArray[np.float64]:
        """Return the shot's nuisances: ln v0, ln e, t0 [us], baseline, then free sizes."""
        return self.local[self.local.size - self.nuisance_covariance.shape[0] :]

    @property
    def residual(self) -> NDArray[np.float64]:
        """Return measurement minus model. [unit of the signal]"""
        return self.item.window.signal - self.prediction

    @property
    def rms(self) -> float:
        """Return the residual's root mean square. [unit of the signal]"""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def r2(self) -> float:
        """Return 1 - SS_res / SS_tot over the fit window."""
        y = self.item.window.signal
        return 1 - float(np.sum(self.residual**2)) / float(np.sum((y - y.mean()) ** 2))

    @property
    def chi2_per_dof(self) -> float:
        """Return chi2 over samples less the four nuisances."""
        return self.chi2 / (self.item.frame.samples - self.item.noise.order - 4)

    def flags(self) -> list[str]:
        """Return what a user must know before trusting this shot."""
        found = []
        if self.item.shot.clipped:
            found.append("clipped")
        if self.item.window.polarity < 0:
            found.append("inverted_polarity")
        if self.chi2_per_dof > MISFIT_ABOVE:
            found.append("residual_above_noise")
        if self.own[1] > 2 * math.sqrt(self.nuisance_covariance[1, 1]):
            found.append("restitution_above_one")
        if self.item.noise.source != "pre-trigger":
            found.append("noise_not_measured")
        return found

    def to_json(self) -> Json:
        """Return the shot's part of ``impactd-fit/1``."""
        u = np.sqrt(np.diag(self.nuisance_covariance))
        v0, e = math.exp(self.own[0]), math.exp(self.own[1])
        shot, window = self.item.shot, self.item.window
        start = window.first / shot.sample_rate_hz + self.own[2] * 1e-6
        return {
            "name": shot.name,
            "sphere": shot.sphere,
            "surface": shot.surface,
            "drop_height_m": shot.drop_height_m,
            "impact_speed_m_per_s": measurand(v0, v0 * u[0], "m/s"),
            "restitution": measurand(e, e * u[1], "1"),
            "rebound_ratio": self.rebound_ratio,
            "contact_time_s": self.contact_time_s,
            "deepest_indentation_m": self.deepest_indentation_m,
            "touch_down_s": {"value": float(start), "u": float(u[2]) * 1e-6, "unit": "s"},
            "baseline": {"value": float(self.own[3]), "u": float(u[3])},
            "peak": window.peak,
            "rms": self.rms,
            "nrmse": self.rms / window.peak,
            "r2": self.r2,
            "chi2_per_dof": self.chi2_per_dof,
            "flags": self.flags(),
        }


def collect(problem: JointProblem, fitted: Fitted, *, scale: float) -> tuple[ShotFit, ...]:
    """Return the shots' parts of a fit.

    Parameters
    ----------
    problem : JointProblem
        The problem as it was solved.
    fitted : Fitted
        Its solution.
    scale : float
        Variance factor the problem's noise was widened by; chi2 is stated without it.

    Returns
    -------
    tuple of ShotFit
        In order of time.
    """
    found = []
    for row, item in enumerate(problem.shots):
        shared, _ = problem.shared_local(item, fitted.theta)
        local = np.concatenate([shared, fitted.nuisances[row]])
        p = problem.model.predict(local, item.frame)
        plain = dataclasses.replace(
            item,
            noise=dataclasses.replace(
                item.noise,
                innovation_rms=item.noise.innovation_rms / math.sqrt(scale),
                rms=item.noise.rms / math.sqrt(scale),
            ),
        )
        found.append(
            ShotFit(
                plain,
                p.signal,
                local,
                nuisance_covariance(problem, fitted, row),
                p.rebound_ratio,
                p.contact_time_s,
                p.deepest_indentation_m,
                fitted.blocks[row].chi2 * scale,
            )
        )
    return tuple(found)
