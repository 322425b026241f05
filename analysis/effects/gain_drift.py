r"""Gain drift: the sensitivity of the chain changes steadily from the first drop to the last.

.. math:: V \to V (1 + d\, p), \quad p = -1/2 \ldots 1/2

p is the shot's place in the order of its campaign, d the change from the first to the last. A
crystal and an amplifier that warm up do this; sensitivities of piezoelectric force sensors move by
up to 0.1 % per kelvin, so that an afternoon may be worth some tenths of a per cent. In the middle
of the campaign the gain is that of the base model.

What tells it from the speeds is that these are stated: heights and their repeatability hold the
amplitude, and nothing in a height knows of the order. Drops of one height alone, or of heights in
rising order, leave it to the stated speeds only.

A drift of the time base has no effect here. Crystal oscillators keep to some 10 ppm over a room's
temperatures, and 100 ppm move a modulus by 0.025 %: a whole day is worth 0.003 %, below all else.
The time base's own uncertainty, which all shots share, is an input (``sample_rate_u_relative``).

Source: a linear law, the first term of any slow drift; sizes as in data sheets of sensors.
Validity: shots at about equal intervals, changes of some per cent. Validation: gains that grow by a
known amount over a simulated campaign, in the tests. The neutral value is 0.

Scope: the rig's. Fitted where a model names it (``kv2+gain_drift``); the search for effects has a
closure for what drifts.
"""

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    return signal * (1.0 + values["relative_change"] * context.place)


EFFECT = Effect(
    id="gain_drift",
    slot="electronics",
    title="the gain drifts from drop to drop",
    tell_tale="amplitudes rise or fall with the order of the drops, whatever the height",
    source="first term of any slow drift",
    validation="a gain that grows over a simulated campaign",
    parameters=(
        EffectParameter(
            "relative_change",
            "1",
            "rig",
            "linear",
            0.05,
            -0.5,
            0.5,
            (0.01,),
            "from the first drop to the last",
        ),
    ),
    order=45,
    output=_output,
    by_name=True,
)
