r"""Release speed bias: the sphere falls from another height than the scale says.

.. math:: \ln v_0 \to \ln v_0 + \tfrac12 \ln(1 + \Delta h/h)

Suction holds the sphere above the tube's edge, or the edge is not where the scale's zero is.

Source: free fall. Validity: the same offset at all heights, above -h. Validation: closed form in
the tests.

Scope: the rig's, it is the tube's.
"""

import math

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values


def _speed(values: Values, context: ShotContext) -> float:
    relative = values["height_offset_m"] / context.known("drop_height_m")
    # a sphere that starts below the coupon has no speed; a fit steps back from there
    return 0.5 * math.log1p(relative) if relative > -1.0 else math.nan


EFFECT = Effect(
    id="release_speed_bias",
    slot="release",
    title="the true drop height is another",
    tell_tale="amplitude law off in the drop height",
    source="free fall",
    validation="closed form",
    parameters=(
        EffectParameter(
            "height_offset_m",
            "m",
            "rig",
            "linear",
            5e-3,
            -5e-2,
            5e-2,
            (1e-3,),
            "true height less the stated one",
        ),
    ),
    needs=("drop_height_m",),
    speed=_speed,
)
