"""The basis columns of a shot by family, and their units.

==============  ====================================================================================
family          what it can take up, beside those of the other modules
==============  ====================================================================================
``cell``        the cell's own four numbers, where they change with surface, shot or time
``gain``        the cell's gain
``pitch``       the cell's frequency and damping
``stiffness``   the stiffness of the contact
``speed``       an impact speed that is not the one of the drop height
==============  ====================================================================================
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.basis import linear_filter, nonlinearity, time_course
from analysis.diagnosis.basis.linear_filter import DAMPED, MODE_ZETA, TUNED, Crystal, Labelled
from analysis.diagnosis.basis.nonlinearity import RIPPLE, SLEW
from analysis.diagnosis.basis.time_course import LATE_IMPACT
from analysis.fit.joint import Fitted
from analysis.fit.problem import FitShot, JointProblem
from analysis.model.impact_model import SHARED, ImpactModel

TOUCH_DOWN, BASELINE = 2, 3
"""Places among a shot's own parameters."""
CHANGE = 0.05
"""Relative change of a parameter that a coefficient of one stands for: of the order by which a gain
or a stiffness is wrong, as the ridge on coefficients expects. The cell's four take twice that."""
CONTACTS_S = (3e-5, 7.5e-4)
"""Shortest and longest pulse for which the columns' knots, memories and frequencies are as written.
They were chosen for pulses of 50 to 500 us; those of a shorter or longer one are as much shorter or
longer as it is beyond these limits."""
TUNED_BY = 3
"""One shot in so many is asked for a frequency or a width, which all share. A choice of time."""


@dataclass(frozen=True)
class Scale:
    """Sizes common to a campaign, so that a column means the same in every shot."""

    top: float
    """Largest signal of all shots. [unit of the signal]"""
    indentation_m: float
    """Median of the largest, as of speed and Hertz's contact time."""
    speed_m_per_s: float
    contact_s: float
    pace: float = 1.0
    """Seconds that stand for a second of the columns' knots, memories and frequencies: 1 unless the
    pulses are beyond `CONTACTS_S`. All times below, and those of a `View`, are so many times less,
    rates and frequencies as many times more."""
    tuned_hz: dict[str, float] = field(default_factory=dict)
    """Frequency by family; this and all below is looked for in the records."""
    tuned_zeta: float = 0.0
    """Damping ratio of the one whose damping is looked for as well."""
    ripples: float = 0.0
    """Periods of a curve's ripple between zero and the top."""
    steepest_per_s: float = 0.0
    """Largest slope. [unit of the signal/s]"""
    late_impact_us: float = 0.0
    """Width of a late impact after the impact."""


@dataclass(frozen=True)
class View:
    """One shot as the present model sees it."""

    model: ImpactModel
    item: FitShot
    local: Array
    """Local parameters, shape (p,)."""
    clean: Array
    """The model's signal without the baseline, shape (n,). [unit of the signal]"""
    jacobian: Array
    """Of the signal, shape (n, p)."""
    scale: Scale

    @property
    def rate(self) -> float:
        """Return the sampling rate in the columns' time, as all that follows. [Hz]"""
        return self.item.frame.sample_rate_hz * self.scale.pace

    @property
    def touch_down_us(self) -> float:
        """Return when the contact begins, after the window. [us]"""
        return float(self.local[len(self.model.shared) + TOUCH_DOWN]) / self.scale.pace

    @property
    def contact_us(self) -> float:
        """Return how long the contact lasts by Hertz. [us]"""
        return 1e6 * _hertz(self.item, self.local, len(self.model.shared))[1] / self.scale.pace

    @property
    def residual(self) -> Array:
        """Return what the model leaves of the record. [unit of the signal]"""
        baseline = self.local[len(self.model.shared) + BASELINE]
        return np.asarray(self.item.window.signal - self.clean - baseline)

    def sample_at(self, time_us: float) -> int:
        """Return the sample at a time after the window, the first or the last beyond it."""
        return min(max(round(time_us * 1e-6 * self.rate), 0), self.clean.size - 1)

    @property
    def lift_off(self) -> int:
        """Return the sample at which the contact ends."""
        return self.sample_at(self.touch_down_us + self.contact_us)

    @property
    def crystal(self) -> Crystal | None:
        """Return the angular frequency [rad/s] and damping ratio; None of a rigid cell."""
        shared = self.model.shared
        if "ln_w" not in shared:
            return None
        frequency, zeta = shared.index("ln_w"), shared.index("ln_z")
        return math.exp(self.local[frequency]) * self.scale.pace, math.exp(self.local[zeta])


