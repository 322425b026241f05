"""Priors of a fit as Gaussians on logarithms: the cell's certificate, stated moduli."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import UNKNOWN_POISSONS_RATIO, Quantity, Sensor
from analysis.model.hertz import plane_strain_modulus
from analysis.parameters import of_rebound

SEEN = of_rebound("seen_ms")
SEEN_U_MS = 3.0
"""Nobody says when a rebound was seen; camera frames and record lengths are of this order."""
SEEN_NEEDS_SHOTS = 6
"""Fewer stated restitutions cannot tell the delay from the restitution itself."""

LEAST_RELATIVE_U = 1e-6
"""What is exact is known as well as this: normal equations have to stay solvable in doubles."""

UNKNOWN_LOG_U = 4.0
"""Width that only keeps an undetermined logarithm finite; e^4 either way is no information."""


@dataclass(frozen=True)
class Prior:
    """A Gaussian on one global parameter."""

    mean: float
    u: float


def sensor_transform() -> NDArray[np.float64]:
    """Return T with ln(M, k, mu, c) = T ln(S, w, z, M) + (0, 0, ln 2, 0). Shape (4, 4)."""
    return np.array([[0, 0, 0, 1], [0, 2, 0, 1], [0, 1, 1, 1], [1, -2, 0, -1]], dtype=float)


SENSOR_OFFSET = np.array([0.0, 0.0, math.log(2.0), 0.0])
SENSOR_FIELDS = (
    "crystal_mass_kg",
    "crystal_stiffness_n_per_m",
    "crystal_damping_n_s_per_m",
    "compliance_m_per_v",
)


def sensor_prior(sensor: Sensor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what is known of M, k, mu, c as a Gaussian on ln(S, w, z, M), in information form.

    The inverse covariance, shape (4, 4), and its product with the mean. Each known quantity counts
    by its ``u``, or all four by their covariance.
    """
    transform = sensor_transform()
    known = [getattr(sensor, name) for name in SENSOR_FIELDS]
    logs = np.array([math.log(q.value) if q else 0.0 for q in known]) - SENSOR_OFFSET
    if sensor.covariance is not None and all(known):
        inner = np.linalg.inv(sensor.covariance)
    else:
        relative = [max(q.u / q.value, LEAST_RELATIVE_U) if q else math.inf for q in known]
        inner = np.diag([r**-2 for r in relative])
    precision = transform.T @ inner @ transform
    return precision, transform.T @ inner @ logs


def modulus_prior(modulus: Quantity | None, ratio: Quantity | None) -> Prior | None:
    """Return the prior on ln E' of a material with a stated Young's modulus [Pa].

    None if the modulus is to be found. An unknown Poisson's ratio counts as 0.35 +- 0.1.
    """
    if modulus is None:
        return None
    nu = ratio or UNKNOWN_POISSONS_RATIO
    u_nu = 2 * nu.value * nu.u / (1 - nu.value**2)
    u = math.hypot(modulus.u / modulus.value, u_nu)
    return Prior(math.log(plane_strain_modulus(modulus.value, nu.value)), max(u, LEAST_RELATIVE_U))
