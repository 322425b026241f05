r"""Coupon mode: flexure or rocking of what the sphere hits, a side oscillator on the top mass.

.. math::

    \ddot q + 2\zeta\omega(\dot q - \dot\Delta) + \omega^2 (q - \Delta) = 0, \quad
    F_{side} = \sigma M\,[\omega^2 (q - \Delta) + 2\zeta\omega (\dot q - \dot\Delta)]

with sigma M the mass that takes part; F_side acts on the top mass (the crystal, or the coupon where
an adhesive layer is added before).

``coupon_mode:off_centre``, fitted by name only, is the crystal's own rocking under a hit beside its
axis. A disc of radius a on a uniform seat rocks with the frequency and the damping of its
compression, and a hit at b moves the place that is hit by

.. math:: r = (2b/a)^2

times the compression more, which the cell does not read. So the sphere meets a crystal of
M/(1 + r) on k/(1 + r), read at the old gain: the one direction in which a trace tells M itself.
Where all shots are alike it is a wrong crystal mass; the error in a modulus comes from hits on one
coupon that lie elsewhere than those on the others (this folder's README has the size).

Source: one mode of a continuous body as an attached oscillator; Meirovitch, Fundamentals of
Vibrations (2001) ch. 8. Validity: one mode matters, the contact excites it through the top mass's
motion; off centre: a thin disc, a uniform seat, no gain that varies over the crystal. Validation:
DOP853 of the coupled equations; split of the free frequencies in the tests; off centre: DOP853 of
compression and tilt apart.

Scope: frequency and damping are the rig's as the smallest hypothesis: one cap, coupons of one kind.
The mass that takes part goes with the place that the sphere hits, none at a node and most at an
edge. It is the surface's here, and the shot's (scope ``shot``) where the sphere does not hit the
same place each time.
"""

import math

from analysis.effects.effect import (
    Effect,
    EffectParameter,
    ShotContext,
    Values,
    damping_ratio,
    resolving_steps,
)
from analysis.model.structure import Structure


def _structure(structure: Structure, values: Values, context: ShotContext) -> None:
    share = values["mass_share"]
    if share == 0.0:
        return  # a mass of nothing moves nothing
    omega = 2 * math.pi * values["frequency_hz"]
    mass = share * structure.masses[structure.top]
    structure.add("side", mass)
    structure.link(
        "side", structure.top, mass * omega**2, 2 * values["damping_ratio"] * mass * omega
    )


def _rocks(structure: Structure, values: Values, context: ShotContext) -> None:
    # a tilt that undoes the whole compression leaves no crystal; a fit steps back from there
    more = values["tilt_over_compression"]
    structure.rocking = more if more > -1.0 else math.nan


def _steps(values: Values, context: ShotContext) -> float:
    fastest = max(1.0, 2 * values["damping_ratio"])
    return resolving_steps(2 * math.pi * values["frequency_hz"] * fastest, context)


# a ring seen over many periods has no slope towards another frequency: look every 12 %
_FREQUENCIES_HZ = tuple(4.5e3 * 1.12**i for i in range(25))

EFFECT = Effect(
    id="coupon_mode",
    slot="mounting",
    title="the coupon flexes or rocks",
    tell_tale="a second ring whose size varies with the place hit",
    source="attached oscillator, Meirovitch 2001",
    validation="DOP853; split of the free frequencies",
    parameters=(
        EffectParameter(
            "mass_share",
            "1",
            "surface",
            "linear",
            0.1,
            0.0,
            2.0,
            (0.03, 0.15),
            "mass that takes part over the top mass",
        ),
        EffectParameter(
            "frequency_hz",
            "Hz",
            "rig",
            "log",
            1e4,
            1e3,
            1e5,
            _FREQUENCIES_HZ,
            "natural frequency",
            resolved=True,
        ),
        damping_ratio(0.03, most=0.4, of="of the mode"),
    ),
    structure=_structure,
    steps=_steps,
    bases=("kv", "kv2"),
    variants=(
        Effect(
            id="coupon_mode:off_centre",
            slot="mounting",
            title="the sphere hits off-centre, and the crystal rocks",
            tell_tale="more recoil with the same ring; a crystal that looks too light",
            source="own: a disc on a uniform seat",
            validation="DOP853 of compression and tilt apart",
            parameters=(
                EffectParameter(
                    "tilt_over_compression",
                    "1",
                    "surface",
                    "linear",
                    0.3,
                    0.0,
                    4.0,
                    (0.1,),
                    "r = (2 b / a)^2, b of the hit and a of the crystal",
                ),
            ),
            structure=_rocks,
            bases=("kv", "kv2"),
            by_name=True,
        ),
    ),
)