def _hertz(item: FitShot, local: Array, speed_at: int) -> tuple[float, float]:
    """Return depth [m] and duration [s] of an elastic contact of this shot; only scales here.

    Source: Hertz; K. L. Johnson, Contact Mechanics (1985), 11.4.
    """
    stiffness, speed = math.exp(local[0]), math.exp(local[speed_at])
    depth = (1.25 * item.frame.mass_kg * speed**2 / stiffness) ** 0.4
    return depth, 2.94 * depth / speed


def _outline(view: View) -> Labelled:
    times = view.clean.size, view.rate, view.touch_down_us
    usual_us = 1e6 * view.scale.contact_s / view.scale.pace
    return time_course.outline_columns(times, view.item.window.peak, view.contact_us, usual_us)


def _force(view: View, *, sphere_only: bool) -> Labelled:
    sizes = view.scale.indentation_m, view.scale.speed_m_per_s
    return nonlinearity.contact_columns(
        view.model, view.local, view.item, sizes, sphere_only=sphere_only
    )


def _parameters(view: View, names: Sequence[str], change: float) -> Labelled:
    """Return a relative change of the model's own parameters, those that it has."""
    own = [n for n in names if n in view.model.shared]
    return own, change * view.jacobian[:, [view.model.shared.index(n) for n in own]]


def _late_impact(view: View) -> Labelled:
    shape = time_course.late_impact_shape(view.scale.late_impact_us, view.rate, view.crystal)
    return time_course.late_impact_columns(
        view.residual, view.lift_off, view.rate, shape, view.item.window.peak
    )


def _tuned(view: View, family: str) -> Labelled:
    frequency = view.scale.tuned_hz[family]
    zeta = view.scale.tuned_zeta if family == DAMPED else MODE_ZETA
    seen_hz = frequency / view.scale.pace
    told = f"{seen_hz:.0f}" if view.scale.pace == 1.0 else f"{seen_hz:.3g}"
    labels = [f"{family} {told} Hz {part}" for part in ("cos", "sin")]
    return labels, linear_filter.tuned_columns(family, view.clean, view.rate, frequency, zeta)


_BY_NAME: dict[str, Callable[[View], Labelled]] = {
    "response": lambda v: linear_filter.response_columns(v.clean, v.rate),
    "creep": lambda v: linear_filter.creep_columns(v.clean, v.rate),
    "slow": lambda v: linear_filter.slow_columns(v.clean, v.rate),
    "impulse": lambda v: linear_filter.impulse_columns(v.clean, v.rate),
    "swing": lambda v: _tuned(v, "swing"),
    "clock": lambda v: _tuned(v, "clock"),
    "mode": lambda v: _tuned(v, "mode"),
    DAMPED: lambda v: _tuned(v, DAMPED),
    "static": lambda v: nonlinearity.static_columns(v.clean, v.scale.top),
    "curve": lambda v: nonlinearity.curve_columns(v.clean, v.scale.top, nonlinearity.CURVE_KNOTS),
    "fine": lambda v: nonlinearity.curve_columns(v.clean, v.scale.top, nonlinearity.FINE_KNOTS),
    "path": lambda v: nonlinearity.path_columns(v.clean, v.scale.top),
    RIPPLE: lambda v: nonlinearity.ripple_columns(v.clean, v.scale.top, v.scale.ripples),
    "dynamic": lambda v: nonlinearity.dynamic_columns(v.clean, v.rate, v.scale.top),
    "droop": lambda v: nonlinearity.droop_columns(v.clean, v.rate, v.scale.top),
    "warmth": lambda v: nonlinearity.warmth_columns(v.clean, v.rate, v.scale.top),
    SLEW: lambda v: nonlinearity.slope_columns(v.clean, v.rate, v.scale.steepest_per_s),
    "seat": lambda v: nonlinearity.mount_columns(v.clean, v.rate, v.scale.top, v.crystal),
    "contact": lambda v: _force(v, sphere_only=False),
    "loss": lambda v: _force(v, sphere_only=True),
    "locked": lambda v: time_course.locked_columns(
        v.clean.size, v.rate, v.touch_down_us, v.item.window.peak, time_course.BUMPS_US
    ),
    "outline": _outline,
    "jump": lambda v: time_course.jump_columns(v.clean, v.residual, v.sample_at(v.touch_down_us)),
    LATE_IMPACT: _late_impact,
    "baseline": lambda v: time_course.baseline_columns(v.clean.size, v.scale.top),
    "alternate": lambda v: time_course.alternate_columns(v.clean, v.scale.top),
    "pieces": lambda v: time_course.piece_columns(v.clean, v.rate, v.touch_down_us, v.contact_us),
    "wander": lambda v: time_course.wander_columns(v.clean, v.rate, v.touch_down_us),
    "cell": lambda v: _parameters(v, [n for n in SHARED[v.model.kind] if n != "ln_K"], 0.1),
    "gain": lambda v: _parameters(v, ["ln_S"], CHANGE),
    "pitch": lambda v: _parameters(v, ["ln_w", "ln_z"], CHANGE),
    "stiffness": lambda v: _parameters(v, ["ln_K"], CHANGE),
    "speed": lambda v: (["speed"], np.zeros((v.clean.size, 1))),
}

