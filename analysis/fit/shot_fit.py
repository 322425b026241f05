"""One shot's part of a joint fit: prediction, residual, quality, flags."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Array, Json
from analysis.fit.blocks import rebound_as_seen
from analysis.fit.joint import Fitted, nuisance_covariance
from analysis.fit.measurand import measurand
from analysis.fit.problem import FitShot, JointProblem

RESTITUTION_DISAGREES_ABOVE = 4.0
"""Bounce and trace then tell two stories; chance alone does it once in 16 000 shots."""
MISFIT_ABOVE = 1.2
"""chi2 per degree of freedom beyond which the stated uncertainty no longer covers the model."""


@dataclass(frozen=True)
class ShotFit:
    """One shot's part of a joint fit."""

    item: FitShot
    prediction: NDArray[np.float64]
    """Model over the fit window, shape (n,). [unit of the signal]"""
    local: NDArray[np.float64]
    nuisance_covariance: NDArray[np.float64]
    """Of ln v0, ln e, t0 [us], baseline. Shape (4, 4)."""
    rebound_ratio: float
    """Sphere's rebound over impact speed. [1]"""
    contact_time_s: float
    deepest_indentation_m: float
    chi2: float
    """Whitened squares, by the noise seen before the trigger."""
    seen_ratio: float
    """Rebound ratio as whoever stated a restitution saw it. [1]"""
    u_seen_ratio: float
    """Its standard uncertainty, the stated restitution included. [1]"""

    @property
    def restitution_pull(self) -> float | None:
        """Return the stated restitution less the fitted one, over the u of that difference.

        The fit has used the statement, so the difference is known to sqrt(u_stated^2 - u_fit^2);
        None where nothing was stated or the trace adds nothing to it.
        """
        stated = self.item.shot.restitution
        if stated is None or not stated.u > 1.02 * self.u_seen_ratio:
            return None
        return (stated.value - self.seen_ratio) / math.sqrt(stated.u**2 - self.u_seen_ratio**2)

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
    def is_upside_down(self) -> bool:
        """Whether the record, turned, is an impact: the model has more than half of its squares."""
        return self.item.window.polarity < 0 and self.r2 > 0.5

    @property
    def chi2_per_dof(self) -> float:
        """Return chi2 over samples less the four nuisances."""
        return self.chi2 / max(self.item.expected_squares - 4, 1)

    def flags(self) -> list[str]:
        """Return what a user must know before trusting this shot."""
        found = []
        if self.item.shot.clipped:
            found.append("clipped")
        if self.is_upside_down:
            found.append("inverted_polarity")
        if self.chi2_per_dof > MISFIT_ABOVE:
            found.append("residual_above_noise")
        if self.own[1] > 2 * math.sqrt(self.nuisance_covariance[1, 1]):
            found.append("restitution_above_one")
        pull = self.restitution_pull
        if pull is not None and abs(pull) > RESTITUTION_DISAGREES_ABOVE:
            found.append("restitution_disagrees")
        if not self.item.noise.is_measured:
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
            "impact_speed_m_per_s": measurand(v0, v0 * u[0], "m/s") if self.item.in_si else None,
            "restitution": measurand(e, e * u[1], "1"),
            "rebound_ratio": self.rebound_ratio,
            "restitution_check": self._restitution_check(),
            "contact_time_s": self.contact_time_s,
            "deepest_indentation_m": self.deepest_indentation_m if self.item.in_si else None,
            "touch_down_s": {"value": float(start), "u": float(u[2]) * 1e-6, "unit": "s"},
            "baseline": {"value": float(self.own[3]), "u": float(u[3])},
            "peak": window.peak,
            "rms": self.rms,
            "nrmse": self.rms / window.peak,
            "r2": self.r2,
            "chi2_per_dof": self.chi2_per_dof,
            "flags": self.flags(),
        }

    def _restitution_check(self) -> Json | None:
        stated = self.item.shot.restitution
        if stated is None:
            return None
        return {
            "stated": {"value": stated.value, "u": stated.u},
            "fitted": {"value": self.seen_ratio, "u": self.u_seen_ratio},
            "difference_in_u": self.restitution_pull,
        }


def _seen(problem: JointProblem, item: FitShot, local: Array, own: Array) -> tuple[float, float]:
    """Return the rebound ratio as seen, and its u from the shot's own parameters."""
    found, _, gradient = problem.model.linearise(local, item.frame)
    ratio, slope = rebound_as_seen(problem.model, item, local, found.rebound_ratio, gradient)
    by_own = slope[local.size - own.shape[0] :]
    return ratio, math.sqrt(max(float(by_own @ own @ by_own), 0.0))


def collect(problem: JointProblem, fitted: Fitted, *, scale: float) -> tuple[ShotFit, ...]:
    """Return the shots' parts of a fit, in order of time.

    ``scale`` is the variance factor the problem's noise was widened by; chi2 is stated without it.
    """
    found = []
    for row, item in enumerate(problem.shots):
        at = problem.item_at(item, fitted.theta)
        shared, _ = problem.shared_local(at, fitted.theta)
        local = np.concatenate([shared, fitted.nuisances[row]])
        p = problem.model.predict(local, at.frame)
        plain = dataclasses.replace(
            item,
            window=at.window,  # without what the laws are wrong by
            noise=dataclasses.replace(
                item.noise,
                innovation_rms=item.noise.innovation_rms / math.sqrt(scale),
                rms=item.noise.rms / math.sqrt(scale),
            ),
        )
        own = nuisance_covariance(problem, fitted, row)
        seen = (p.rebound_ratio, math.inf)
        if item.shot.restitution is not None:
            seen = _seen(problem, at, local, own)
        found.append(
            ShotFit(
                plain,
                p.signal,
                local,
                own,
                p.rebound_ratio,
                p.contact_time_s,
                p.deepest_indentation_m,
                fitted.blocks[row].chi2 * scale,
                *seen,
            )
        )
    return tuple(found)
