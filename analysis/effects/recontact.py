r"""Recontact: the sphere meets the coupon again within the window.

.. math:: V(t) \to V(t; v_0) + V(t - T; \rho v_0)

The coupon hops or the cell swings back before the sphere is away; the ordinary bounce comes much
later and outside the fit window.

Source: superposition of two contacts on a linear cell. Validity: the first contact is over, the
second is an ordinary one at a fraction of the speed. Validation: sum of two base traces in the
tests. The neutral value is a limit, speed ratio to 0, where the pulse goes with ratio^(6/5).

Scope: the rig's; a delay that goes with the height is not in this form.
"""

from analysis.effects.effect import Effect, EffectParameter

# a second pulse far from where it is looked for has no slope towards it: look every 12 %
_DELAYS_S = tuple(1.5e-4 * 1.12**i for i in range(25))

EFFECT = Effect(
    id="recontact",
    slot="release",
    title="the sphere touches twice",
    tell_tale="second pulse",
    source="superposition",
    validation="sum of two base traces",
    parameters=(
        EffectParameter(
            "speed_ratio",
            "1",
            "rig",
            "log",
            0.1,
            5e-4,
            1.0,
            (0.1, 4e-3),
            "second impact speed over the first",
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
    ),
    again=lambda v: (v["delay_s"], v["speed_ratio"]),
)
