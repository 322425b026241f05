r"""Finite thickness: a thin bonded coupon is stiffer than a half-space, the sphere is not.

At one radius of contact a, with the plane-strain moduli E1' of the sphere and E2' of the coupon:

.. math::

    F = \frac{4 a^3}{3 R}\,E^*(\epsilon), \qquad
    \frac{1}{E^*(\epsilon)} = \frac{1}{E_1'} + \frac{1}{E_2'\,f(\epsilon, \nu)}, \qquad
    \epsilon = a / h

.. math::

    \delta = \frac{a^2}{R}\,\bigl(1 - \kappa\,p(\epsilon, \nu)\bigr), \qquad
    \kappa = \frac{E^*(\epsilon)}{E_2' f}

f is how much more force a rigid sphere needs for the same radius of contact than on a half-space,
p how much less it sinks in for it; kappa is the coupon's part in the curvature of the contact. Both
are fitted to the solution of the bonded layer for Poisson's ratios from 0 to 0.5. For small
:math:`X = \sqrt{R\delta}/h` and a rigid sphere

.. math:: F = F_H\,(1 + c X + \tfrac76 c^2 X^2 + \dots), \quad c(0.5) = 1.127, \quad c(0.37) = 0.934

Source: own fit to the solution, by Hankel transforms, of a frictionless sphere on a bonded layer
(compliance of the layer: Alexandrov & Pozharskii, Three-Dimensional Contact Problems, 2001; Hayes
et al., J. Biomech. 5 (1972) 541). The series of Dimitriadis et al., Biophys. J. 82 (2002) 2798, has
c^2 where the solution has 7/6 c^2, and is 8 % low at X = 0.49 for nu = 0.5; its last coefficient
there is -0.0975, often quoted as +0.0975, which hides part of that. Garcia & Garcia, Biophys. J.
114 (2018) 2923, has 1.133, 1.497 = 7/6 1.133^2, 1.469, 0.755 for nu = 0.5.

Two forms are what others compute with. ``finite_thickness:dimitriadis`` has that series for f(X) in
1/E* = 1/E1' + 1/(E2' f). ``finite_thickness:whole_contact`` multiplies K by 1 + 1.133 X + 1.283 X^2
+ 0.769 X^3 + 0.0975 X^4, which stiffens the sphere as well; no layer does, but simulators do.

Validity: X up to 1 (within 0.2 %; 0.06 % up to 0.5), finite and rising beyond; frictionless;
bonded to a ground that does not give way within a radius of contact. What gives way as a whole
below the coupon (tape, crystal) is the structure's.

Validation: the solution itself, by another method than the simulated rig's; DOP853 of the coupled
equations; Garcia & Garcia's numbers; limits h -> infinity and rigid coupon. All in the tests.

Scope: the surface's. Where a campaign states the coupon's thickness, that is what is known of it
beforehand; else that coupons are as a rule a millimetre or thicker, without which a hard reference
of next to no thickness would be as good as rigid. In a fit the coupon's share in the compliance
follows from the moduli; a sphere of unknown modulus on a pair whose moduli cannot be told apart
counts as rigid.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM

_MOST_CORRECTIONS = 40
_NEAR = 1e-8
"""Of the radius of contact: a secant from so near ends within rounding."""


@njit(cache=True, nogil=True, inline="always")
def _sinks_less(e, nu):  # type: ignore[no-untyped-def]
    """Return p: (2/3) c epsilon for small epsilon, between 0 and 1."""
    c = 0.77096 + nu * (-0.62269 + nu * (0.22513 + nu * (0.47612 + nu * (-0.85238 + nu * 1.32156))))
    square = 1.8305 + nu * (0.4521 + nu * (2.8494 - nu * 2.4861))
    cube = -0.6427 + nu * (1.3423 + nu * (-13.4047 + nu * 19.5405))
    late = 0.8132 + nu * (-2.8338 + nu * (28.7874 - nu * 47.9902))
    bend = 1.0 + e * e * (square + cube * e / (1.0 + late * e))
    return 2.0 / 3.0 * c / (1.0 - nu) * e / math.sqrt(bend)


@njit(cache=True, nogil=True, inline="always")
def _presses_more(e, nu):  # type: ignore[no-untyped-def]
    """Return f: 1 and a cube of epsilon for small epsilon."""
    cube = 0.4056 + nu * (-0.136 + nu * (-0.004 + nu * 0.6811))
    one = 0.1819 + nu * (-0.169 + nu * (0.8325 - nu * 0.0786))
    two = 0.9624 + nu * (0.5475 + nu * (-2.1862 + nu * 2.0214))
    late = 0.0572 + nu * (-0.0176 + nu * (-0.4436 + nu * 0.8613))
    # what cannot be compressed is pressed sideways out of the contact, which takes far more force
    sideways = 0.0441 * (2.0 * nu) ** 8
    rise = (1.0 + e * (late + e * sideways)) / (1.0 + e * (one + e * two))
    return 1.0 + cube / (1.0 - nu) * e * e * e * rise


@njit(cache=True, nogil=True, inline="always")
def _wider(t, x, share, nu):  # type: ignore[no-untyped-def]
    """Return the radius of contact over sqrt(R delta) that follows from a trial of it."""
    e = t * x
    part = share / (share + (1.0 - share) * _presses_more(e, nu))
    left = 1.0 - part * _sinks_less(e, nu)
    return 1.0 / math.sqrt(left) if left > 0.0 else math.nan


@njit(cache=True, nogil=True)
def stiffer(x, share, nu):  # type: ignore[no-untyped-def]
    """Return the force over that on a thick coupon at the same indentation; x is X."""
    before, t = 1.0, _wider(1.0, x, share, nu)
    missed = before - t
    for _ in range(_MOST_CORRECTIONS):
        miss = t - _wider(t, x, share, nu)
        if miss == missed:
            break
        before, missed, t = t, miss, t - miss * (t - before) / (miss - missed)
        if not abs(miss) > _NEAR * t:
            break
    return t * t * t / (1.0 - share + share / _presses_more(t * x, nu))


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    if delta <= 0.0 or p0 == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return elastic * (stiffer(math.sqrt(delta) * p0, p1, p2) - 1.0), 0.0, 0.0, 0.0


def _pack(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    return (
        math.sqrt(context.known("radius_m")) / values["thickness_m"],
        context.known("coupon_share"),
        context.coupon_poissons_ratio,
        0.0,
    )


@njit(cache=True, nogil=True)
def series(x, nu, as_quoted):  # type: ignore[no-untyped-def]
    """Return Dimitriadis' factor, along its tangent beyond X = 1, where it is no law any more.

    ``as_quoted`` takes nu = 0.5 with the last coefficient's sign as it is often printed.
    """
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu)
    c1, c2 = -2.0 * a / math.pi, 4.0 * a * a / math.pi**2
    c3 = -8.0 / math.pi**3 * (a**3 + 4.0 * math.pi**2 * b / 15.0)
    c4 = 16.0 * a / math.pi**4 * (a**3 + 3.0 * math.pi**2 * b / 5.0)
    if as_quoted:
        c1, c2, c3, c4 = 1.133, 1.283, 0.769, 0.0975
    t = min(x, 1.0)
    slope = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * 4.0 * c4))
    return 1.0 + t * (c1 + t * (c2 + t * (c3 + t * c4))) + slope * (x - t)


@njit(TERM, cache=True)
def _by_series(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    if delta <= 0.0 or p0 == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    factor = 1.0 / (1.0 - p1 + p1 / series(math.sqrt(delta) * p0, p2, p3 > 0.0))
    return elastic * (factor - 1.0), 0.0, 0.0, 0.0


def _pack_whole(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    return math.sqrt(context.known("radius_m")) / values["thickness_m"], 1.0, 0.5, 1.0


_THICKNESS = EffectParameter(
    "thickness_m",
    "m",
    "surface",
    "inverse",
    1e-3,
    1e-4,
    0.1,
    (3e-3,),
    "thickness of the bonded coupon, h",
    stated="coupon_thickness_m",
    usual_u=1.0,  # coupons are a millimetre or thicker
)

EFFECT = Effect(
    id="finite_thickness",
    slot="contact",
    title="the coupon is thin",
    tell_tale="hardens with amplitude; the modulus comes out too high",
    source="solution of the bonded layer; Hayes et al. 1972, Garcia & Garcia 2018",
    validation="the layer solved by pressures; DOP853; limit of a thick layer",
    parameters=(_THICKNESS,),
    needs=("radius_m",),
    by_coupon_share=True,
    contact=_term,
    pack=_pack,
    variants=(
        Effect(
            id="finite_thickness:dimitriadis",
            slot="contact",
            title="the coupon is thin, by Dimitriadis' series",
            tell_tale="hardens with amplitude; the modulus comes out too high",
            source="Dimitriadis et al. 2002",
            validation="DOP853; its coefficients at nu = 0.5",
            parameters=(_THICKNESS,),
            needs=("radius_m",),
            by_coupon_share=True,
            contact=_by_series,
            pack=_pack,
        ),
        Effect(
            id="finite_thickness:whole_contact",
            slot="contact",
            title="the whole contact stiffens as on a thin coupon under a rigid sphere",
            tell_tale="hardens with amplitude; the modulus comes out too high",
            source="Dimitriadis et al. 2002, nu = 0.5, as often quoted",
            validation="DOP853",
            parameters=(_THICKNESS,),
            needs=("radius_m",),
            contact=_by_series,
            pack=_pack_whole,
        ),
    ),
)
