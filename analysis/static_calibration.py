r"""The paper's static calibration of the gain of Eq. 7: known weights on the cell.

.. math:: V = V_0 + \frac{m g}{S}

A piezoelectric cell cannot hold a reading: its charge leaks with the discharge time constant, and
a reading taken t after the weight was put down has fallen to :math:`e^{-t/\tau}` of its step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Json
from analysis.errors import AnalysisError, ParameterOutOfRangeError
from analysis.fit.measurand import measurand

FORMAT = "impactd-static-calibration/1"

MEANINGLESS_LEFT = 0.5
"""Where less than this share of the step is left, the reading tells the leak, not the weight."""
BIASED_LOSS_U = 0.5
"""A loss of more than this share of S's own uncertainty is worth a word."""
POOR_RELATIVE_U = 0.25
"""A slope known no better is no calibration."""
DISAGREES_ABOVE = 3.0


@dataclass(frozen=True)
class Reading:
    """One weight and what the cell read."""

    mass_kg: float
    """>= 0; 0 is the empty cell. [kg]"""
    volts: float
    u_volts: float | None = None
    """Standard uncertainty, > 0; None where nobody stated it. [V]"""


@dataclass(frozen=True)
class StaticCalibration:
    """The gain from weights."""

    gain_n_per_v: float
    """S of Eq. 7 as read, no discharge corrected. [N/V]"""
    u_gain_n_per_v: float
    offset_v: float
    """Reading of the empty cell. [V]"""
    u_offset_v: float
    chi2_per_dof: float | None
    """Of the straight line; None with two readings."""
    residuals_v: NDArray[np.float64]
    """Readings less the line. Shape (n,). [V]"""
    left: float | None
    """Share of the step left when it was read; None where the time constant is not known."""
    readings: tuple[Reading, ...]
    hold_time_s: float
    """From putting the weight down to reading. [s]"""
    discharge_time_constant_s: float | None
    warnings: tuple[str, ...]
    """What a user must know, in words."""

    @property
    def status(self) -> str:
        """Return ``usable``, ``unproven`` or ``meaningless``, by what the discharge left."""
        if self.left is None:
            return "unproven"
        return "usable" if self.left >= MEANINGLESS_LEFT else "meaningless"

    def to_json(self) -> Json:
        """Return the calibration as ``impactd-static-calibration/1``."""
        meaningless = self.status == "meaningless"
        gain = measurand(self.gain_n_per_v, self.u_gain_n_per_v, "N/V")
        return {
            "format": FORMAT,
            "method": "static_weights",
            "outcome": {
                "status": self.status,
                "message": " ".join(self.warnings) or "The line through the weights is straight.",
            },
            "hsd": None if meaningless else {"gain_N_per_V": gain},
            "as_read": {
                "gain_N_per_V": gain,
                "offset_V": measurand(self.offset_v, self.u_offset_v, "V", log=False),
            },
            "chi2_per_dof": self.chi2_per_dof,
            "residuals_V": self.residuals_v.tolist(),
            "discharge": {
                "hold_time_s": self.hold_time_s,
                "time_constant_s": self.discharge_time_constant_s,
                "share_left": self.left,
                "relative_error_of_gain": _error(self.left),
            },
            "readings": [
                {"mass_kg": r.mass_kg, "volts": r.volts, "u_volts": r.u_volts}
                for r in self.readings
            ],
            "warnings": list(self.warnings),
        }


def _error(left: float | None) -> float | None:
    """Return by how much S comes out too large; None where it is unknown or beyond all numbers."""
    return 1 / left - 1 if left is not None and left > 1e-300 else None


def static_calibration(
    readings: Sequence[Reading],
    *,
    hold_time_s: float,
    discharge_time_constant_s: float | None,
    gravity_m_per_s2: float,
) -> StaticCalibration:
    """Return the cell's gain from weights, by weighted least squares with an intercept.

    Uncertainties are widened where the readings scatter more than stated.

    Parameters
    ----------
    readings : sequence of Reading
        At least two different masses; three where no uncertainty is stated.
    hold_time_s : float
        From putting a weight down to its reading, >= 0. [s]
    discharge_time_constant_s : float or None
        Of cell and conditioner, > 0; None where it is not known. [s]

    Raises
    ------
    ParameterOutOfRangeError
        If a mass, an uncertainty or a time cannot be.
    AnalysisError
        If the readings fix no slope.

    Notes
    -----
    Source: Maranzano & Hancock 2016, section 3 (weights); first-order discharge of an IEPE cell.
    The hold time's error is not corrected for: it is stated. Validation: against numpy's
    covariance and made readings in ``tests/analysis/test_static_calibration.py``.
    """
    _check(readings, hold_time_s, discharge_time_constant_s, gravity_m_per_s2)
    force = np.array([r.mass_kg for r in readings]) * gravity_m_per_s2
    volts = np.array([r.volts for r in readings])
    stated = [r.u_volts for r in readings if r.u_volts is not None]
    u = np.array(stated) if stated else np.ones(volts.size)
    design = np.stack([np.ones(force.size), force], axis=1) / u[:, None]
    covariance = np.linalg.inv(design.T @ design)
    line = covariance @ design.T @ (volts / u)
    residuals = volts - line[0] - line[1] * force
    dof = force.size - 2
    chi2 = float(np.sum((residuals / u) ** 2)) / dof if dof > 0 else None
    if chi2 is not None:
        covariance = covariance * (chi2 if not stated or _scattered(chi2, dof) else 1.0)
    u_slope = math.sqrt(float(covariance[1, 1]))
    if not abs(line[1]) * POOR_RELATIVE_U > u_slope:
        raise AnalysisError(
            f"The readings rise by {line[1]:.3g} +- {u_slope:.2g} V per newton, which fixes no "
            "gain; the cell may have discharged before it was read, or the weights are too small "
            "for the range."
        )
    gain = 1 / abs(float(line[1]))
    left = None
    if discharge_time_constant_s is not None:
        left = math.exp(-hold_time_s / discharge_time_constant_s)
    u_gain = gain * u_slope / abs(float(line[1]))
    notes = [*_discharge_words(left, hold_time_s, discharge_time_constant_s, u_gain / gain)]
    if line[1] < 0:
        notes.append("The reading falls with the load: the polarity is inverted.")
    if stated and chi2 is not None and _scattered(chi2, dof):
        notes.append(
            f"The readings scatter {math.sqrt(chi2):.1f} times more than stated, or the line is "
            "not straight; the uncertainty was widened."
        )
    return StaticCalibration(
        gain,
        u_gain,
        float(line[0]),
        math.sqrt(float(covariance[0, 0])),
        chi2 if stated else None,
        residuals,
        left,
        tuple(readings),
        hold_time_s,
        discharge_time_constant_s,
        tuple(notes),
    )


