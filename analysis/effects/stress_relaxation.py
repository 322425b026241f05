r"""Stress relaxation: the contact softens while it lasts.

With Hertz's :math:`w = \delta^{3/2}` and a relaxation function :math:`\psi` of the contact

.. math:: F_{el} = K \int_0^t \psi(t - s)\, \dot w(s)\, ds

in three forms, each a sum of Maxwell arms with a memory :math:`z_i` of its own:

.. math::

    F_{el} \to F_{el} + \sum_i g_i K (w - z_i), \quad \dot z_i = (w - z_i)/\tau_i

====================================  =============================================================
``stress_relaxation``                 1 + g exp(-t/tau): one arm, the standard linear solid
``stress_relaxation:maxwell``         1 + g exp(-t/tau) + g' exp(-t/10 tau): two arms, a decade
                                      apart (Tschoegl's spacing of a discrete spectrum); at g' = 0
                                      the first form
``stress_relaxation:power_law``       (t / 50 us)^(-b): a spectrum without a time of its own, the
                                      fractional element; its loss tangent is tan(pi b / 2) at
                                      every frequency, and K is the modulus after 50 us, the
                                      middle of the contacts that a cell sees
====================================  =============================================================

The last two are fitted by name only, so that a diagnosis asks of each effect one question.

The power law is the integral of exp(y b - t exp(y) / 50 us) / Gamma(b) over y by the trapezoidal
rule (Beylkin & Monzon 2010): seven arms from 1 us to 16 ms, each five times the last; faster ones
act as a dashpot, slower ones as a spring, both in closed form. From 5 to 500 us psi is right
to 3e-4 at b = 0.02, 1e-3 at 0.1 and 3e-3 at 0.3.

**On the way back** the integral is an approximation. It lets the contact area shrink with the
indentation; Ting's exact law has the area of an earlier moment t1 instead, with the stress that
relaxed since, found from int_t1^t psi(t - s) delta'(s) ds = 0. Ting's F is the smaller loss: of a
Maxwell solid 1 - eps is 4/9 T/tau to first order (Hunter 1960), by the integral 5/9. That is the
free restitution's to take up; what it leaves in the moduli stands in this folder's README.

**Its end.** A contact that does not stick cannot pull, and the integral turns to tension before the
indentation is back at zero. On ``kv2`` the contact ends when the total force does; on the paper's
bases, whose own dashpot pulls until the indentation is zero, when the elastic force of the relaxed
contact does. At the neutral value that is the indentation's end again, hence exactly the paper's
model. What a relaxed dent does after lift-off nobody feels.

Source: Lee & Radok, J. Appl. Mech. 27 (1960) 438; Ting, J. Appl. Mech. 33 (1966) 845; Hunter, J.
Mech. Phys. Solids 8 (1960) 219; Tschoegl, The Phenomenological Theory of Linear Viscoelastic
Behavior (1989); Scott Blair, J. Colloid Sci. 2 (1947) 21, for the power law. Validity: small
strain, one relaxation function for compression and shear. Validation: DOP853 of the coupled
equations with either end; limits tau -> 0 (no effect) and tau -> infinity (K (1 + g)); a
Volterra integration and Lee and Radok's force at constant speed for the power law; Hunter's 4/9
for the exact law that the figures in the README come from.

Scope: a material's. It starts as one number of the rig, the smallest hypothesis: K is free in every
pair and takes up the stiffness at one contact time; surface or sphere come second.
"""

import math
from dataclasses import replace

from numba import njit

from analysis.effects.effect import (
    Effect,
    EffectParameter,
    ShotContext,
    Values,
    resolving_steps,
)
from analysis.model.effect_solver import TERM

_DECADE = 10.0
_REFERENCE_S = 5e-5
_FASTEST_S = 1e-6
_ARMS = 7
_SPACING = math.log(5.0)
"""Of the arms' times: between 1.5 and 1.7 the rule's ripple and the cut-offs err alike."""


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return p0 * (elastic - z), 0.0, (elastic - z) / p1, 0.0


