r"""Base compliance: the cell stands on a mass on the stand's spring.

.. math::

    M_b\ddot q_b = k\Delta' + \mu\dot\Delta' - M_b\omega_b^2 q_b - 2\zeta_b M_b\omega_b\dot q_b

with Delta' = Delta - q_b the crystal's compression, which is what is read. The first number is
M / M_b rather than M_b: M itself hardly shows in a trace, the ratio does. M is the crystal without
its coupon, so that the base is the same under all.

Source: two masses in series. Validity: the stand's lowest mode matters. Validation: DOP853 of the
coupled equations; heavy limit in the tests.

Scope: the rig's, it is the stand.
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
from analysis.model.structure import FRAME, Structure


def _structure(structure: Structure, values: Values, context: ShotContext) -> None:
    ratio = values["crystal_over_base_mass"]
    if ratio == 0.0:
        return  # an infinite base is the frame
    mass = structure.bare_crystal_kg / ratio
    omega = 2 * math.pi * values["frequency_hz"]
    structure.add("base", mass)
    structure.move_base("base")
    structure.link("base", FRAME, mass * omega**2, 2 * values["damping_ratio"] * mass * omega)


def _steps(values: Values, context: ShotContext) -> float:
    fastest = max(1.0, 2 * values["damping_ratio"])
    return resolving_steps(2 * math.pi * values["frequency_hz"] * fastest, context)


# a ring seen over many periods has no slope towards another frequency: look every 12 %
_FREQUENCIES_HZ = tuple(600.0 * 1.12**i for i in range(25))

EFFECT = Effect(
    id="base_compliance",
    slot="sensor",
    title="the cell's stand gives way",
    tell_tale="slow ring, the same for every sphere",
    source="two masses in series",
    validation="DOP853; heavy limit",
    parameters=(
        EffectParameter(
            "crystal_over_base_mass",
            "1",
            "rig",
            "linear",
            0.1,
            0.0,
            5.0,
            (0.05, 0.4),
            "crystal's mass over the base's",
        ),
        EffectParameter(
            "frequency_hz",
            "Hz",
            "rig",
            "log",
            3e3,
            1e2,
            5e4,
            _FREQUENCIES_HZ,
            "of the base on the stand",
            resolved=True,
        ),
        damping_ratio(0.05, most=0.6, of="of the base on the stand"),
    ),
    structure=_structure,
    steps=_steps,
    bases=("kv", "kv2"),
)
