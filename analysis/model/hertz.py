"""Hertz contact of a sphere on a flat: moduli, stiffness, damping, time scales.

Equation numbers are those of Maranzano & Hancock 2016 [1]_ unless another source is named.

References
----------
.. [1] B. J. Maranzano, B. C. Hancock, Sensing and Bio-Sensing Research 7 (2016) 31-37.
.. [2] K. L. Johnson, Contact Mechanics (1985), ch. 4 and 11.4.
.. [3] D. Antypov, J. A. Elliott, EPL 94 (2011) 50004.
.. [4] T. Schwager, T. Poeschel, Granular Matter 9 (2007) 465-469.
"""

from __future__ import annotations

import math
from functools import lru_cache

from analysis.errors import ParameterOutOfRangeError

_NEWTON_STEPS = 60
_NEWTON_TOLERANCE = 4e-16
_SERIES_BELOW = 1e-4
"""Distance from critical damping where a series replaces 0/0; its next term is 1e-17."""

CONTACT_TIME_FACTOR = 2.943275
"""Elastic contact time over ``delta_max / v0``: 2 * integral of 1/sqrt(1 - x^2.5) on [0, 1]."""


def plane_strain_modulus(youngs_modulus_pa: float, poissons_ratio: float) -> float:
    r"""Return the plane-strain modulus of one material. [Pa]

    .. math:: E' = E / (1 - \nu^2)

    Parameters
    ----------
    poissons_ratio : float
        Poisson's ratio, -1 < nu < 0.5 (0.5 allowed). [1]

    Raises
    ------
    ParameterOutOfRangeError
        If the modulus is not positive or the ratio is outside [-1, 0.5].

    Notes
    -----
    Source: [2]_. Validation: ``tests/analysis/model/test_hertz.py``.
    """
    if not youngs_modulus_pa > 0:
        raise ParameterOutOfRangeError("youngs_modulus_pa", youngs_modulus_pa, "positive")
    if not -1 < poissons_ratio <= 0.5:
        raise ParameterOutOfRangeError("poissons_ratio", poissons_ratio, "between -1 and 0.5")
    return youngs_modulus_pa / (1 - poissons_ratio**2)


def reduced_modulus(sphere_plane_strain_pa: float, surface_plane_strain_pa: float) -> float:
    """Return the reduced modulus of two bodies in contact from their plane-strain moduli. [Pa]

    .. math:: 1/E^* = 1/E'_1 + 1/E'_2

    Notes
    -----
    Source: the bracket of Eq. 4 of [1]_.
    """
    return 1.0 / (1.0 / sphere_plane_strain_pa + 1.0 / surface_plane_strain_pa)


def contact_stiffness(reduced_modulus_pa: float, radius_m: float) -> float:
    r"""Return Hertz's stiffness.

    .. math:: K = \tfrac43 \sqrt{R}\, E^*

    Returns
    -------
    float
        K of ``F_el = K delta^(3/2)``. [N m^-1.5]

    Notes
    -----
    Source: Eq. 4 of [1]_.
    """
    if not radius_m > 0:
        raise ParameterOutOfRangeError("radius_m", radius_m, "positive")
    return 4.0 / 3.0 * math.sqrt(radius_m) * reduced_modulus_pa


def damping_coefficient(restitution: float) -> float:
    r"""Return the dashpot coefficient that gives a rigid-cell contact this restitution.

    .. math:: \alpha = -\sqrt5 \ln\epsilon / \sqrt{\ln^2\epsilon + \pi^2}

    Parameters
    ----------
    restitution : float
        Rebound over impact rate of indentation, 0 < eps; above 1 the contact would gain energy,
        which a noisy fit may pass through and a result must not keep. [1]

    Returns
    -------
    float
        alpha of ``F_dis = alpha sqrt(m K) delta^(1/4) delta'``. [1]

    Raises
    ------
    ParameterOutOfRangeError
        If ``restitution`` is not positive.

    Notes
    -----
    Source: Eq. 5 of [1]_, derived in [3]_. Validation: integrating HSD with it returns eps.
    """
    if not restitution > 0:
        raise ParameterOutOfRangeError("restitution", restitution, "positive")
    log = math.log(restitution)
    return -math.sqrt(5) * log / math.hypot(log, math.pi)


