r"""Finite thickness: a thin bonded coupon stiffens with indentation.

.. math::

    F_{el} \to F_{el}\,(1 + 1.133X + 1.283X^2 + 0.769X^3 + 0.0975X^4), \quad
    X = \sqrt{R\delta}/h

Source: Dimitriadis et al., Biophys. J. 82 (2002) 2798. Valid for a nearly incompressible bonded
layer on a rigid ground, much softer than the sphere, X < 1; h is an effective thickness otherwise.
Validation: DOP853 of the coupled equations; limit h -> infinity in the tests. The coefficients are
the source's and were not derived anew.

Scope: the surface's, because it is the coupon's thickness.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    x = math.sqrt(max(delta, 0.0)) * p0
    return elastic * x * (1.133 + x * (1.283 + x * (0.769 + 0.0975 * x))), 0.0, 0.0, 0.0


def _pack(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    return math.sqrt(context.known("radius_m")) / values["thickness_m"], 0.0, 0.0, 0.0


EFFECT = Effect(
    id="finite_thickness",
    slot="contact",
    title="the coupon is thin",
    tell_tale="hardens with amplitude; the modulus comes out too high",
    source="Dimitriadis et al. 2002",
    validation="DOP853; limit of a thick layer",
    parameters=(
        EffectParameter(
            "thickness_m",
            "m",
            "surface",
            "inverse",
            1e-3,
            1e-4,
            0.1,
            (3e-3,),
            "effective layer thickness, h",
        ),
    ),
    needs=("radius_m",),
    contact=_term,
    pack=_pack,
)
