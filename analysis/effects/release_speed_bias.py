r"""Release speed bias: the sphere falls from another height than the scale says.

.. math:: \ln v_0 \to \ln v_0 + \tfrac12 \ln(1 + \Delta h/h)

Suction holds the sphere above the tube's edge, or the edge is not where the scale's zero is.

Anything else that changes the speed with the height looks much the same from a few heights: three
of them, with a gain that is free, leave one number in which the laws differ. So the name has to be
told from a loss of the same speed in every drop (an eddy-current brake) and from drag, both below;
where it cannot be, the verdict is "family", with the drop that would tell.

Source: free fall. Validity: the same offset at all heights, above -h. Validation: closed form in
the tests.

Scope: the rig's, it is the tube's.
"""

import math
from collections.abc import Callable

from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values

SpeedLaw = Callable[[Values, ShotContext], float]


def _speed(values: Values, context: ShotContext) -> float:
    relative = values["height_offset_m"] / context.known("drop_height_m")
    # a sphere that starts below the coupon has no speed; a fit steps back from there
    return 0.5 * math.log1p(relative) if relative > -1.0 else math.nan


def _less(values: Values, context: ShotContext) -> float:
    speed = math.sqrt(2.0 * context.gravity_m_per_s2 * context.known("drop_height_m"))
    relative = values["speed_loss_m_per_s"] / speed
    return math.log1p(-relative) if relative < 1.0 else math.nan


def _dragged(values: Values, context: ShotContext) -> float:
    way = 2.0 * values["drag_per_m"] * context.known("drop_height_m")
    return 0.5 * math.log(-math.expm1(-way) / way) if way else 0.0


def _lookalike(form: str, title: str, parameter: EffectParameter, speed: SpeedLaw) -> Effect:
    return Effect(
        id=f"release_speed_bias:{form}",
        slot="release",
        title=title,
        tell_tale="amplitude law off in the drop height",
        source="own",
        validation="closed form",
        parameters=(parameter,),
        needs=("drop_height_m",),
        speed=speed,
    )


_SAME_LOSS = EffectParameter(
    "speed_loss_m_per_s", "m/s", "rig", "linear", 2e-2, -0.5, 0.5, (1e-3,), "speed lost on the way"
)
_DRAG = EffectParameter(
    "drag_per_m", "1/m", "rig", "linear", 0.1, -5.0, 5.0, (1e-2,), "drag over weight and speed^2"
)
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
    lookalikes=(
        _lookalike("same_loss", "every drop loses the same speed", _SAME_LOSS, _less),
        _lookalike("drag", "air or a seal brakes the fall", _DRAG, _dragged),
    ),
)
