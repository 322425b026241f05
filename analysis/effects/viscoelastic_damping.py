r"""Viscoelastic damping: loss in the bulk of the contact, proportional to the rate of strain.

.. math:: F_{dis} \to F_{dis} + \tfrac32 A K \sqrt{\delta}\,\dot\delta

It is the rate of Hertz's force times a time constant A, hence a loss that grows with speed, where
the base dashpot's is the same at every speed: on a rigid cell

.. math:: 1 - \epsilon = C_1\,\tfrac32 A\,(K/m)^{2/5} v^{1/5} + O(A^2), \quad C_1 = 1.15344

Like the base dashpot it acts on the sphere only.
In the variant ``viscoelastic_damping:felt`` the cell feels this force too, as Newton's third law
asks of a stress in the bodies, while the base dashpot spares it as before. On the base ``kv2`` it
feels both anyway.

Source: Kuwabara & Kono, Jpn J. Appl. Phys. 26 (1987) 1230; Brilliantov et al., Phys. Rev. E 53
(1996) 5382; C_1: Schwager & Poeschel, Phys. Rev. E 57 (1998) 650, Ramirez et al., Phys. Rev. E 60
(1999) 4465. Validity: A much shorter than the contact time; no adhesion. Validation: DOP853 of the
coupled equations, and the v^(1/5) law with C_1, in the tests.

Scope: a property of the two materials. It starts as one number of the rig all the same: restitution
is free in every shot and takes up what pairs lose in total, so what is left for this law is how the
loss depends on speed and on the moment within the contact, and one number is the smallest
hypothesis about that. Sphere or surface come second.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return 0.0, p0 * math.sqrt(max(delta, 0.0)) * rate, 0.0, 0.0


@njit(TERM, cache=True)
def _felt(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return p0 * math.sqrt(max(delta, 0.0)) * rate, 0.0, 0.0, 0.0


_PARAMETERS = (
    EffectParameter(
        "dissipation_time_s",
        "s",
        "rig",
        "linear",
        1e-5,
        0.0,
        1e-4,
        (1e-6,),
        "A, viscous over elastic modulus",
    ),
)

EFFECT = Effect(
    id="viscoelastic_damping",
    slot="contact",
    title="the material loses energy with the rate of strain",
    tell_tale="loss grows with speed, 1 - eps ~ v^(1/5)",
    source="Kuwabara & Kono 1987; Brilliantov et al. 1996",
    validation="DOP853; the v^(1/5) law and its C_1",
    parameters=_PARAMETERS,
    contact=_term,
    pack=lambda v, c: (1.5 * v["dissipation_time_s"] * c.stiffness, 0.0, 0.0, 0.0),
    variants=(
        Effect(
            id="viscoelastic_damping:felt",
            slot="contact",
            title="the material loses energy with the rate of strain; the cell feels it",
            tell_tale="loss grows with speed, 1 - eps ~ v^(1/5); early peak",
            source="Kuwabara & Kono 1987; Brilliantov et al. 1996",
            validation="DOP853",
            parameters=_PARAMETERS,
            contact=_felt,
            parts_by_force=True,
            bases=("hsd", "kv"),
            pack=lambda v, c: (1.5 * v["dissipation_time_s"] * c.stiffness, 0.0, 0.0, 0.0),
        ),
    ),
)
