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

Two things are open, and each has a form. On the way back the base dashpot may go with the
indentation below the coupon's plane (the effect) or within the dent, with delta - delta_p
(``plastic_yield:dent``), where it ends smoothly. And what is given may be the force F_y at which
flow begins instead of the pressure (``plastic_yield:force``, delta_y = (F_y / K)^(2/3)): one force
for all spheres is another pressure for each.

Source: Thornton, J. Appl. Mech. 64 (1997) 383; Johnson, Contact Mechanics (1985) ch. 6 and 11.
Validity: elastic, perfectly plastic, R much larger than the dent. It is Hertz's pressure cut off at
p_y, without the gradual transition of a real body: flow begins inside at a centre pressure of 1.6 Y
(Y the yield stress) and reaches the whole contact at a mean pressure of 2.8 to 3 Y (Johnson 6.3;
Stronge, Impact Mechanics (2000) ch. 6). A fitted p_y lies between and creeps up with the depth, so
one p_y holds for a narrow range of speeds; with p_y = 1.6 Y flow begins at Johnson's speed,
:math:`\rho v_y^2 / Y = 26 (Y / E^*)^4` (11.29). Other contact effects add to Hertz's force
and do not know of the dent; their sum with this one is a first approximation. Validation: DOP853 of
the coupled equations in all forms; Thornton's closed restitution on a rigid cell, and Johnson's
0.14 m/s for steel, in the tests.

Scope: the surface's, because the coupon is the softer body of a sensible campaign (yield pressure
first: the force differs with every sphere, the pressure belongs to the material). Where
nothing yields the derivative is exactly zero, hence the starts from soft to hard.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM
from analysis.model.hertz import contact_time

_STEPS = 300
"""The law has kinks, at which a step is only of second order."""
_PULL = 60.0
"""How firmly the memory is held to the indentation, per contact time."""
_BELOW = 1.0 - 1e-3
"""Of the memory: what is less deep has begun to leave."""


@njit(cache=True, nogil=True, inline="always")
def _dented(delta, rate, elastic, z, p0, p1, p2, p3, within):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
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
        return -elastic, -p2 * math.sqrt(math.sqrt(max(delta, 0.0))) * rate, grows, 0.0
    lost = 0.0
    # on the way in the memory is the indentation but for what steps leave, either side
    if within and (rate <= 0.0 or delta < _BELOW * z):
        shallower = math.sqrt(math.sqrt(left)) - math.sqrt(math.sqrt(max(delta, 0.0)))
        lost = p2 * shallower * rate
    return dented * left * math.sqrt(left) - elastic, lost, grows, 0.0


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return _dented(delta, rate, elastic, z, p0, p1, p2, p3, False)


@njit(TERM, cache=True)
def _within(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return _dented(delta, rate, elastic, z, p0, p1, p2, p3, True)


def _packed(start: float, context: ShotContext) -> tuple[float, float, float, float]:
    K = context.stiffness
    dashpot = context.alpha * math.sqrt(context.mass_kg * K)
    duration = contact_time(K, context.mass_kg, context.speed_m_per_s)
    return start, K, dashpot, _PULL / duration


def _pack(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    pressure, K = values["yield_pressure_pa"], context.stiffness
    # beyond the neutral point (no yield at any pressure) there is nothing to continue into
    start = (2 * math.pi * pressure * context.known("radius_m") / (3 * K)) ** 2
    return _packed(start if pressure > 0.0 else math.inf, context)


def _pack_force(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    force = values["yield_force_n"]
    start = (force / context.stiffness) ** (2 / 3) if force > 0.0 else math.inf
    return _packed(start, context)


_PARAMETERS = (
    EffectParameter(
        "yield_pressure_pa",
        "Pa",
        "surface",
        "inverse",
        3e8,
        1e7,
        1e11,
        (6e7, 1.2e8, 2.5e8, 4e7, 9e7, 1.7e8, 6e8, 1.5e9, 4e9),
        "contact pressure at which flow begins, p_y",
        threshold=True,
    ),
)

EFFECT = Effect(
    id="plastic_yield",
    slot="contact",
    title="the contact yields",
    tell_tale="above a threshold of speed: cut peak, early end, more loss",
    source="Thornton 1997; Johnson 1985",
    validation="DOP853; Thornton's restitution; Johnson's speed of first yield",
    parameters=_PARAMETERS,
    needs=("radius_m",),
    contact=_term,
    pack=_pack,
    steps=lambda v, c: _STEPS,
    variants=(
        Effect(
            id="plastic_yield:dent",
            slot="contact",
            title="the contact yields, and loses within its dent",
            tell_tale="above a threshold of speed: cut peak, early end, more loss",
            source="Thornton 1997; Johnson 1985",
            validation="DOP853",
            parameters=_PARAMETERS,
            needs=("radius_m",),
            contact=_within,
            pack=_pack,
            steps=lambda v, c: _STEPS,
        ),
        Effect(
            id="plastic_yield:force",
            slot="contact",
            title="the contact yields at a force",
            tell_tale="above a threshold of force: cut peak, early end, more loss",
            source="Johnson 1985",
            validation="DOP853",
            parameters=(
                EffectParameter(
                    "yield_force_n",
                    "N",
                    "surface",
                    "inverse",
                    20.0,
                    0.5,
                    1e4,
                    (3.0, 7.0, 15.0, 30.0, 60.0, 2.0, 5.0, 10.0, 20.0),
                    "contact force at which flow begins, F_y",
                    threshold=True,
                ),
            ),
            contact=_term,
            pack=_pack_force,
            steps=lambda v, c: _STEPS,
        ),
    ),
)
