r"""Surface roughness: asperities give way before the bulk does.

.. math:: F_{el} \to F_{el}\,(1 - e^{-\delta/s})

Source: a plain softening of first contact; Johnson, Contact Mechanics (1985) ch. 13.5 for why rough
contact starts soft. Not derived: s is of the size of the roughness, no more. Validity: s much
smaller than the indentation. Validation: DOP853 of the coupled equations; limit s -> 0 in the
tests.

Scope: the surface's finish. Fitted as a logarithm, because the effect vanishes like s^(5/2) in the
work done: at s = 0 every derivative is zero.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return -elastic * math.exp(-max(delta, 0.0) * p0), 0.0, 0.0, 0.0


EFFECT = Effect(
    id="surface_roughness",
    slot="contact",
    title="the contact starts soft",
    tell_tale="soft toe, worse at low speed",
    source="softened Hertz law, cf. Johnson 1985",
    validation="DOP853; limit of a smooth surface",
    parameters=(
        EffectParameter(
            "roughness_m",
            "m",
            "surface",
            "log",
            1e-6,
            1e-8,
            3e-5,
            (1e-6, 2e-7, 4e-6),
            "depth over which asperities give way, s",
        ),
    ),
    contact=_term,
    pack=lambda v, c: (1.0 / v["roughness_m"], 0.0, 0.0, 0.0),
)