def _scattered(chi2_per_dof: float, dof: int) -> bool:
    return chi2_per_dof > 1 + 3 * math.sqrt(2 / dof)


def _discharge_words(
    left: float | None, hold_s: float, tau_s: float | None, relative_u: float
) -> list[str]:
    if left is None:
        return [
            "The discharge time constant was not stated: a reading falls from the moment the "
            "weight is down, and S comes out too large by exp(t/tau) - 1. Take tau from the data "
            "sheets of cell and conditioner, or from the decay of one reading."
        ]
    loss = 1 - left
    if left < MEANINGLESS_LEFT:
        return [
            f"Meaningless: with a discharge time of {tau_s:g} s only {left:.2g} of each reading "
            f"is left after {hold_s:g} s, so the slope tells the leak and not the weight. Use a "
            "conditioner with a longer time constant, or calibrate with drops."
        ]
    if loss > BIASED_LOSS_U * relative_u:
        return [
            f"The readings had fallen by {loss:.2%} when they were taken ({hold_s:g} s at a "
            f"discharge time of {tau_s:g} s), and S is too large by {1 / left - 1:.2%}, against "
            f"an uncertainty of {relative_u:.2%}; read sooner."
        ]
    return []


def _check(readings: Sequence[Reading], hold_s: float, tau_s: float | None, gravity: float) -> None:
    if not (math.isfinite(hold_s) and hold_s >= 0):
        raise ParameterOutOfRangeError("hold_time_s", hold_s, "0 or more")
    if tau_s is not None and not tau_s > 0:
        raise ParameterOutOfRangeError("discharge_time_constant_s", tau_s, "above 0")
    if not gravity > 0:
        raise ParameterOutOfRangeError("gravity_m_per_s2", gravity, "above 0")
    for i, r in enumerate(readings):
        if not (math.isfinite(r.mass_kg) and r.mass_kg >= 0):
            raise ParameterOutOfRangeError(f"readings[{i}].mass_kg", r.mass_kg, "0 or more")
        if not math.isfinite(r.volts):
            raise ParameterOutOfRangeError(f"readings[{i}].volts", r.volts, "a number")
        if r.u_volts is not None and not (math.isfinite(r.u_volts) and r.u_volts > 0):
            raise ParameterOutOfRangeError(f"readings[{i}].u_volts", r.u_volts, "above 0")
    stated = sum(r.u_volts is not None for r in readings)
    if stated not in (0, len(readings)):
        raise AnalysisError(
            f"{stated} of {len(readings)} readings state u_volts; state it for all or for none."
        )
    distinct = len({r.mass_kg for r in readings})
    if distinct < 2 or (not stated and len(readings) < 3):
        raise AnalysisError(
            f"{len(readings)} readings of {distinct} different masses fix no slope with an "
            "uncertainty; take two masses with u_volts, or at least three readings."
        )


def compare(static: Json, dynamic: Json) -> Json:
    """Return how the gain from weights lies to that of a calibration with drops.

    From ``impactd-static-calibration/1`` and ``impactd-calibration/1``: against S = k c of the
    crystal and against S of the rigid-cell model, where each is known, ``change`` (static over
    dynamic, less one) and ``in_u``; and a ``sentence``.
    """
    one = (static.get("hsd") or {}).get("gain_N_per_V")
    hsd = (dynamic.get("hsd") or {}).get("gain_N_per_V")
    others = {dynamic["model"]: (dynamic.get("identifiable") or {}).get("gain_N_per_V"), "hsd": hsd}
    found: Json = {}
    for name, other in others.items():
        if one and other:
            change = math.log(one["value"] / other["value"])
            u = math.hypot(one["u"] / one["value"], other["u"] / other["value"])
            found[name] = {"change": math.expm1(change), "u": u, "in_u": change / u if u else 0.0}
    if not found:
        return {"against": {}, "sentence": "Nothing to compare."}
    name = next(iter(found))
    size = abs(found[name]["in_u"])
    verdict = "disagree" if size > DISAGREES_ABOVE else "agree"
    return {
        "against": found,
        "sentence": (
            f"Weights and drops {verdict}: S from weights is {found[name]['change']:+.2%} from the "
            f"{name} gain of the drops, {size:.1f} combined standard uncertainties."
        ),
    }
