r"""Plastic yield: the softer body flows, the contact remembers how deep it went.

With the contact pressure p_y at which flow begins and :math:`\delta_y = (2\pi p_y R / 3K)^2`:

.. math::

    F &= K\delta_y^{3/2} + \tfrac32 K\sqrt{\delta_y}\,(\delta - \delta_y)
        && \delta = z > \delta_y \text{ (going deeper)} \\
    F &= K\sqrt{F_e/F_z}\,(\delta - \delta_p)^{3/2}, \quad F_e = K z^{3/2}
        && \delta < z \text{ (elastic, on a flattened dent)}

z is the largest indentation so far, F_z the force there, delta_p follows from continuity. Loading
continues Hertz's law by its tangent (pi p_y R is Hertz's slope at delta_y). Past delta_p the sphere
has left its dent: no force, and the base dashpot ends there too.

Source: Thornton, J. Appl. Mech. 64 (1997) 383; Johnson, Contact Mechanics (1985) ch. 6. Validity:
elastic, perfectly plastic, R much larger than the dent. Other contact effects add to Hertz's force
and do not know of the dent; their sum with this one is a first approximation. Validation: DOP853 of
the coupled equations; Thornton's closed restitution on a rigid cell, in the tests.

Scope: the surface's, because the coupon is the softer body of a sensible campaign (yield pressure,
not yield force: the force differs with every sphere, the pressure belongs to the material). Where
nothing yields the derivative is exactly zero, hence the starts from soft to hard.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM
from analysis.model.hertz import contact_time, damping_coefficient

_STEPS = 300
"""The law has kinks, at which a step is only of second order."""
_PULL = 60.0
"""How firmly the memory is held to the indentation, per contact time."""


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    # the memory runs with the indentation while it grows, pulled to it so that no rounding stays
    grows = max(rate + p3 * (delta - z), 0.0) if rate > 0.0 else 0.0
    deepest = max(z, delta)
    if deepest <= p0:
        return 0.0, 0.0, grows, 0.0
    reached = p1 * math.sqrt(p0) * (p0 + 1.5 * (deepest - p0))
    if delta >= z:
        return reached - elastic, 0.0, grows, 0.0
    dented = p1 * math.sqrt(p1 * deepest * math.sqrt(deepest) / reached)
    left = delta - deepest + (reached / dented) ** (2.0 / 3.0)
    if left <= 0.0:
        return -elastic, -p2 * math.sqrt(math.sqrt(delta)) * rate, grows, 0.0
    return dented * left * math.sqrt(left) - elastic, 0.0, grows, 0.0


def _pack(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    pressure, K = values["yield_pressure_pa"], context.stiffness
    dashpot = damping_coefficient(context.restitution) * math.sqrt(context.mass_kg * K)
    # beyond the neutral point (no yield at any pressure) there is nothing to continue into
    start = (2 * math.pi * pressure * context.known("radius_m") / (3 * K)) ** 2
    duration = contact_time(K, context.mass_kg, context.speed_m_per_s)
    return start if pressure > 0.0 else math.inf, K, dashpot, _PULL / duration


EFFECT = Effect(
    id="plastic_yield",
    slot="contact",
    title="the contact yields",
    tell_tale="above a threshold of speed: cut peak, early end, more loss",
    source="Thornton 1997; Johnson 1985",
    validation="DOP853; Thornton's restitution",
    parameters=(
        EffectParameter(
            "yield_pressure_pa",
            "Pa",
            "surface",
            "inverse",
            3e8,
            1e7,
            1e11,
            (4e7, 6e7, 8.5e7, 1.2e8, 1.7e8, 2.5e8, 4e8, 6e8, 1e9, 1.8e9, 4e9),
            "contact pressure at which flow begins, p_y",
        ),
    ),
    needs=("radius_m",),
    contact=_term,
    pack=_pack,
    steps=lambda v, c: _STEPS,
)
