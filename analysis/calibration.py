"""Calibration of the load cell: a joint fit over drops of known spheres on known surfaces.

What the drops identify comes first: gain S = k c, natural frequency and damping ratio. Table 3's M,
k, mu and c follow with their covariance; the crystal's mass mostly stays what the certificate said,
because it acts only through a recoil of one part in a thousand.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Json
from analysis.base_models import DEFAULT_BASE
from analysis.calibration_document import FORMAT, IDENTIFIABLE, sensor_from_json
from analysis.campaign import Campaign, Quantity, Sensor, Shot
from analysis.cell_drift import drift, drift_basis
from analysis.errors import AnalysisError
from analysis.fit.campaign_fit import Progress, fit_campaign
from analysis.fit.estimates import input_parts
from analysis.fit.problem import SENSOR_FIELDS, sensor_transform
from analysis.fit.result import FitResult
from analysis.identifiability_words import short_sentence
from analysis.parameters import CELL, GAIN
from analysis.written_numbers import counted

__all__ = ["CalibrationResult", "calibrate", "drift", "sensor_from_json"]


LOOSENED_U = 0.5
"""An earlier calibration only starts the fit; were it a prior, drift would be hidden by itself."""
LITTLE_LEARNED = 0.7
"""Uncertainty after over before, above which the shots said little about a quantity."""


@dataclass(frozen=True)
class CalibrationResult:
    """A calibration of the cell.

    Attributes
    ----------
    fit : FitResult
        The joint fit of the known pairs.
    hsd : FitResult or None
        The rigid-cell fit of the same shots, which gives Eq. 7's S.
    excluded : tuple of tuple of str
        (shot, reason) of shots that were no calibration shots.
    warnings : tuple of str
        What a user must know, in words.
    """

    model: str
    fit: FitResult
    hsd: FitResult | None
    excluded: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]

    @property
    def sensor(self) -> Sensor:
        """Return the cell as later fits take it, covariance included."""
        return sensor_from_json(self.to_json())

    def to_json(self) -> Json:
        """Return the calibration as ``impactd-calibration/1``: all that is needed to rebuild it."""
        found = self.fit.parameters() if self.fit.outcome.status != "not_evaluable" else {}
        cell = self.fit.sensor_logs() if found else None
        covariance = None
        if cell is not None:
            covariance = {
                "of": "natural logarithms of",
                "names": list(SENSOR_FIELDS),
                "matrix": cell[1].tolist(),
            }
        return {
            "format": FORMAT,
            "model": self.model,
            "outcome": dataclasses.asdict(self.fit.outcome),
            "identifiable": {
                label: found[name] for name, label in IDENTIFIABLE.items() if name in found
            },
            "parameters": {
                name: found[f"sensor.{name}"] for name in SENSOR_FIELDS if f"sensor.{name}" in found
            },
            "covariance": covariance,
            "inputs": _inputs_json(self.fit) if cell is not None else {},
            "drift_basis": drift_basis(self.fit.problem, self.fit.fitted) if found else None,
            "hsd": _hsd_json(self.hsd),
            "quality": _quality(self.fit) if found else None,
            "pairs": self.fit.pairs() if found else {},
            "moduli": self.fit.moduli() if found else {},
            "shots": [s.item.shot.name for s in self.fit.shots],
            "excluded": [{"shot": name, "reason": why} for name, why in self.excluded],
            "rejected": [dataclasses.asdict(r) for r in self.fit.problem.rejected],
            "assumptions": list(self.fit.problem.assumptions),
            "warnings": list(self.warnings),
        }


def _quality(fit: FitResult) -> Json:
    return {
        "r2": fit.r2,
        "nrmse": fit.nrmse,
        "rms_V": fit.rms,
        "noise_rms_V": fit.noise_rms,
        "chi2_per_dof": fit.chi2_per_dof,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "uncertainty_widened_by": math.sqrt(fit.misfit),
        "flags": fit.flags(),
    }


def _inputs_json(fit: FitResult) -> Json:
    """Return how the cell's logarithms follow each input, by one u of it."""
    problem, at = fit.problem, fit.problem.positions(CELL)
    rows = np.zeros((4, len(problem.names)))
    rows[:, at] = sensor_transform()
    parts = input_parts(problem, fit.fitted, rows)
    return {name: (follows * u).tolist() for name, (follows, u) in parts.items()}


def _gain_inputs_json(hsd: FitResult) -> Json:
    rows = np.zeros((1, len(hsd.problem.names)))
    rows[0, hsd.problem.names.index(GAIN)] = 1.0
    parts = input_parts(hsd.problem, hsd.fitted, rows)
    return {name: (follows * u).tolist() for name, (follows, u) in parts.items()}


def _hsd_json(hsd: FitResult | None) -> Json | None:
    if hsd is None or hsd.outcome.status != "converged":
        return None
    return {
        "gain_N_per_V": hsd.parameters()["sensor.gain_N_per_V"],
        "inputs": _gain_inputs_json(hsd),
        "quality": _quality(hsd),
    }


def _why_not(shot: Shot, campaign: Campaign) -> str | None:
    """Return why a shot cannot calibrate, None if it can."""
    sphere = campaign.spheres.get(shot.sphere or "")
    surface = campaign.surfaces.get(shot.surface or "")
    found = []
    if shot.quantity != "voltage":
        found.append(f"it is a recording of {shot.quantity}, not of the cell's voltage")
    if sphere is None or not (sphere.radius_m and sphere.mass_kg):
        found.append("its sphere's radius and mass are not known")
    elif sphere.youngs_modulus_pa is None:
        found.append(f"the sphere {sphere.name!r} has no stated modulus")
    if surface is None:
        found.append("its surface is not known")
    elif surface.youngs_modulus_pa is None:
        found.append(f"the surface {surface.name!r} has no stated modulus")
    if shot.drop_height_m is None and shot.impact_speed_m_per_s is None:
        found.append("its drop height is not known")
    if shot.clipped:
        found.append("it reaches a limit of the converter or amplifier")
    return "; ".join(found) or None


