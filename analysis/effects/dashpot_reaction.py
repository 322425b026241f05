r"""Dashpot reaction: the dissipative force also loads the crystal.

.. math:: M\ddot\Delta = F_{el} + \lambda F_{dis} - k\Delta - \mu\dot\Delta

The paper passes the elastic force alone (lambda = 0); Newton's third law asks for lambda = 1.
Values between have no meaning but that the data cannot tell. On a rigid cell the output is the same
sum. The base model ``kv2`` holds the whole reaction already, so the effect cannot be added to it.

Source: Newton; Eqs 8-10 of Maranzano & Hancock 2016 for what it changes. Validity: any. Validation:
DOP853 of the coupled equations; momentum balance in the tests.

Scope: the rig's: a law of nature does not change with the coupon.
"""

from analysis.effects.effect import Effect, EffectParameter

EFFECT = Effect(
    id="dashpot_reaction",
    slot="contact",
    title="the dashpot pushes the crystal too (part of kv2)",
    tell_tale="early peak; the output dips below zero at lift-off",
    source="Newton's third law",
    validation="DOP853; momentum balance",
    parameters=(
        EffectParameter(
            "share",
            "1",
            "rig",
            "linear",
            1.0,
            0.0,
            1.2,
            (1.0,),
            "part of the dissipative force that reaches the crystal",
        ),
    ),
    share=lambda v: v["share"],
    bases=("hsd", "kv"),
)
