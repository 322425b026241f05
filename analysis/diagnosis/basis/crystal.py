"""A force on the cell, read through its crystal."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.model.impact_model import ImpactModel

Array = NDArray[np.float64]
Crystal = tuple[float, float]
"""Angular frequency [rad/s] and damping ratio [1]."""


def through_crystal(force: Array, rate: float, crystal: Crystal) -> Array:
    """Return how far a crystal is compressed by a force, a steady force of one by one.

    Parameters
    ----------
    force : ndarray, shape (n,) or (n, q)
        Over time along axis 0. [any]
    rate : float
        Sampling rate. [Hz]
    crystal : tuple
        Angular frequency and damping ratio. [rad/s, 1]

    Returns
    -------
    ndarray, shape (n,) or (n, q)
        A force is felt from the next sample on. [unit of the force]
    """
    angle, zeta = crystal[0] / rate, crystal[1]
    pole = np.exp((-zeta + 1j * math.sqrt(max(1.0 - zeta**2, 0.0))) * angle)
    turn = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    return np.asarray(lfilter([0.0, sum(turn)], turn, force, axis=0))


def crystal_of(model: ImpactModel, local: Array) -> Crystal | None:
    """Return the crystal's angular frequency [rad/s] and damping ratio; None of a rigid cell.

    Parameters
    ----------
    model : ImpactModel
        The model.
    local : ndarray, shape (p,)
        A shot's local parameters.

    Returns
    -------
    tuple or None
        As `through_crystal` takes it.
    """
    if "ln_w" not in model.shared:
        return None
    frequency, damping = (math.exp(local[model.shared.index(n)]) for n in ("ln_w", "ln_z"))
    return frequency, damping
