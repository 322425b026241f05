r"""Hunt-Crossley damping: a loss in proportion to the elastic force itself.

.. math:: F_{dis} \to F_{dis} + \chi K \delta^{3/2}\,\dot\delta

So 1 - eps = (2/3) chi v for small chi: the loss grows with speed. Like the base dashpot it acts on
the sphere only; in the variant ``hunt_crossley_damping:felt`` the cell feels it too, as Hunt and
Crossley's whole contact force F = K delta^(3/2) (1 + chi delta') has it. On the base
``kv2`` it does so anyway.

Source: Hunt & Crossley, J. Appl. Mech. 42 (1975) 440. Validity: small loss; a fitted law, not
derived from a material. Validation: DOP853 of the coupled equations, and the law in v, in the
tests.

Scope: the two materials'. It starts as one number of the rig, for the reason given in
`viscoelastic_damping`: the free restitution takes up what pairs lose in total.
"""

from numba import njit

from analysis.effects.effect import Effect, EffectParameter
from analysis.model.effect_solver import TERM


@njit(TERM, cache=True)
def _term(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return 0.0, p0 * elastic * rate, 0.0, 0.0


@njit(TERM, cache=True)
def _felt(delta, rate, elastic, z, p0, p1, p2, p3):  # type: ignore[no-untyped-def]  # noqa: PLR0917 - TERM has them
    return p0 * elastic * rate, 0.0, 0.0, 0.0


_PARAMETERS = (
    EffectParameter("damping_s_per_m", "s/m", "rig", "linear", 0.2, 0.0, 5.0, (0.1,), "chi"),
)

EFFECT = Effect(
    id="hunt_crossley_damping",
    slot="contact",
    title="the loss grows with force and speed",
    tell_tale="1 - eps ~ v",
    source="Hunt & Crossley 1975",
    validation="DOP853; the law in v",
    parameters=_PARAMETERS,
    contact=_term,
    pack=lambda v, c: (v["damping_s_per_m"], 0.0, 0.0, 0.0),
    variants=(
        Effect(
            id="hunt_crossley_damping:felt",
            slot="contact",
            title="the loss grows with force and speed; the cell feels it",
            tell_tale="1 - eps ~ v; early peak",
            source="Hunt & Crossley 1975",
            validation="DOP853",
            parameters=_PARAMETERS,
            contact=_felt,
            parts_by_force=True,
            bases=("hsd", "kv"),
            pack=lambda v, c: (v["damping_s_per_m"], 0.0, 0.0, 0.0),
        ),
    ),
)