_LABELLED_BY_TIME = frozenset(
    ("response", "creep", "slow", "impulse", "droop", "warmth", "locked", "outline", "wander")
)
"""Families whose labels tell times and frequencies of the columns, not of the records."""


def family_columns(view: View, family: str) -> tuple[list[str], Array, Array]:
    """Return one family's labels, its columns of one shot and what they add to the promised ln v0.

    Of shape (n, q) [unit of the signal] and (q,).
    """
    labels, signal = _BY_NAME[family](view)
    if view.scale.pace != 1.0 and family in _LABELLED_BY_TIME:
        labels = [f"{label}, times {view.scale.pace:.3g}" for label in labels]
    return labels, signal, np.full(len(labels), 0.1 if family == "speed" else 0.0)


def scale_of(problem: JointProblem, fitted: Fitted) -> Scale:
    """Return the sizes that the generic columns of a fitted campaign are measured in."""
    contacts, speeds = [], []
    for item, nuisance in zip(problem.shots, fitted.nuisances, strict=True):
        shared, _ = problem.shared_local(item, fitted.theta)
        contacts.append(_hertz(item, np.array([*shared, *nuisance]), len(shared)))
        speeds.append(math.exp(nuisance[0]))
    indentation_m, contact_s = np.median(contacts, axis=0).tolist()
    top = max(s.window.peak for s in problem.shots)
    # of the records, not of the fit: it must not change from one model to the next
    width_s = float(np.median([s.window.width_s for s in problem.shots]))
    pace = width_s / min(max(width_s, CONTACTS_S[0]), CONTACTS_S[1])
    return Scale(top, indentation_m, float(np.median(speeds)), contact_s, pace)


def tuned(problem: JointProblem, fitted: Fitted, scale: Scale, wanted: Sequence[str]) -> Scale:
    """Return the scale with what some families need that is looked for along the residuals.

    What the scale has already is kept.
    """
    if SLEW in wanted and not scale.steepest_per_s:
        records = [s.window.signal for s in problem.shots]
        rates = [s.frame.sample_rate_hz * scale.pace for s in problem.shots]
        scale = dataclasses.replace(scale, steepest_per_s=nonlinearity.steepest(records, rates))
    families = [f for f in wanted if f in (*TUNED, DAMPED) and f not in scale.tuned_hz]
    ripple = RIPPLE in wanted and not scale.ripples
    late_impact = LATE_IMPACT in wanted and not scale.late_impact_us
    if not families and not ripple and not late_impact:
        return scale
    views, residuals = [], []
    for item, nuisance in list(zip(problem.shots, fitted.nuisances, strict=True))[::TUNED_BY]:
        local = np.concatenate([problem.shared_local(item, fitted.theta)[0], nuisance])
        signal = problem.model.predict(local, item.frame).signal
        none = np.zeros((signal.size, 0))
        views.append(View(problem.model, item, local, signal - nuisance[BASELINE], none, scale))
        residuals.append(item.window.signal - signal)
    signals, rates = [v.clean for v in views], [v.rate for v in views]
    best, found = dict(scale.tuned_hz), scale
    for family in families:
        if family != DAMPED:
            best[family] = linear_filter.best_frequency(family, signals, residuals, rates)
    if DAMPED in families:
        best[DAMPED], zeta = linear_filter.best_damped(signals, residuals, rates)
        found = dataclasses.replace(found, tuned_zeta=zeta)
    if ripple:
        cycles = nonlinearity.best_ripple(signals, residuals, scale.top)
        found = dataclasses.replace(found, ripples=cycles)
    if late_impact:
        firsts, crystals = [v.lift_off for v in views], [v.crystal for v in views]
        width_us = time_course.late_impact_width(residuals, firsts, rates, crystals)
        found = dataclasses.replace(found, late_impact_us=width_us)
    return dataclasses.replace(found, tuned_hz=best)
