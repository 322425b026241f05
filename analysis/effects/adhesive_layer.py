r"""Adhesive layer: the coupon is a mass of its own on the tape.

.. math:: m_c \ddot q = F - k_t (q - \Delta) - c_t (\dot q - \dot\Delta)

Source: two masses in series; physics of taped coupons. Validity: the coupon moves as a rigid body.
Validation: against matrix exponentials in the tests.
"""

import math

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.structure import Structure


def _structure(structure: Structure, values: Values, context: ShotContext) -> None:
    mass = context.coupon_mass_kg or 0.0
    k = values["stiffness_n_per_m"]
    c = 2 * values["damping_ratio"] * math.sqrt(k * mass)
    structure.add("coupon", mass)
    structure.link("coupon", structure.top, k, c)
    structure.top = "coupon"


EFFECT = Effect(
    id="adhesive_layer",
    slot="mounting",
    title="the coupon moves on its tape",
    tell_tale="the ring shifts with the coupon",
    source="two masses in series",
    validation="matrix exponential",
    parameters=(
        EffectParameter("stiffness_n_per_m", "N/m", "rig", "log", 1e9, 1e6, 1e11,
                        (5e7, 5e8, 5e9), "of the layer, k_t"),
        EffectParameter("damping_ratio", "1", "rig", "log", 0.1, 1e-3, 5.0,
                        (0.1,), "of the coupon on the layer"),
    ),
    needs=("coupon_mass_kg",),
    structure=_structure,
)
