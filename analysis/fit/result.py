"""What a fit found, as a value: numbers with uncertainty, and an outcome that says what to do."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Quantity
from analysis.fit.joint import Fitted, nuisance_covariance
from analysis.fit.problem import (
    SENSOR_FIELDS,
    SENSOR_OFFSET,
    UNKNOWN_LOG_U,
    FitShot,
    JointProblem,
    sensor_transform,
)
from analysis.model import solver

FORMAT = "impactd-fit/1"
WITHHOLD_ABOVE = 0.25
"""A relative standard uncertainty beyond which a modulus is withheld."""
MISFIT_ABOVE = 1.2
"""chi2 per degree of freedom beyond which the stated uncertainty no longer covers the model."""
NORMAL95 = 1.959963984540054
HSD_FIELDS = ("hsd_n_per_v",)

Json = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """How a fit ended, in words.

    Attributes
    ----------
    status : str
        ``converged``, ``not_converged`` or ``not_evaluable``.
    message : str
        What happened and, unless all is well, what to do.
    """

    status: str
    message: str


def measurand(value: float, u: float, unit: str, *, log: bool = True) -> Json | None:
    """Return value, u and 95 % interval as JSON; None where a number would not be finite."""
    if not (math.isfinite(value) and math.isfinite(u)):
        return None
    if log and value > 0:
        factor = math.exp(min(NORMAL95 * u / value, 50.0))
        interval = [value / factor, value * factor]
    else:
        interval = [value - NORMAL95 * u, value + NORMAL95 * u]
    return {
        "value": float(value),
        "u": float(u),
        "unit": unit,
        "interval95": [float(x) for x in interval],
    }


def young_from_plane_strain(
    log_plane: float, u_log: float, prior: Quantity | None, ratio: Quantity
) -> tuple[float, float]:
    r"""Return Young's modulus and its relative standard uncertainty from a fitted E'.

    Parameters
    ----------
    log_plane, u_log : float
        ln E' with E' in Pa, and its standard uncertainty.
    prior : Quantity or None
        Young's modulus as stated beforehand; None where it is to be found. [Pa]
    ratio : Quantity
        Poisson's ratio, which no normal impact can tell.

    Returns
    -------
    tuple of float
        E [Pa] and u(E)/E.

    Notes
    -----
    Source: ln E' = a + b with a = ln E and b = -ln(1 - nu^2) independent beforehand; the fit fixes
    their sum, the priors share it out. Without a prior on E all of u(b) goes to E. Validation:
    against sampling in ``tests/analysis/fit/test_result.py``.
    """
    b = -math.log(1 - ratio.value**2)
    var_b = (2 * ratio.value * ratio.u / (1 - ratio.value**2)) ** 2
    if prior is None:
        return math.exp(log_plane - b), math.sqrt(u_log**2 + var_b)
    var_a = (prior.u / prior.value) ** 2
    total = var_a + var_b
    if total == 0.0:
        return prior.value, 0.0
    share = var_a / total
    a = math.log(prior.value) + share * (log_plane - math.log(prior.value) - b)
    return math.exp(a), math.sqrt(var_a * var_b / total + (share * u_log) ** 2)


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
        if self.local[-3] > 2 * math.sqrt(self.nuisance_covariance[1, 1]):
            found.append("restitution_above_one")
        if self.item.noise.source != "pre-trigger":
            found.append("noise_not_measured")
        return found

    def to_json(self) -> Json:
        """Return the shot's part of ``impactd-fit/1``."""
        u = np.sqrt(np.diag(self.nuisance_covariance))
        v0, e = math.exp(self.local[-4]), math.exp(self.local[-3])
        shot, window = self.item.shot, self.item.window
        start = window.first / shot.sample_rate_hz + self.local[-2] * 1e-6
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
            "baseline": {"value": float(self.local[-1]), "u": float(u[3])},
            "peak": window.peak,
            "rms": self.rms,
            "nrmse": self.rms / window.peak,
            "r2": self.r2,
            "chi2_per_dof": self.chi2_per_dof,
            "flags": self.flags(),
        }


