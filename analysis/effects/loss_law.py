r"""Loss law: the contact loses energy by another published law than the base model's.

.. math:: F_{dis} \to (1 - s)\,F_{dis} + s\,F

with Hunt and Crossley's dashpot, or Kuwabara and Kono's (``loss_law:kuwabara_kono``),

.. math::

    F = \chi K \delta^{3/2} \dot\delta, \quad \chi = \frac32 \frac{1 - e}{e\,v}
    \qquad\text{or}\qquad
    F = \tfrac32 A K \sqrt\delta\,\dot\delta, \quad
    A = \frac23 \frac{1 - e}{C_1\,e} \frac{d}{v}, \quad d = \left(\frac{m v^2}{K}\right)^{2/5}

The base's dashpot is Tsuji's. Each impact has a loss of its own, e, in any of these laws, so that
only how the force is spread over the contact tells them apart. s is 1 and is not fitted: a
fitted s takes up what other effects do that the model lacks. The error of the law itself is that of
every named effect (`analysis.diagnosis.basis.form_error`).
The library's ``hunt_crossley_damping`` and ``viscoelastic_damping`` are something else: a loss
beside the base's, with one constant for many impacts.

Source: Hunt & Crossley 1975; Kuwabara & Kono 1987, C_1 = 1.15344 (Ramirez et al., Phys. Rev. E 60
(1999) 4465). Both constants are exact for small losses; beyond, e only counts the loss. Validity:
any restitution. Validation: DOP853 of the coupled equations in the tests.

Scope: the rig's: which law a contact obeys is no property of one coupon.
"""

import math

from numba import njit

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.model.effect_solver import TERM

_C1 = 1.15344


@njit(TERM, cache=True)
def _hunt_crossley(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return 0.0, p0 * elastic * rate, 0.0, 0.0


@njit(TERM, cache=True)
def _kuwabara_kono(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return 0.0, p0 * math.sqrt(max(delta, 0.0)) * rate, 0.0, 0.0


def _lost(context: ShotContext) -> float:
    """Return (1 - e) / (e v). [s/m]"""
    return (1.0 / context.restitution - 1.0) / context.speed_m_per_s


def _by_hunt_crossley(values: Values, context: ShotContext) -> tuple[float, ...]:
    return values["share"] * 1.5 * _lost(context), 0.0, 0.0, 0.0


def _by_kuwabara_kono(values: Values, context: ShotContext) -> tuple[float, ...]:
    inertia = context.mass_kg * context.speed_m_per_s**2 / context.stiffness
    force = context.stiffness * _lost(context) * inertia**0.4 / _C1
    return values["share"] * force, 0.0, 0.0, 0.0


def _base_dashpot(values: Values) -> float:
    return 1.0 - values["share"]


_PARAMETERS = (
    EffectParameter(
        "share",
        "1",
        "rig",
        "linear",
        1.0,
        0.95,
        1.05,
        (1.0,),
        "of the loss that obeys this law",
        exact=1.0,
    ),
)

EFFECT = Effect(
    id="loss_law",
    slot="contact",
    title="the contact loses energy as Hunt and Crossley have it, not as the base model does",
    tell_tale="loss late in the contact",
    source="Hunt & Crossley 1975",
    validation="DOP853",
    parameters=_PARAMETERS,
    contact=_hunt_crossley,
    pack=_by_hunt_crossley,
    base_dashpot=_base_dashpot,
    variants=(
        Effect(
            id="loss_law:kuwabara_kono",
            slot="contact",
            title="the contact loses energy as Kuwabara and Kono have it, not as the base does",
            tell_tale="loss later in the contact",
            source="Kuwabara & Kono 1987",
            validation="DOP853",
            parameters=_PARAMETERS,
            contact=_kuwabara_kono,
            pack=_by_kuwabara_kono,
            base_dashpot=_base_dashpot,
        ),
    ),
)
