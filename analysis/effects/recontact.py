r"""Recontact: the sphere meets the coupon again within the window.

.. math:: V(t) \to V(t; v_0) + V(t - T; \rho v_0)

The coupon hops or the cell swings back before the sphere is away; the ordinary bounce comes much
later and outside the fit window. A second contact that is slow bounces on: with a rebound speed u
the sphere is back after 2 u / g, and again, until its weight keeps it down; on ``kv2`` a little
earlier, as it left a surface that was still indented and recovers. All contacts have the
law and the structure that the other effects of the model make of them, but where its weight presses
the sphere more than its speed does. At the end the cell bears that weight.

Two forms: the second contact is added to the ring of the first (the effect), or it meets the
structure as the first has left it (``recontact:ringing``), at the given speed relative to it.

Source: superposition of contacts on a linear cell, or continued integration; free flight between
them. Validity: the first contact is over; added, the ring no longer moves the surface as fast as
the sphere comes back. Validation: sums of single traces; DOP853 of both contacts for the ringing
form; the weight at rest, in the tests. The neutral value of the added form is a limit, speed ratio
to 0, where the pulse goes with ratio^(6/5).

Scope: the rig's; a delay that goes with the height is not in this form.
"""

from dataclasses import replace

from analysis.effects.effect import Effect, EffectParameter, Values

# a second pulse far from where it is looked for has no slope towards it: look every 12 %
_DELAYS_S = tuple(1.5e-4 * 1.12**i for i in range(25))

# a slow sphere hops on, and its speed says when it is back
_HOPS = (0.25, 0.35, 0.5, 0.63, 0.8, 1.25, 1.6, 2.0, 2.8, 4.0)

_PARAMETERS = (
    EffectParameter(
        "speed_ratio",
        "1",
        "rig",
        "log",
        0.1,
        5e-4,
        1.0,
        (0.1, 4e-3, 1.5e-3),
        "second impact speed over the first",
        valleys=_HOPS,
    ),
    EffectParameter(
        "delay_s",
        "s",
        "rig",
        "log",
        1e-3,
        1e-4,
        0.3,
        _DELAYS_S,
        "from first to second touch-down",
    ),
)


def _again(values: Values) -> tuple[float, float]:
    return values["delay_s"], values["speed_ratio"]


EFFECT = Effect(
    id="recontact",
    slot="release",
    title="the sphere touches twice",
    tell_tale="second pulse",
    source="superposition",
    validation="sum of single traces",
    parameters=_PARAMETERS,
    again=_again,
    variants=(
        Effect(
            id="recontact:ringing",
            slot="release",
            title="the sphere touches twice, the second time on a ringing cell",
            tell_tale="second pulse",
            source="own",
            validation="DOP853",
            parameters=tuple(replace(p, starts=p.starts[:1]) for p in _PARAMETERS),
            again=_again,
            rides=True,
        ),
    ),
)
