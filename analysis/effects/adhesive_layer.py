r"""Adhesive layer: the coupon is a mass of its own on the tape.

.. math:: m_c \ddot q = F - k_t (q - \Delta) - c_t (\dot q - \dot\Delta)

Source: two masses in series; physics of taped coupons. Validity: the coupon moves as a rigid body.
A stiff tape (k_t -> infinity) leaves the coupon's mass on the crystal: that is the base model
``kv2``, and ``kv`` with another M, where only the coupon's mass still differs in the limit.
Validation: DOP853 of the coupled equations; the stiff limit in the tests.

Scope: the rig's, because one tape serves all coupons, with the same k_t and c_t under each; the
coupons' masses are known, and the shift from one to the next is what identifies it.
"""

import math

from analysis.effects.effect import (
    Effect,
    EffectParameter,
    ShotContext,
    Values,
    resolving_steps,
)
from analysis.model.structure import Structure


def _structure(structure: Structure, values: Values, context: ShotContext) -> None:
    mass = context.known("coupon_mass_kg")
    k = values["stiffness_n_per_m"]
    structure.free_coupon()
    structure.add("coupon", mass)
    structure.link("coupon", structure.top, k, values["damping_n_s_per_m"])
    structure.top = "coupon"


def _steps(values: Values, context: ShotContext) -> float:
    mass = context.known("coupon_mass_kg")
    own = math.sqrt(values["stiffness_n_per_m"] / mass)
    # what is overdamped decays faster than it would swing
    return resolving_steps(max(own, values["damping_n_s_per_m"] / mass), context)


EFFECT = Effect(
    id="adhesive_layer",
    slot="mounting",
    title="the coupon moves on its tape",
    tell_tale="the ring shifts with the coupon",
    source="two masses in series",
    validation="DOP853; stiff limit",
    parameters=(
        EffectParameter(
            "stiffness_n_per_m",
            "N/m",
            "rig",
            "log",
            1e9,
            1e6,
            1e11,
            (3e8, 4e7, 3e9, 1e8, 1.8e7, 1e9),
            "of the layer, k_t",
            resolved=True,
        ),
        EffectParameter(
            "damping_n_s_per_m",
            "N s/m",
            "rig",
            "log",
            300.0,
            1.0,
            1e5,
            (300.0, 50.0, 1500.0),
            "of the layer, c_t",
        ),
    ),
    needs=("coupon_mass_kg",),
    structure=_structure,
    steps=_steps,
    bases=("kv", "kv2"),
)