def _arc_ratio(damping_ratio: float) -> tuple[float, float]:
    """Return a = psi / sin psi with cos psi the damping ratio (cosh beyond 1), and d(gamma a)."""
    e = 1.0 - damping_ratio
    if abs(e) < _SERIES_BELOW:
        arc = 1.0 + e / 3 + 2 * e**2 / 15 + 2 * e**3 / 35
        return arc, (4 / 3 + 2 * e / 15 + 2 * e**2 / 35) / (1.0 + damping_ratio)
    rest = e * (1.0 + damping_ratio)
    root = math.sqrt(abs(rest))
    arc = (math.acos(damping_ratio) if rest > 0.0 else math.acosh(damping_ratio)) / root
    return arc, (arc - damping_ratio) / rest


@lru_cache(maxsize=1024)
def closed_damping_coefficient(restitution: float) -> float:
    r"""Return the dashpot coefficient where the contact ends when its force does.

    .. math:: \alpha = \sqrt5 \cos\psi, \quad \ln\epsilon = -2 \psi \cot\psi

    Parameters
    ----------
    restitution : float
        Rebound over impact rate of indentation on a rigid cell, the rebound taken where
        F_el + F_dis is zero. Above 1, where no force pulls, Eq. 5 itself. [1]

    Returns
    -------
    float
        alpha of ``F_dis = alpha sqrt(m K) delta^(1/4) delta'``. [1]

    Raises
    ------
    ParameterOutOfRangeError
        If ``restitution`` is not positive.

    Notes
    -----
    With z = delta^(5/4) and d(theta) = delta^(1/4) dt the contact is a damped linear oscillator of
    damping ratio gamma = alpha / sqrt(5) [3]_. Its force is zero where z'' is, after
    omega theta = 2 psi, gamma = cos(psi): [4]_ for the linear dashpot, in one formula that holds
    beyond critical damping too (psi imaginary). gamma psi / sin(psi) is concave in gamma, so that
    Newton's steps from Eq. 5's side never pass the root. Gravity is left out, as in Eq. 5.
    Validation: ``tests/analysis/model/test_closed.py`` integrates it back.
    """
    if not 0.0 < restitution < 1.0:
        return damping_coefficient(restitution)
    wanted = -0.5 * math.log(restitution)
    ratio = 2.0 * wanted / math.pi
    for _ in range(_NEWTON_STEPS):
        arc, slope = _arc_ratio(ratio)
        step = (wanted - ratio * arc) / slope
        ratio += step
        if abs(step) <= _NEWTON_TOLERANCE * ratio:
            break
    return math.sqrt(5) * ratio


def contact_time(stiffness: float, mass_kg: float, speed_m_per_s: float) -> float:
    r"""Return the duration of a loss-free Hertz contact on a rigid cell. [s]

    .. math:: t_c = 2.9433\, \delta_{max}/v_0, \quad \delta_{max} = (5 m v_0^2 / 4K)^{2/5}

    Notes
    -----
    Source: [2]_, Eq. 11.24. Validation: against the integrated model in the limit eps = 1.
    """
    depth: float = (1.25 * mass_kg * speed_m_per_s**2 / stiffness) ** 0.4
    return CONTACT_TIME_FACTOR * depth / speed_m_per_s


def peak_force(stiffness: float, mass_kg: float, speed_m_per_s: float) -> float:
    """Return the largest force of a loss-free Hertz contact on a rigid cell. [N]

    Notes
    -----
    Source: energy balance, ``2/5 K delta_max^(5/2) = m v0^2 / 2``.
    """
    return float(stiffness * (1.25 * mass_kg * speed_m_per_s**2 / stiffness) ** 0.6)
