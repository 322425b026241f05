r"""From reduced moduli of pairs to moduli of materials: a network of spheres and surfaces.

A contact shows only

.. math:: 1/E^*_{ij} = 1/E'_i + 1/E'_j, \quad E' = E / (1 - \nu^2),

which is additive, so pairs that hang together and contain a reference material fix every
plane-strain modulus. All observations, the stated moduli of the references and the common error of
each calibration are adjusted together, in logarithms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis import moduli_checks
from analysis.campaign import Sphere, Surface
from analysis.errors import AnalysisError
from analysis.moduli_network import (
    CalibrationInputs,
    SensorCovariance,
    System,
    build,
    grouped,
    solve,
)
from analysis.moduli_result import ModuliResult
from analysis.pair_observation import (
    PairObservation,
    observation_from_fit,
    observations_from_fit,
)

__all__ = [
    "Adjustment",
    "ModuliResult",
    "PairObservation",
    "adjust_moduli",
    "adjust_network",
    "observation_from_fit",
    "observations_from_fit",
]


@dataclass(frozen=True)
class Adjustment:
    """An adjusted network with its equations."""

    result: ModuliResult
    system: System
    """Its equations, dark uncertainty included."""
    random_share: NDArray[np.float64]
    """Share of each observation's random variance that its own fit stated; the rest is dark. Shape
    (rows,). [1]"""
    covariance: NDArray[np.float64]
    """Of all columns of ``system``. Shape (n + c, n + c)."""
    input_u: Mapping[str, float]
    """Standard uncertainty of each stated input, as the latest fit took it; see
    `PairObservation`."""


def adjust_moduli(
    observations: Sequence[PairObservation],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
    sensor_covariance: SensorCovariance | None = None,
    calibrated_by: Mapping[str, CalibrationInputs] | None = None,
) -> ModuliResult:
    """Return every material's modulus from the reduced moduli of pairs; see `adjust_network`."""
    found = adjust_network(observations, spheres, surfaces, sensor_covariance, calibrated_by)
    return found.result


def adjust_network(
    observations: Sequence[PairObservation],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
    sensor_covariance: SensorCovariance | None = None,
    calibrated_by: Mapping[str, CalibrationInputs] | None = None,
) -> Adjustment:
    """Return every material's modulus from the reduced moduli of pairs, and the equations.

    Parameters
    ----------
    observations : sequence of PairObservation
        At least one, all of one model.
    spheres, surfaces : mapping
        By name; a stated modulus makes a material a reference of that width.
    sensor_covariance : ndarray, shape (4, 4) or (1, 1), or mapping of calibration to such, optional
        Covariance of ln(M, k, mu, c), or of ln S for HSD. Without it each observation's
        ``u_calibration`` counts as one error common to its calibration. Either way the
        calibration's uncertainty is not averaged away.
    calibrated_by : mapping of calibration to mapping, optional
        Change of ln(M, k, mu, c), or of ln S, by one u of each input that the calibration rests on:
        a sphere whose mass is wrong spoils the calibration and the shots in one.

    Raises
    ------
    AnalysisError
        If there is no observation, a material is unknown, or models are mixed.

    Notes
    -----
    Source: Eq. 4; generalised least squares with the common errors as parameters. Contradicting
    pairs are named and kept; what they spoil is carried as an uncertainty of every recording.
    Validation: ``tests/analysis/test_moduli.py``.
    """
    if not observations:
        raise AnalysisError("There is no reduced modulus to adjust; fit some shots first.")
    models = sorted({o.model for o in observations})
    if len(models) > 1:
        raise AnalysisError(
            f"Reduced moduli of different models ({', '.join(models)}) cannot be adjusted together;"
            " choose one."
        )
    system = build(observations, spheres, surfaces, sensor_covariance, calibrated_by)
    checks, contradicting = moduli_checks.snoop(system)
    as_stated = moduli_checks.consistency(system)
    stated = system.weight
    system, dark_u = moduli_checks.with_dark_uncertainty(system)
    x, covariance = solve(system, grouped(system))
    n = len(system.names)
    result = ModuliResult(
        model=models[0],
        names=tuple(system.names),
        log_plane_strain=x[:n],
        covariance=covariance[:n, :n],
        network=as_stated,
        dark_u=dark_u,
        checks=checks,
        contradicting=contradicting,
        anchored=tuple(moduli_checks.anchored(system)),
        spheres=dict(spheres),
        surfaces=dict(surfaces),
        shots=tuple(dict.fromkeys(o.shot for o in observations)),
        calibrations=tuple(sorted({o.calibration for o in observations if o.calibration})),
    )
    return Adjustment(
        result=result,
        system=system,
        random_share=system.weight / stated,
        covariance=covariance,
        input_u={name: u for o in observations for name, u in o.input_u.items()},
    )
