r"""Adhesion: the surfaces pull while they touch.

Two classical theories, two forms. ``adhesion`` is Derjaguin, Muller & Toporov's constant pull,

.. math:: F_{el} \to F_{el} - 4 \pi \gamma R

and ``adhesion:jkr`` Johnson, Kendall & Roberts' wider contact circle of radius a, W = 2 gamma:

.. math::

    \delta = \frac{a^2}{R} - \sqrt{\frac{2\pi W a}{E^*}}, \qquad
    F_{el} = \frac{4 E^* a^3}{3R} - \sqrt{8\pi W E^* a^3}

Deep in the contact the second pulls with only 2 pi gamma R and with more where it begins and ends,
8/9 of its pull-off force 3 pi gamma R at touch-down; the same trace therefore gives twice the gamma
of the first, and a pull that changes in the first microsecond where the first has a step.

Source: J. Colloid Interface Sci. 53 (1975) 314; Proc. R. Soc. A 324 (1971) 301. Validity: the first
for small stiff spheres, the second for large soft ones. The first ends at zero indentation; the
second draws out a neck (0.2 um between polymers, microseconds of tension between soft bodies) and
ends where the circle cannot shrink further. The dashpot ends at zero indentation in both. On a base
model whose contact ends with its force (``kv2``) both bear a pull of 4 pi gamma R first.
Validation: DOP853 of the coupled equations, the second with the circle found by bracketing; both
static pulls.

Scope: the surface's: a tacky coupon is what makes it visible at all (10 mN on 10 N otherwise).
"""

import dataclasses
import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM

_NEWTON_STEPS = 30
_CIRCLE_TOLERANCE = 1e-15
"""Of the circle's radius; the pull is a small difference of two large forces."""


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return -p0, 0.0, 0.0, 0.0


@njit(TERM, cache=True)
def _jkr(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    # p0 = sqrt(2 pi W / E*), p1 = R, p2 = E*; at p3 = -1, across the neutral point, a push
    if p0 == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    # from the right of a convex function Newton's steps never cross the root
    a = math.sqrt(p1 * max(delta, 0.0)) + (p0 * p1) ** (2.0 / 3.0)
    least = (0.25 * p0 * p1) ** (2.0 / 3.0)
    for _ in range(_NEWTON_STEPS):
        root = math.sqrt(a)
        slope = 2.0 * a / p1 - 0.5 * p0 / root
        step = (a * a / p1 - p0 * root - delta) / slope if slope > 0.0 else 0.0
        a = max(a - step, least)
        if step < _CIRCLE_TOLERANCE * a:
            break
    force = p2 * a * (4.0 * a * a / (3.0 * p1) - 2.0 * p0 * math.sqrt(a))
    return p3 * (force - elastic), 0.0, 0.0, 0.0


def _pack_jkr(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    gamma, radius = values["surface_energy_j_per_m2"], context.known("radius_m")
    modulus = 3 * context.stiffness / (4 * math.sqrt(radius))
    length = math.sqrt(4 * math.pi * abs(gamma) / modulus)
    return length, radius, modulus, math.copysign(1.0, gamma)


def _neck(values: Values, context: ShotContext) -> float:
    length, radius, _, sign = _pack_jkr(values, context)
    # where the circle is smallest, at a^(3/2) = R sqrt(2 pi W / E*) / 4
    return 3 * (length * radius / 4) ** (4 / 3) / radius if sign > 0.0 else 0.0


def _most(values: Values, context: ShotContext) -> float:
    # the first's own pull; a third more than the second's 3 pi gamma R, which alone parts nothing
    # before its neck is drawn out, so that only the dashpot on top of it can
    return 4 * math.pi * max(values["surface_energy_j_per_m2"], 0.0) * context.known("radius_m")


_GAMMA = EffectParameter(
    "surface_energy_j_per_m2",
    "J/m^2",
    "surface",
    "linear",
    1.0,
    0.0,
    20.0,
    (0.3,),
    "gamma, half the work of adhesion",
)

EFFECT = Effect(
    id="adhesion",
    slot="contact",
    title="the surfaces stick a little",
    tell_tale="tension at touch-down and lift-off; invisible unless tacky",
    source="Derjaguin, Muller & Toporov 1975",
    validation="DOP853; static pull",
    parameters=(_GAMMA,),
    needs=("radius_m",),
    contact=_term,
    pack=lambda v, c: (
        4 * math.pi * v["surface_energy_j_per_m2"] * c.known("radius_m"),
        0.0,
        0.0,
        0.0,
    ),
    bears=_most,
    variants=(
        Effect(
            id="adhesion:jkr",
            slot="contact",
            title="the surfaces stick a little and widen the contact",
            tell_tale="tension at touch-down and lift-off that eases with depth",
            source="Johnson, Kendall & Roberts 1971",
            validation="DOP853; static pull",
            parameters=(dataclasses.replace(_GAMMA, ratio_to_entry=2.0),),
            needs=("radius_m",),
            contact=_jkr,
            pack=_pack_jkr,
            bears=_most,
            reach=_neck,
        ),
    ),
)
