r"""Adhesion: the surfaces pull while they touch.

.. math:: F_{el} \to F_{el} - 4 \pi \gamma R

Source: Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314 (pull-off 4 pi gamma R
with a work of adhesion of 2 gamma). Johnson, Kendall & Roberts 1971 have 3 pi gamma R at pull-off;
one trace cannot tell them apart, so gamma is sure to a third only. Validity: contact ends at zero
indentation, so the neck that a tacky surface draws out, and the energy it takes, are left out.
Validation: DOP853 of the coupled equations; static pull in the tests.

Scope: the surface's: a tacky coupon is what makes it visible at all (10 mN on 10 N otherwise).
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return -p0, 0.0, 0.0, 0.0


EFFECT = Effect(
    id="adhesion",
    slot="contact",
    title="the surfaces stick a little",
    tell_tale="tension at touch-down and lift-off; invisible unless tacky",
    source="Derjaguin, Muller & Toporov 1975",
    validation="DOP853; static pull",
    parameters=(
        EffectParameter(
            "surface_energy_j_per_m2",
            "J/m^2",
            "surface",
            "linear",
            1.0,
            0.0,
            20.0,
            (0.3,),
            "gamma, half the work of adhesion",
        ),
    ),
    needs=("radius_m",),
    contact=_term,
    pack=lambda v, c: (
        4 * math.pi * v["surface_energy_j_per_m2"] * c.known("radius_m"),
        0.0,
        0.0,
        0.0,
    ),
)
