r"""Surface roughness: asperities carry the first load, the bulk follows.

Greenwood & Tripp's elastic contact of a smooth sphere and a rough plane: on every spot the
asperities press back with :math:`p = p_c\,e^{u/\sigma}`, u being how far the surfaces would overlap
there, and the bulk gives way under that pressure. Its force is that of Hertz at a smaller depth:

.. math::

    F = K (\sigma y)^{3/2}, \qquad
    \delta / \sigma = y + \ln\!\left(1 + \frac{b\,y^{3/2}}{1 + \tfrac{e}{3} y}\right), \qquad
    b = \frac{2 E^*}{3\pi p_c}\sqrt{\sigma/R}

y is the bulk's own indentation over sigma, the logarithm that of the asperities. Without the 1 it
has the model's limits: :math:`F = 2\pi R\sigma p_c\,e^{\delta/\sigma}` where the asperities carry
all, and Hertz's pressure filling the asperities, by Betti's theorem, where the bulk does. Between
them it is within 0.011 sigma of the model's numerical solution for every b. The 1 lets a contact
begin at delta = 0: there the highest asperities touch, at a hundredth of the pressure that moves
the bulk (b = 21). A b for another beginning shifts the touch-down, which is free in every shot, and
hardly anything else. The base dashpot is the bulk's, and goes with y and its rate; other effects
add to Hertz's force and do not know of the asperities.

Source: Greenwood & Tripp, J. Appl. Mech. 34 (1967) 153, with the exponential heights of Greenwood &
Williamson, Proc. R. Soc. A 295 (1966) 300; the closed form is our own. Validity: elastic asperities
that do not push one another; sigma, the standard deviation of both surfaces' heights together, much
smaller than the radius of contact. For Gaussian heights sigma is that of the highest quarter, some
0.6 of the whole. Hertz's pressure and radius are 7 % off where sigma is a twentieth of the bulk's
indentation, as Greenwood, Johnson & Matsubara, Wear 100 (1984) 47, have it. Validation: the model
solved for its pressures; those 7 %; DOP853 of the coupled equations; limit sigma -> 0. All in the
tests.

The form ``surface_roughness:toe`` counts the indentation from the highest asperities, which are
flat once s is passed:

.. math:: F = K \delta^{3/2} (1 - e^{-\delta/s})

Against the Hertz curve of the heavy loads it is soft at the first touch where Greenwood & Tripp's
is hard, whose bulk is met only below that plane. Source of the form: a common engineering closure;
not derived from heights of asperities. Validation: DOP853; its force written out, in the tests.

The form ``surface_roughness:layer`` is a layer of asperities in series with the bulk, pressed over
an area that does not grow:

.. math:: \delta = (F/K)^{2/3} + s \ln(1 + F/F_0)

F_0 is the force at which the layer has given way by s ln 2. It is the closed form above with
b = K s^(3/2) / F_0 free and without the growth of the area, e/3; but the base dashpot goes with the
whole indentation here, as Eq. 3 has it. Source: Greenwood & Williamson, for exponential heights on
a flat plane; Persson, Phys. Rev. Lett. 99 (2007) 125502, who has the same logarithm without
heights. Validity: the area of the asperities is the same from the first touch to the deepest
indentation, which a light contact's is not. Validation: DOP853, with the force found by bracketing,
in the tests.

Scope: the surface's finish. Fitted as a logarithm, because nothing is left of the effect but a late
touch-down as sigma vanishes.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM

_FIRST = 200.0 / (3.0 * math.pi)
"""b, with E* sqrt(sigma/R) / p_c = 100."""
_LATE = math.e / 3.0
_MOST_CORRECTIONS = 60
_NEAR = 1e-8
"""Of the root: Newton from so near ends within rounding."""


@njit(cache=True, nogil=True)
def bulk_depth(depth, b=_FIRST, widens=_LATE):  # type: ignore[no-untyped-def]
    """Return the bulk's indentation for a whole one, both over sigma, and its slope.

    ``widens`` is the factor e/3 in the denominator: 0 where the area does not grow.
    """
    t = slope = math.sqrt(depth)  # the root of y, in which all is smooth
    for _ in range(_MOST_CORRECTIONS):
        square = t * t
        late, first = 1.0 + widens * square, b * square * t
        miss = square + math.log1p(first / late) - depth
        slope = 2.0 * t + b * square * (3.0 + widens * square) / (late * (late + first))
        moved = max(t - miss / slope, 0.1 * t)
        near = abs(moved - t) <= _NEAR * t
        t = moved
        if near:
            break
    return t * t, 2.0 * t / slope


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    depth = delta * p0
    if depth <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    bulk, share = bulk_depth(depth, p2, p3)
    left = bulk / depth
    lost = p1 * math.sqrt(math.sqrt(delta)) * rate
    root = math.sqrt(left)
    return elastic * (left * root - 1.0), lost * (math.sqrt(root) * share - 1.0), 0.0, 0.0


@njit(TERM, cache=True)
def _toe(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return -elastic * math.exp(-max(delta, 0.0) * p0), 0.0, 0.0, 0.0


def _pack(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    dashpot = context.alpha * math.sqrt(context.mass_kg * context.stiffness)
    return 1.0 / values["roughness_m"], dashpot, _FIRST, _LATE


def _pack_layer(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    height = values["roughness_m"]
    return 1.0 / height, 0.0, context.stiffness * height**1.5 / values["layer_force_n"], 0.0


def _pack_toe(values: Values, context: ShotContext) -> tuple[float, float, float, float]:
    return 1.0 / values["roughness_m"], 0.0, 0.0, 0.0


def _height(
    meaning: str, starts: tuple[float, ...] = (3e-7, 6e-8, 1.2e-6)
) -> EffectParameter:
    return EffectParameter("roughness_m", "m", "surface", "log", 1e-6, 1e-8, 1e-5, starts, meaning)


EFFECT = Effect(
    id="surface_roughness",
    slot="contact",
    title="asperities carry the first touch",
    tell_tale="another toe of the pulse, worse at low speed",
    source="Greenwood & Tripp 1967; Greenwood & Williamson 1966",
    validation="the model solved for its pressures; Greenwood et al. 1984; DOP853",
    parameters=(_height("standard deviation of the asperities' heights, sigma"),),
    contact=_term,
    pack=_pack,
    variants=(
        Effect(
            id="surface_roughness:toe",
            slot="contact",
            title="the contact starts soft",
            tell_tale="soft toe, worse at low speed",
            source="common engineering closure",
            validation="DOP853; its force written out",
            parameters=(_height("indentation at which asperities are flat, s"),),
            contact=_toe,
            pack=_pack_toe,
        ),
        Effect(
            id="surface_roughness:layer",
            slot="contact",
            title="a layer of asperities gives way in series",
            tell_tale="soft toe that goes like the logarithm of the force",
            source="Greenwood & Williamson 1966; Persson 2007",
            validation="DOP853; its force found by bracketing",
            parameters=(
                _height("standard deviation of the asperities' heights, s", (1e-6, 2e-7)),
                EffectParameter(
                    "layer_force_n",
                    "N",
                    "surface",
                    "log",
                    1.0,
                    1e-5,
                    1e3,
                    (1.0, 0.1),
                    "force at which the layer has given way by s ln 2, F_0",
                ),
            ),
            contact=_term,
            pack=_pack_layer,
        ),
    ),
)