def _prior_sensor(sensor: Sensor) -> tuple[Sensor, str | None]:
    """Return the cell as the calibration may know it, and a warning where something was loosened.

    A covariance is the mark of an earlier calibration. Its gain, frequency and damping must not
    pull the new one towards the old; the crystal's mass is kept, nothing else ever tells it.
    """
    if sensor.covariance is None:
        return sensor, None

    def loose(q: Quantity | None) -> Quantity | None:
        return None if q is None else Quantity(q.value, LOOSENED_U * q.value)

    return (
        dataclasses.replace(
            sensor,
            covariance=None,
            inputs={},
            hsd_inputs={},
            crystal_stiffness_n_per_m=loose(sensor.crystal_stiffness_n_per_m),
            crystal_damping_n_s_per_m=loose(sensor.crystal_damping_n_s_per_m),
            compliance_m_per_v=loose(sensor.compliance_m_per_v),
            hsd_n_per_v=loose(sensor.hsd_n_per_v),
        ),
        "the cell's earlier calibration was only used as a start (its crystal mass excepted), so "
        "that a drift can show",
    )


def calibrate(
    campaign: Campaign, model: str = DEFAULT_BASE, *, progress: Progress | None = None
) -> CalibrationResult:
    """Return the cell's parameters from drops of known spheres on known surfaces.

    The result always has an outcome; look at it and at ``warnings`` before use.

    Parameters
    ----------
    campaign : Campaign
        Recordings; shots of pairs without stated moduli are left out and listed.
    model : str
        ``kv2`` or ``kv`` for Table 3's parameters, ``hsd`` for S alone.
    progress : callable, optional
        Told what is being done and a share between 0 and 1.

    Raises
    ------
    AnalysisError
        If no shot of the campaign is one of a known pair.
    UnknownModelError
        If there is no such model.

    Notes
    -----
    Source: Maranzano & Hancock 2016, Table 3 and section 3. Validation:
    ``tests/analysis/test_calibration.py``.
    """
    kept, excluded = [], []
    for shot in campaign.shots:
        reason = _why_not(shot, campaign)
        if reason is None:
            kept.append(shot)
        else:
            excluded.append((shot.name, reason))
    if not kept:
        first = f" ({excluded[0][0]}: {excluded[0][1]})" if excluded else ""
        raise AnalysisError(
            f"None of {counted(len(campaign.shots), 'shot')} can calibrate the cell{first}; "
            "drop spheres of stated modulus from a known height on surfaces of stated modulus."
        )
    sensor, loosened = _prior_sensor(campaign.sensor)
    known = dataclasses.replace(campaign, shots=tuple(kept), sensor=sensor)
    fit = fit_campaign(known, model, progress=progress)
    hsd = fit_campaign(known, "hsd", heldout=False) if model != "hsd" else fit
    notes = _warnings(fit, sensor, kept)
    if loosened is not None:
        notes.append(loosened)
    return CalibrationResult(model, fit, hsd, tuple(excluded), tuple(notes))


def _warnings(fit: FitResult, sensor: Sensor, kept: list[Shot]) -> list[str]:
    """Return what the shots could not tell, in words."""
    if fit.outcome.status != "converged":
        return [fit.outcome.message]
    found = []
    cell = fit.sensor_logs()
    if cell is not None:
        found.extend(_mass_warning(sensor, math.sqrt(float(cell[1][0, 0]))))
        found.extend(_short_contacts(fit))
    if len({s.drop_height_m for s in kept if s.impact_speed_m_per_s is None}) < 2 and not any(
        s.impact_speed_m_per_s for s in kept
    ):
        found.append("all drops are from one height: an error of the height goes into the gain")
    if len({(s.sphere, s.surface) for s in kept}) < 2:
        found.append(
            "only one pair was dropped: an error of its stated moduli goes into the gain; add a "
            "second sphere or surface"
        )
    if fit.misfit > 1:
        found.append(
            f"the residual exceeds the noise (chi2 per degree of freedom {fit.chi2_per_dof:.3g}); "
            "uncertainties were widened, a bias is possible: look at the residual"
        )
    return found


def _mass_warning(sensor: Sensor, after: float) -> list[str]:
    """Return what is to be said about M, k, mu and c apart from their sharp combinations.

    With frequency, damping ratio and gain known, each of the four certificates tells the one
    combination that is left; only the recoil adds to them.
    """
    stated = [q for q in (getattr(sensor, name) for name in SENSOR_FIELDS) if q is not None]
    if not stated:
        return [
            f"no certificate of the cell was given; the drops leave {after:.0%} of its crystal's "
            "mass open, and k, mu and c share that; gain, frequency and damping ratio do not"
        ]
    before = sum((q.u / q.value) ** -2 if q.u > 0 else math.inf for q in stated) ** -0.5
    if after <= LITTLE_LEARNED * before:
        return []
    return [
        "the crystal's mass is the certificate's: the drops hardly see it; k, mu and c share its "
        f"{after:.1%}, gain, frequency and damping ratio do not"
    ]


def _short_contacts(fit: FitResult) -> list[str]:
    return [short_sentence(pair, share) for pair, share in fit.identifiability().short.items()]
