"""The reduced modulus of one pair from one fit: an observation of the network of moduli."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.aliases import Array, Json
from analysis.fit.estimates import HSD_FIELDS
from analysis.fit.problem import SENSOR_FIELDS
from analysis.fit.result import FitResult


@dataclass(frozen=True)
class PairObservation:
    """The reduced modulus that one fit found for one pair.

    Attributes
    ----------
    log_reduced_modulus : float
        ln E*, E* in Pa.
    u_random : float
        Standard uncertainty of ln E* from this recording alone. [1]
    sensitivity : ndarray, shape (4,) or (1,)
        d ln E* / d ln(M, k, mu, c) for KV, d ln E* / d ln S for HSD: how E* follows an error of
        the calibration.
    u_calibration : float
        Standard uncertainty of ln E* from the calibration, used where no covariance of the cell is
        at hand; then counted as one error common to all observations of a calibration. [1]
    calibration : str
        Which calibration; observations of different ones have different common errors.
    inputs : dict of float
        Standard uncertainty of ln E*, with its sign, from each stated mass, radius and the like, by
        name: one error common to all observations that name it. With the cell's values held: what
        the same error did to the calibration is added by the network. [1]
    input_u : dict of float
        Standard uncertainty of each input as the fit took it: relative, of an offset of heights in
        mm.
    """

    sphere: str
    surface: str
    log_reduced_modulus: float
    u_random: float
    sensitivity: Array
    shot: str
    model: str
    u_calibration: float = 0.0
    calibration: str = ""
    inputs: Mapping[str, float] = field(default_factory=dict)
    input_u: Mapping[str, float] = field(default_factory=dict)

    @property
    def pair(self) -> str:
        """Return the pair's key."""
        return f"{self.sphere}/{self.surface}"


def observations_from_fit(
    fit: FitResult | Json, *, shot: str, calibration: str = ""
) -> tuple[PairObservation, ...]:
    """Return what a fit says about each of its pairs.

    Parameters
    ----------
    fit : FitResult or dict
        A fit with ``by_pair=True`` (else the fit has already used the references' moduli, which
        the network would use again), or its JSON.
    calibration : str
        Which calibration the cell's values came from.

    Returns
    -------
    tuple of PairObservation
        Empty where the fit did not converge or is in reduced units.
    """
    found: Json = fit if isinstance(fit, dict) else fit.to_json()
    if found["outcome"]["status"] != "converged":
        return ()
    observations = []
    for entry in found["pairs"].values():
        modulus = entry.get("reduced_modulus_Pa")
        if not modulus:
            continue
        value = float(modulus["value"])
        u, u_cell = float(modulus["u"]) / value, float(entry["u_calibration_Pa"]) / value
        # fits of earlier versions took every stated number as exact
        known = entry.get("inputs") or {}
        input_u = {name: float(one["u"]) for name, one in known.items()}
        whole = [float(one["d_ln_reduced_modulus_d_input"] * one["u"]) for one in known.values()]
        own = u**2 - u_cell**2 - sum(part**2 for part in whole)
        # the network itself follows what an input did to the calibration
        stated = {
            name: part - float(one.get("through_calibration", 0.0) * one["u"])
            for (name, one), part in zip(known.items(), whole, strict=True)
        }
        by_field = entry["d_ln_reduced_modulus_d_ln_sensor"]
        fields = HSD_FIELDS if HSD_FIELDS[0] in by_field else SENSOR_FIELDS
        observations.append(
            PairObservation(
                sphere=str(entry["sphere"]),
                surface=str(entry["surface"]),
                log_reduced_modulus=math.log(value),
                u_random=math.sqrt(max(own, 1e-12)),
                sensitivity=np.array([float(by_field[name]) for name in fields]),
                shot=shot,
                model=str(found["model"]),
                u_calibration=u_cell,
                calibration=calibration,
                inputs=stated,
                input_u=input_u,
            )
        )
    return tuple(observations)


def observation_from_fit(
    fit: FitResult | Json, *, shot: str, calibration: str = ""
) -> PairObservation | None:
    """Return what a fit of one shot says about its pair.

    None where the fit did not converge or is in reduced units. ``shot`` and ``calibration`` are as
    for `observations_from_fit`.
    """
    found = observations_from_fit(fit, shot=shot, calibration=calibration)
    return found[0] if found else None
