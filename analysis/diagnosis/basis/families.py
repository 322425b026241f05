"""A shot's columns by the name of their family."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.contact_force import (
    OF_PARAMETERS,
    cell_names,
    contact_columns,
    contact_labels,
    crystal_of,
    mount_columns,
    parameter_columns,
)
from analysis.diagnosis.basis.dynamic_curve import (
    SLEW,
    droop_columns,
    dynamic_columns,
    slope_columns,
    warmth_columns,
)
from analysis.diagnosis.basis.event import (
    LATE_IMPACT,
    jump_columns,
    late_impact_columns,
    late_impact_shape,
)
from analysis.diagnosis.basis.linear_filter import (
    creep_columns,
    impulse_columns,
    response_columns,
    slow_columns,
)
from analysis.diagnosis.basis.modulation import (
    alternate_columns,
    baseline_columns,
    piece_columns,
    wander_columns,
)
from analysis.diagnosis.basis.oscillation import DAMPED, MODE_ZETA, TUNED, tuned_columns
from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.static_curve import (
    RIPPLE,
    curve_columns,
    fine_columns,
    path_columns,
    ripple_columns,
    static_columns,
)
from analysis.diagnosis.basis.waveform import (
    BUMPS_US,
    TEMPLATES,
    locked_columns,
    template_columns,
)
from analysis.fit.problem import FitShot
from analysis.model.impact_model import ImpactModel

Array = NDArray[np.float64]

Columns = tuple[list[str], Array, Array | None, Array | None]
"""Labels, signal, and where there are any: change of the rebound, of the promised ln v0."""

TOUCH_DOWN, BASELINE = 2, 3
"""Places among a shot's own parameters."""


@dataclass(frozen=True)
class View:
    """One shot as the present model sees it.

    Attributes
    ----------
    model : ImpactModel
        The model.
    item : FitShot
        The shot.
    local : ndarray, shape (p,)
        Its local parameters.
    clean : ndarray, shape (n,)
        The model's signal without the baseline. [unit of the signal]
    jacobian : ndarray, shape (n, p)
        Of the signal.
    scale : Scale
        Of the campaign.
    """

    model: ImpactModel
    item: FitShot
    local: Array
    clean: Array
    jacobian: Array
    scale: Scale

    @property
    def rate(self) -> float:
        """Return the sampling rate. [Hz]"""
        return self.item.frame.sample_rate_hz

    @property
    def touch_down_us(self) -> float:
        """Return when the contact begins, after the window. [us]"""
        return float(self.local[len(self.model.shared) + TOUCH_DOWN])

    @property
    def contact_us(self) -> float:
        """Return how long the contact lasts by Hertz. [us]"""
        return 1e6 * hertz_time_s(self.item, self.local, len(self.model.shared))


def _locked(view: View) -> Columns:
    peak = view.item.window.peak
    return (
        *locked_columns(view.clean.size, view.rate, view.touch_down_us, peak, BUMPS_US),
        None,
        None,
    )


def _template(view: View, family: str) -> Columns:
    labels, columns = template_columns(
        view.clean.size,
        view.rate,
        view.touch_down_us,
        view.item.window.peak,
        family=family,
        contact_us=view.contact_us,
        usual_us=1e6 * view.scale.contact_s,
    )
    return labels, columns, None, None


def _force(view: View, *, sphere_only: bool) -> Columns:
    signal, rebound = contact_columns(
        view.model, view.local, view.item, view.scale, sphere_only=sphere_only
    )
    return contact_labels(sphere_only=sphere_only), signal, rebound, None


def _cell(view: View) -> Columns:
    names = cell_names(view.model)
    places = [view.model.shared.index(n) for n in names]
    return names, 0.1 * view.jacobian[:, places], None, None


def _speed(view: View) -> Columns:
    return ["speed"], np.zeros((view.clean.size, 1)), None, np.array([0.1])


def _mount(view: View) -> Columns:
    crystal = crystal_of(view.model, view.local)
    if crystal is None:
        return [], np.zeros((view.clean.size, 0)), None, None
    return *mount_columns(view.clean, view.rate, view.scale.top, crystal), None, None


def _residual(view: View) -> Array:
    baseline = view.local[len(view.model.shared) + BASELINE]
    return np.asarray(view.item.window.signal - view.clean - baseline)


