"""Forces and parameters of the model: what contact, crystal and cell could do otherwise.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``contact``     a contact force K delta^(3/2) (delta/d)^i (rate/v)^j, on sphere and cell
``loss``        the same on the sphere alone
``seat``        a force on the crystal that is no straight function of its motion
``cell``        the cell's own four numbers, where they change with surface, shot or time
``gain``        the cell's gain
``pitch``       the cell's frequency and damping
``stiffness``   the stiffness of the contact
==============  ====================================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.diagnosis.basis.scale import Scale
from analysis.effects.probe import probe
from analysis.fit.problem import FitShot
from analysis.model.impact_model import SHARED, ImpactModel

Array = NDArray[np.float64]

Crystal = tuple[float, float]
"""Angular frequency [rad/s] and damping ratio [1]."""
CONTACT_POWERS = ((-1.0, 0), (-0.5, 0), (0.5, 0), (1.0, 0), (-1.0, 1), (0.0, 1), (0.5, 1), (0.0, 2))
_SMALL = 2e-3
"""Share of the contact force at which a derivative is taken."""
SLIDING = 0.01
"""Speed, in crystal's frequency times largest compression, at which dry friction is at its most."""
CHANGE = 0.05
"""Relative change of a parameter that a coefficient of one stands for."""
OF_PARAMETERS = {"gain": ("ln_S",), "pitch": ("ln_w", "ln_z"), "stiffness": ("ln_K",)}
"""Families that are changes of the model's own parameters."""


def contact_labels(*, sphere_only: bool) -> list[str]:
    """Return the labels of the contact family."""
    where = "sphere" if sphere_only else "both"
    return [f"delta^{i:g} rate^{j} on {where}" for i, j in CONTACT_POWERS]


def contact_columns(
    model: ImpactModel, local: Array, item: FitShot, scale: Scale, *, sphere_only: bool
) -> tuple[Array, Array]:
    """Return signal and rebound per unit of each contact power, by a small forward difference.

    Parameters
    ----------
    model : ImpactModel
        The fitted model.
    local : ndarray, shape (p,)
        The shot's fitted local parameters.
    item : FitShot
        The shot.
    scale : Scale
        Common sizes.
    sphere_only : bool
        Whether the force spares the cell.

    Returns
    -------
    signal : ndarray, shape (n, q)
        Per unit coefficient.
    rebound : ndarray, shape (q,)
        Per unit coefficient.
    """
    steps = model.steps(local, item.frame)
    start = model.with_effect(probe(0.0, 0.0, 0, sphere_only=sphere_only))
    base = start.predict(local, item.frame, steps=steps)
    columns, rebounds = [], []
    for i, j in CONTACT_POWERS:
        size = scale.indentation_m ** (-i) * scale.speed_m_per_s ** (-j)
        moved = model.with_effect(probe(_SMALL * size, i, j, sphere_only=sphere_only))
        found = moved.predict(local, item.frame, steps=steps)
        columns.append((found.signal - base.signal) / _SMALL)
        rebounds.append((found.rebound_ratio - base.rebound_ratio) / _SMALL)
    return np.column_stack(columns), np.array(rebounds)


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


def mount_columns(
    signal: Array, rate: float, top: float, crystal: Crystal
) -> tuple[list[str], Array]:
    """Return what a crystal adds whose spring or damper is not linear, to first order.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's, which is the crystal's compression. [unit of the signal]
    rate : float
        Sampling rate. [Hz]
    top : float
        Largest signal of the campaign. [unit of the signal]
    crystal : tuple
        Angular frequency and damping ratio. [rad/s, 1]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 8)
        Forces of second and third order in the motion, through the crystal's own resonance.
        [unit of the signal]
    """
    x = signal / top
    v = np.gradient(x) * rate / crystal[0]
    slow = v / np.sqrt(np.square(v) + SLIDING**2)
    forces = {
        "x^2": x * x, "x^3": x**3, "|x|": np.abs(x), "v^2": v * v, "x v": x * v,
        "v |v|": v * np.abs(v), "v |x|": v * np.abs(x), "dry": SLIDING * slow,
    }  # fmt: skip
    all_forces = 0.1 * top * np.column_stack(list(forces.values()))
    return [f"crystal force {name}" for name in forces], through_crystal(all_forces, rate, crystal)


def cell_names(model: ImpactModel) -> list[str]:
    """Return the cell's parameters among a model's shared ones."""
    return [n for n in SHARED[model.kind] if n != "ln_K"]


def parameter_columns(family: str, model: ImpactModel, jacobian: Array) -> tuple[list[str], Array]:
    """Return a change of the model's own parameters as columns. Labels and shape (n, q)."""
    names = [n for n in OF_PARAMETERS[family] if n in model.shared]
    return names, CHANGE * jacobian[:, [model.shared.index(n) for n in names]]
