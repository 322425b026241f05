r"""Clipping: the amplifier or the converter has a ceiling.

.. math:: V \to \min(V, V_c) \qquad\text{or}\qquad V \to V - w\,\ln(1 + e^{(V - V_c)/w})

Hard is the effect, soft its variant ``clipping:soft`` (less its value at rest); the ceiling counts
from the baseline. An amplifier ends on both sides, which shows where the ring swings back beyond
the ceiling: ``clipping:both_sides``, and ``clipping:rational`` for an end that is not abrupt,

.. math:: V \to V\,(1 + |V/V_c|^{1/s})^{-s}

s = 1/2 is near a hyperbolic tangent. Above the largest sample the hard forms have no derivative, so
a fit starts just below the largest excursion of the campaign (``peak_starts``).

Source: saturation; the smooth minimum; Rapp, Proc. 2nd European Conf. Satellite Communications
(1991) 179, for the rational form. Validity: instant recovery. Validation: closed forms in the
tests.

Scope: the rig's.
"""

import numpy as np

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values


def _hard(signal: Array, values: Values, context: ShotContext) -> Array:
    ceiling = values["ceiling_v"]
    # a ceiling at or below rest is the far side of "none", reached by a step across coordinate 0
    return np.minimum(signal, ceiling) if ceiling > 0.0 else signal.copy()


def _soft(signal: Array, values: Values, context: ShotContext) -> Array:
    ceiling = values["ceiling_v"]
    if not 0.0 < ceiling < np.inf:
        return signal.copy()
    width = values["softness"] * ceiling
    at_rest = np.logaddexp(0.0, -ceiling / width)
    found: Array = signal - width * (np.logaddexp(0.0, (signal - ceiling) / width) - at_rest)
    return found


def _both(signal: Array, values: Values, context: ShotContext) -> Array:
    ceiling = values["ceiling_v"]
    return np.clip(signal, -ceiling, ceiling) if ceiling > 0.0 else signal.copy()


def _rational(signal: Array, values: Values, context: ShotContext) -> Array:
    ceiling, power = values["ceiling_v"], 1.0 / values["softness"]
    if not 0.0 < ceiling < np.inf:
        return signal.copy()
    # logarithms, because powers of a thousand overflow
    with np.errstate(divide="ignore"):
        depth = np.logaddexp(0.0, power * np.log(np.abs(signal) / ceiling))
    found: Array = signal * np.exp(-depth / power)
    return found


def _softness(description: str) -> EffectParameter:
    starts = (0.05, 0.25)  # an end as good as abrupt is a valley of its own
    return EffectParameter("softness", "1", "rig", "log", 0.05, 1e-3, 0.5, starts, description)


_CEILING = EffectParameter(
    "ceiling_v",
    "V",
    "rig",
    "inverse",
    1.0,
    0.02,
    100.0,
    (5.0, 1.0),
    "largest output above the baseline, V_c",
    peak_starts=(0.98, 0.8),
)


EFFECT = Effect(
    id="clipping",
    slot="electronics",
    title="the output has a ceiling",
    tell_tale="flat tops of equal height",
    source="saturation",
    validation="closed form",
    parameters=(_CEILING,),
    order=70,
    output=_hard,
    variants=(
        Effect(
            id="clipping:both_sides",
            slot="electronics",
            title="the output has a ceiling and a floor",
            tell_tale="flat tops of equal height, also of the swing back",
            source="saturation",
            validation="closed form",
            parameters=(_CEILING,),
            order=70,
            output=_both,
        ),
        Effect(
            id="clipping:soft",
            slot="electronics",
            title="the output bends towards a ceiling",
            tell_tale="rounded flat tops",
            source="smooth minimum",
            validation="closed form",
            parameters=(_CEILING, _softness("width of the bend over the ceiling")),
            order=70,
            output=_soft,
        ),
        Effect(
            id="clipping:rational",
            slot="electronics",
            title="the output bends towards a ceiling and a floor",
            tell_tale="rounded flat tops, also of the swing back",
            source="Rapp 1991",
            validation="closed form",
            parameters=(_CEILING, _softness("inverse of the power with which it bends, s")),
            order=70,
            output=_rational,
        ),
    ),
)
