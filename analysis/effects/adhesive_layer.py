r"""Adhesive layer: the coupon is a mass of its own on the tape.

.. math:: m_c \ddot q = F - k_t (q - \Delta) - c_t (\dot q - \dot\Delta)

Every coupon has the same c_t; in the variant ``adhesive_layer:loss_factor`` it has the same damping
ratio, :math:`c_t = 2 \zeta \sqrt{k_t m_c}`, as a polymer of a constant loss factor has.

Source: two masses in series; physics of taped coupons; Nashif, Jones & Henderson, Vibration Damping
(1985), chapter 3, for the loss factor. Validity: the coupon moves as a rigid body.
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


def _damping(values: Values, mass_kg: float) -> float:
    """Return c_t under a coupon. [N s/m]"""
    if "damping_ratio" in values:
        return 2.0 * values["damping_ratio"] * math.sqrt(values["stiffness_n_per_m"] * mass_kg)
    return values["damping_n_s_per_m"]


def _structure(structure: Structure, values: Values, context: ShotContext) -> None:
    mass = context.known("coupon_mass_kg")
    structure.free_coupon()
    structure.add("coupon", mass)
    structure.link("coupon", structure.top, values["stiffness_n_per_m"], _damping(values, mass))
    structure.top = "coupon"


def _steps(values: Values, context: ShotContext) -> float:
    mass = context.known("coupon_mass_kg")
    own = math.sqrt(values["stiffness_n_per_m"] / mass)
    # what is overdamped decays faster than it would swing
    return resolving_steps(max(own, _damping(values, mass) / mass), context)


_STIFFNESS = EffectParameter(
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
)


EFFECT = Effect(
    id="adhesive_layer",
    slot="mounting",
    title="the coupon moves on its tape",
    tell_tale="the ring shifts with the coupon",
    source="two masses in series",
    validation="DOP853; stiff limit",
    parameters=(
        _STIFFNESS,
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
    variants=(
        Effect(
            id="adhesive_layer:loss_factor",
            slot="mounting",
            title="the coupon moves on its tape, which loses the same share under each",
            tell_tale="the ring shifts with the coupon",
            source="Nashif, Jones & Henderson 1985",
            validation="DOP853",
            parameters=(
                _STIFFNESS,
                EffectParameter(
                    "damping_ratio",
                    "1",
                    "rig",
                    "log",
                    0.1,
                    1e-3,
                    10.0,
                    (0.1, 0.02, 0.5),
                    "of the coupon on the layer, zeta_t",
                ),
            ),
            needs=("coupon_mass_kg",),
            structure=_structure,
            steps=_steps,
            bases=("kv", "kv2"),
        ),
    ),
)