def _jump(view: View) -> Columns:
    first = sample_at(view.touch_down_us, view.rate, view.clean.size)
    return *jump_columns(view.clean, _residual(view), first), None, None


def _late_impact(view: View) -> Columns:
    first = sample_at(view.touch_down_us + view.contact_us, view.rate, view.clean.size)
    shape = late_impact_shape(
        view.scale.late_impact_us, view.rate, crystal_of(view.model, view.local)
    )
    size = view.item.window.peak
    return *late_impact_columns(_residual(view), first, view.rate, shape, size), None, None


OF_SIGNAL: dict[str, Callable[[Array, float, Scale], tuple[list[str], Array]]] = {
    "creep": creep_columns,
    "slow": slow_columns,
    "curve": curve_columns,
    "fine": fine_columns,
    "path": path_columns,
    "impulse": impulse_columns,
    "droop": droop_columns,
    "warmth": warmth_columns,
    "alternate": alternate_columns,
    "baseline": baseline_columns,
}
"""Families that are functions of the model's signal alone."""

_BY_NAME: dict[str, Callable[[View], Columns]] = {
    "response": lambda v: (*response_columns(v.clean, v.rate), None, None),
    "static": lambda v: (*static_columns(v.clean, v.scale), None, None),
    "dynamic": lambda v: (*dynamic_columns(v.clean, v.rate, v.scale), None, None),
    "locked": _locked,
    "contact": lambda v: _force(v, sphere_only=False),
    "loss": lambda v: _force(v, sphere_only=True),
    "cell": _cell,
    "speed": _speed,
    "seat": _mount,
    "jump": _jump,
    LATE_IMPACT: _late_impact,
    SLEW: lambda v: (*slope_columns(v.clean, v.rate, v.scale.steepest_per_s), None, None),
    RIPPLE: lambda v: (*ripple_columns(v.clean, v.scale.top, v.scale.ripples), None, None),
    "pieces": lambda v: (
        *piece_columns(v.clean, v.rate, v.touch_down_us, v.contact_us), None, None
    ),
    "wander": lambda v: (*wander_columns(v.clean, v.rate, v.touch_down_us), None, None),
}  # fmt: skip


def family_columns(view: View, family: str) -> Columns:
    """Return one family's columns of one shot.

    Parameters
    ----------
    view : View
        The shot.
    family : str
        Any that a module of this folder makes.

    Returns
    -------
    tuple
        Labels, signal of shape (n, q) [unit of the signal], and where there are any the changes of
        the rebound ratio and of the promised ln v0, of shape (q,).
    """
    if family in TEMPLATES:
        return _template(view, family)
    if family in TUNED or family == DAMPED:
        frequency = view.scale.tuned_hz[family]
        zeta = view.scale.tuned_zeta if family == DAMPED else MODE_ZETA
        labels = [f"{family} {frequency:.0f} Hz {part}" for part in ("cos", "sin")]
        return labels, tuned_columns(family, view.clean, view.rate, frequency, zeta), None, None
    if family in OF_SIGNAL:
        return *OF_SIGNAL[family](view.clean, view.rate, view.scale), None, None
    if family in OF_PARAMETERS:
        return *parameter_columns(family, view.model, view.jacobian), None, None
    return _BY_NAME[family](view)


def hertz_time_s(item: FitShot, local: Array, speed_at: int) -> float:
    """Return how long an elastic contact of this shot lasts. [s]

    Notes
    -----
    Source: Hertz; K. L. Johnson, Contact Mechanics (1985), 11.4. Only a scale of time here.
    """
    stiffness, speed = math.exp(local[0]), math.exp(local[speed_at])
    depth = (1.25 * item.frame.mass_kg * speed**2 / stiffness) ** 0.4
    return float(2.94 * depth / speed)


def sample_at(time_us: float, rate: float, samples: int) -> int:
    """Return the sample at a time, the first or the last where it lies outside.

    Parameters
    ----------
    time_us : float
        After the window's first sample. [us]
    rate : float
        Sampling rate. [Hz]
    samples : int
        Of the window.

    Returns
    -------
    int
        Between 0 and ``samples - 1``.
    """
    return min(max(round(time_us * 1e-6 * rate), 0), samples - 1)