@dataclass(frozen=True)
class FitResult:
    """A joint fit of a campaign.

    Attributes
    ----------
    model : str
        Base model, plus effects.
    outcome : Outcome
        How it ended.
    problem : JointProblem
        What was fitted, with the noise as measured.
    fitted : Fitted
        End point; its covariance is already widened by ``misfit``.
    shots : tuple of ShotFit
        In order of time.
    misfit : float
        Variance factor by which covariances were widened because the residual exceeds the noise;
        1 where it does not.
    heldout_rms : float or None
        Residual of shots that the shared parameters had not seen. [unit of the signal]
    """

    model: str
    outcome: Outcome
    problem: JointProblem
    fitted: Fitted
    shots: tuple[ShotFit, ...]
    misfit: float
    heldout_rms: float | None

    # -- quality ---------------------------------------------------------------------------------
    @property
    def degrees_of_freedom(self) -> int:
        """Return samples less fitted parameters."""
        used = sum(s.item.frame.samples - s.item.noise.order - 4 for s in self.shots)
        return used - len(self.problem.names)

    @property
    def chi2_per_dof(self) -> float:
        """Return the whitened squares of all samples per degree of freedom."""
        return sum(s.chi2 for s in self.shots) / self.degrees_of_freedom

    @property
    def rms(self) -> float:
        """Return the pooled residual. [unit of the signal]"""
        squares = sum(float(np.sum(s.residual**2)) for s in self.shots)
        return math.sqrt(squares / sum(s.item.frame.samples for s in self.shots))

    @property
    def noise_rms(self) -> float:
        """Return the pooled noise before the trigger. [unit of the signal]"""
        return math.sqrt(float(np.mean([s.item.noise.rms**2 for s in self.shots])))

    @property
    def r2(self) -> float:
        """Return 1 - SS_res / SS_tot pooled over the fit windows."""
        residual = sum(float(np.sum(s.residual**2)) for s in self.shots)
        total = 0.0
        for s in self.shots:
            y = s.item.window.signal
            total += float(np.sum((y - y.mean()) ** 2))
        return 1 - residual / total

    @property
    def nrmse(self) -> float:
        """Return the median over shots of rms residual over peak."""
        return float(np.median([s.rms / s.item.window.peak for s in self.shots]))

    # -- parameters ------------------------------------------------------------------------------
    def _log(self, name: str) -> tuple[float, float]:
        j = self.problem.names.index(name)
        return float(self.fitted.theta[j]), math.sqrt(float(self.fitted.covariance[j, j]))

    def sensor_logs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return ln(M, k, mu, c) and covariance, None unless all four are parameters."""
        names = [f"sensor.{n}" for n in ("ln_S", "ln_w", "ln_z", "ln_M")]
        at = [self.problem.index(n) for n in names]
        if any(j is None for j in at):
            return None
        transform = sensor_transform()
        logs = transform @ self.fitted.theta[at] + SENSOR_OFFSET
        return logs, transform @ self.fitted.covariance[np.ix_(at, at)] @ transform.T

    def pair_modulus(self, item: FitShot) -> tuple[float, float, NDArray[np.float64]] | None:
        """Return ln E*, its standard uncertainty and its gradient by the globals.

        Parameters
        ----------
        item : FitShot
            Any shot of the pair.

        Returns
        -------
        tuple or None
            None in reduced units, where a stiffness is no modulus.
        """
        if item.radius_m is None:
            return None
        values, chain = self.problem.shared_local(item, self.fitted.theta)
        log = float(values[0]) - math.log(4 / 3 * math.sqrt(item.radius_m))
        gradient = chain[0]
        return log, math.sqrt(float(gradient @ self.fitted.covariance @ gradient)), gradient

    def calibration_part(self, item: FitShot) -> tuple[float, NDArray[np.float64]]:
        r"""Return the part of u(ln E*) that comes from the cell's stated values.

        Parameters
        ----------
        item : FitShot
            Any shot of the pair.

        Returns
        -------
        u : float
            Standard uncertainty, common to all fits that take the cell from one calibration. [1]
        sensitivity : ndarray, shape (4,) or (1,)
            d ln E* / d ln(M, k, mu, c) for KV, d ln E* / d ln S for HSD: how E* follows when the
            stated values are wrong. Zeros where the cell is no complete parameter.

        Notes
        -----
        With precision P of the priors and covariance :math:`\Sigma` of the fit, an error d of the
        prior means moves the fit by :math:`\Sigma P d`; the rest of :math:`\Sigma` is this
        recording's own noise and independent from shot to shot.
        """
        found = self.pair_modulus(item)
        at = [j for j, n in enumerate(self.problem.names) if n.startswith("sensor.")]
        size = 1 if self.problem.model.kind == solver.HSD else len(SENSOR_FIELDS)
        if found is None or not at:
            return 0.0, np.zeros(size)
        follows = found[2] @ self.fitted.covariance[:, at]
        precision = self.problem.prior_precision[np.ix_(at, at)]
        sensitivity = np.zeros(size)
        if len(at) == size:
            sensitivity = follows @ precision
            if size > 1:
                sensitivity = sensitivity @ np.linalg.inv(sensor_transform())
        return math.sqrt(max(float(follows @ precision @ follows), 0.0)), sensitivity

    def moduli(self) -> Json:
        """Return ``moduli`` of ``impactd-diagnosis/1``: by material, withheld where not known."""
        found: Json = {}
        names = [n for n in self.problem.names if n.startswith(("sphere.", "surface."))]
        plain = [n.split(".", 1)[1] for n in names]
        for name, short in zip(names, plain, strict=True):
            side, _, _ = name.partition(".")
            key = short if plain.count(short) == 1 else f"{side}:{short}"
            found[key] = self._modulus(name, side, short)
        return found

    def _modulus(self, name: str, side: str, short: str) -> Json:
        campaign = self.problem.campaign
        material = campaign.spheres[short] if side == "sphere" else campaign.surfaces[short]
        log, u = self._log(name)
        status = "fitted" if material.youngs_modulus_pa is None else "reference"
        reason = None
        if self.outcome.status == "not_evaluable":
            status, reason = "withheld", self.outcome.message
        elif not u <= WITHHOLD_ABOVE:
            status = "withheld"
            reason = (
                f"these data leave a factor {math.exp(min(u, 2 * UNKNOWN_LOG_U)):.2g} open; drop a "
                "reference sphere on it, or this sphere on a reference surface"
            )
        if status == "withheld":
            return {
                "youngs_modulus_Pa": None,
                "plane_strain_modulus_Pa": None,
                "side": side,
                "status": status,
                "reason": reason,
            }
        plane = math.exp(log)
        young = None
        if material.poissons_ratio is not None:
            e, u_e = young_from_plane_strain(
                log, u, material.youngs_modulus_pa, material.poissons_ratio
            )
            young = measurand(e, e * u_e, "Pa")
        return {
            "youngs_modulus_Pa": young,
            "plane_strain_modulus_Pa": measurand(plane, plane * u, "Pa"),
            "side": side,
            "status": status,
        }

    def pairs(self) -> Json:
        """Return each pair's reduced modulus, or its stiffness in reduced units."""
        found: Json = {}
        for shot in self.shots:
            key = shot.item.pair
            if key in found:
                found[key]["shots"] += 1
                continue
            modulus = self.pair_modulus(shot.item)
            entry: Json = {
                "sphere": shot.item.shot.sphere,
                "surface": shot.item.shot.surface,
                "shots": 1,
            }
            if modulus is not None:
                value = math.exp(modulus[0])
                entry["reduced_modulus_Pa"] = measurand(value, value * modulus[1], "Pa")
                u_cell, sensitivity = self.calibration_part(shot.item)
                entry["u_calibration_Pa"] = value * u_cell
                fields = SENSOR_FIELDS if sensitivity.size > 1 else HSD_FIELDS
                entry["d_ln_reduced_modulus_d_ln_sensor"] = dict(
                    zip(fields, sensitivity.tolist(), strict=True)
                )
            else:
                values, chain = self.problem.shared_local(shot.item, self.fitted.theta)
                k = math.exp(values[0])
                u = math.sqrt(float(chain[0] @ self.fitted.covariance @ chain[0]))
                entry["stiffness_over_mass"] = measurand(k, k * u, "N m^-1.5 kg^-1")
            found[key] = entry
        return found

    def parameters(self) -> Json:
        """Return what was fitted, identifiable combinations first, with units."""
        found: Json = {}
        forms = {
            "sensor.ln_S": ("sensor.gain_N_per_V", 1.0, "N/V"),
            "sensor.ln_w": ("sensor.natural_frequency_Hz", 1 / (2 * math.pi), "Hz"),
            "sensor.ln_z": ("sensor.damping_ratio", 1.0, "1"),
        }
        for name, (label, factor, unit) in forms.items():
            if name in self.problem.names:
                log, u = self._log(name)
                value = factor * math.exp(log)
                found[label] = measurand(value, value * u, unit)
        cell = self.sensor_logs()
        if cell is not None:
            units = ("kg", "N/m", "N s/m", "m/V")
            for label, log, u, unit in zip(
                SENSOR_FIELDS, cell[0], np.sqrt(np.diag(cell[1])), units, strict=True
            ):
                value = math.exp(log)
                found[f"sensor.{label}"] = measurand(value, value * u, unit)
        for name in self.problem.names:
            if not name.startswith("sensor."):
                log, u = self._log(name)
                value = math.exp(log)
                unit = "N m^-1.5" if name.startswith("pair.") else "Pa"
                found[name] = measurand(value, value * u, unit)
        return found

    def to_json(self) -> Json:
        """Return the result as ``impactd-fit/1``; NaN and infinity never appear."""
        if self.outcome.status == "not_evaluable":
            return {
                "format": FORMAT,
                "model": self.model,
                "outcome": dataclasses.asdict(self.outcome),
                "parameters": {},
                "covariance": None,
                "moduli": {},
                "pairs": {},
                "shots": [],
                "rejected": [dataclasses.asdict(r) for r in self.problem.rejected],
            }
        return {
            "format": FORMAT,
            "model": self.model,
            "outcome": dataclasses.asdict(self.outcome),
            "noise_rms_V": self.noise_rms,
            "noise": [_noise_json(s) for s in self._distinct_noise()],
            "rms_V": self.rms,
            "nrmse": self.nrmse,
            "r2": self.r2,
            "chi2_per_dof": self.chi2_per_dof,
            "degrees_of_freedom": self.degrees_of_freedom,
            "heldout_rms_V": self.heldout_rms,
            "uncertainty_widened_by": math.sqrt(self.misfit),
            "parameters": self.parameters(),
            "covariance": {
                "of": "natural logarithms of",
                "names": list(self.problem.names),
                "matrix": self.fitted.covariance.tolist(),
            },
            "moduli": self.moduli(),
            "pairs": self.pairs(),
            "shots": [s.to_json() for s in self.shots],
            "rejected": [dataclasses.asdict(r) for r in self.problem.rejected],
            "assumptions": list(self.problem.assumptions),
            "flags": self.flags(),
        }

    def flags(self) -> list[str]:
        """Return what a user must know before trusting the moduli."""
        found = [] if self.outcome.status == "converged" else [self.outcome.status]
        if self.misfit > 1:
            found.append("residual_above_noise")
        if self.problem.model.kind == solver.HSD:
            found.append("rigid_cell_model")
        return found

    def _distinct_noise(self) -> list[FitShot]:
        seen: dict[int, FitShot] = {}
        for s in self.shots:
            seen.setdefault(id(s.item.noise), s.item)
        return list(seen.values())


def _noise_json(item: FitShot) -> Json:
    noise = item.noise
    return {
        "quantity": item.shot.quantity,
        "rms": noise.rms,
        "innovation_rms": noise.innovation_rms,
        "ar_coefficients": noise.coefficients.tolist(),
        "samples": noise.samples,
        "source": noise.source,
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


def as_quantity(measurand: Json) -> Quantity:
    """Return a measurand of our JSON as a Quantity."""
    return Quantity(float(measurand["value"]), float(measurand["u"]))
