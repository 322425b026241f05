r"""Plate radiation: the ground recedes under the force and carries energy away as waves.

.. math:: \dot\delta = \dot x - \dot\Delta - F/Z

Source: Zener, Phys. Rev. 59 (1941) 669: a thin plate answers a point force with a velocity F/Z,
Z = 8 sqrt(D rho h), until its edge reflects. Validity: contact shorter than the way to the edge and
back. F is the whole contact force, the dashpot's part included (Newton's third law); the variant
``plate_radiation:elastic`` lets only the elastic part move the plate, as the paper lets only that
part load the crystal. Validation: DOP853 of the coupled equations; Zener's first-order loss in the
tests.

Scope: the rig's, because the plate that can radiate is the cap or the stand; a coupon bonded flat
does not flex by itself.
"""

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return 0.0, 0.0, 0.0, p0 * elastic


_PARAMETERS = (
    EffectParameter(
        "impedance_n_s_per_m",
        "N s/m",
        "rig",
        "inverse",
        100.0,
        5.0,
        1e4,
        (300.0,),
        "point impedance of the plate, Z",
    ),
)

EFFECT = Effect(
    id="plate_radiation",
    slot="contact",
    title="the ground radiates waves",
    tell_tale="loss without ringing, longer contact",
    source="Zener 1941",
    validation="DOP853; Zener's loss",
    parameters=_PARAMETERS,
    mobility=lambda v: 1.0 / v["impedance_n_s_per_m"],
    variants=(
        Effect(
            id="plate_radiation:elastic",
            slot="contact",
            title="the ground radiates waves, moved by the elastic force alone",
            tell_tale="loss without ringing, longer contact",
            source="Zener 1941",
            validation="DOP853; Zener's loss",
            parameters=_PARAMETERS,
            contact=_term,
            pack=lambda v, c: (1.0 / v["impedance_n_s_per_m"], 0.0, 0.0, 0.0),
        ),
    ),
)