@njit(TERM, cache=True)
def _arm(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    # p2: the spring that slower arms are, less the base model's; p3: the dashpot of faster ones
    viscous = p3 * math.sqrt(max(delta, 0.0)) * rate
    return p0 * (elastic - z) + p2 * elastic + viscous, 0.0, (elastic - z) / p1, 0.0


def _steps(values: Values, context: ShotContext) -> float:
    # an explicit scheme must resolve the relaxation, however short
    return resolving_steps(1.0 / values["relaxation_time_s"], context)


def _two_arms(values: Values, context: ShotContext) -> tuple[float, ...]:
    time_s = values["relaxation_time_s"]
    first = (values["strength"], time_s, 0.0, 0.0)
    return (*first, values["slow_strength"], _DECADE * time_s, 0.0, 0.0)


def _power_law(values: Values, context: ShotContext) -> tuple[float, ...]:
    b, K = values["exponent"], context.stiffness
    if not -1.0 < b < 1.0:
        # the integral has no value there; a fit steps back
        return (math.nan,) * (4 * _ARMS)
    rates = [_REFERENCE_S / _FASTEST_S * math.exp(-_SPACING * k) for k in range(_ARMS)]
    # h / Gamma(b) with the b of 1 / Gamma(b) = b / Gamma(1 + b) apart, across the neutral point
    scale = _SPACING / math.gamma(1.0 + b)
    # the two geometric sums beyond the arms
    slower = rates[-1] ** b * math.exp(-_SPACING * b)
    spring = scale * slower * (b / -math.expm1(-_SPACING * b) if b else 1.0 / _SPACING)
    faster = rates[0] ** (b - 1.0) * math.exp((b - 1.0) * _SPACING)
    viscous_s = scale * b * _REFERENCE_S * faster / -math.expm1((b - 1.0) * _SPACING)
    packed: list[float] = []
    for rate in rates:
        packed += [scale * b * rate**b, _REFERENCE_S / rate, 0.0, 0.0]
    packed[2:4] = spring - 1.0, 1.5 * K * viscous_s
    return tuple(packed)


_TIME = EffectParameter(
    "relaxation_time_s",
    "s",
    "rig",
    "log",
    1e-5,
    2e-7,
    1e-3,
    (1.5e-5, 4e-6, 6e-5, 2.5e-4),
    "time constant",
    resolved=True,
)


def _strength(name: str, description: str) -> EffectParameter:
    return EffectParameter(name, "1", "rig", "linear", 0.3, 0.0, 3.0, (0.1,), description)


EFFECT = Effect(
    id="stress_relaxation",
    slot="contact",
    title="the material relaxes within the contact",
    tell_tale="stiffness depends on contact time",
    source="Lee & Radok 1960",
    validation="DOP853; limits of the relaxation time",
    parameters=(_strength("strength", "unrelaxed over relaxed stiffness, less one"), _TIME),
    contact=_term,
    pack=lambda v, c: (v["strength"], v["relaxation_time_s"], 0.0, 0.0),
    steps=_steps,
    parts_by_force=True,
    variants=(
        Effect(
            id="stress_relaxation:maxwell",
            slot="contact",
            title="the material relaxes within the contact, with two times",
            tell_tale="stiffness depends on contact time, over more than a decade",
            source="Lee & Radok 1960; Tschoegl 1989",
            validation="DOP853; limit of one arm",
            parameters=(
                _strength("strength", "share of the faster arm, over the relaxed stiffness"),
                _strength("slow_strength", "share of the arm with ten times its time"),
                # the time of a single arm may be that of either
                replace(_TIME, valleys=(1.0 / _DECADE,)),
            ),
            contact=_term,
            pack=_two_arms,
            memories=2,
            steps=_steps,
            parts_by_force=True,
            by_name=True,
        ),
        Effect(
            id="stress_relaxation:power_law",
            slot="contact",
            title="the material relaxes within the contact, by a power of time",
            tell_tale="stiffness falls by the same factor with each decade of contact time",
            source="Scott Blair 1947; Lee & Radok 1960; Beylkin & Monzon 2010",
            validation="Volterra integration; force at constant speed; loss tangent; elastic limit",
            parameters=(
                EffectParameter(
                    "exponent",
                    "1",
                    "rig",
                    "linear",
                    0.1,
                    0.0,
                    0.5,
                    (0.03,),
                    "b; the loss tangent is tan(pi b / 2)",
                ),
            ),
            contact=_arm,
            pack=_power_law,
            memories=_ARMS,
            steps=lambda v, c: resolving_steps(1.0 / _FASTEST_S, c),
            parts_by_force=True,
            by_name=True,
        ),
    ),
)
