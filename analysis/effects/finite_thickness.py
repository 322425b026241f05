r"""Finite thickness: a thin bonded coupon stiffens with indentation.

.. math:: F_{el} \to F_{el}\,(1 + 1.133X + 1.283X^2 + 0.769X^3 + 0.0975X^4), \quad X = \sqrt{R\delta}/h

Source: Dimitriadis et al., Biophys. J. 82 (2002) 2798. Valid for a nearly incompressible bonded
layer, X < 1. Validation: limit h -> infinity in the tests.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]
    x = math.sqrt(delta) * p0
    return elastic * x * (1.133 + x * (1.283 + x * (0.769 + 0.0975 * x))), 0.0, 0.0, 0.0


EFFECT = Effect(
    id="finite_thickness",
    slot="contact",
    title="the coupon is thin",
    tell_tale="hardens with amplitude; the modulus comes out too high",
    source="Dimitriadis et al. 2002",
    validation="limit of a thick layer",
    parameters=(
        EffectParameter("thickness_m", "m", "surface", "inverse", 1e-3, 1e-4, 1.0,
                        (3e-3,), "layer thickness"),
    ),
    needs=("radius_m",),
    contact=_term,
    pack=lambda v, c: (math.sqrt(c.radius_m or 0.0) / v["thickness_m"], 0.0, 0.0, 0.0),
)
