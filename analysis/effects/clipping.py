r"""Clipping: the amplifier or the converter has a ceiling.

.. math:: V \to \min(V, V_c) \qquad\text{or}\qquad V \to V - w\,\ln(1 + e^{(V - V_c)/w})

Hard is the effect, soft its variant ``clipping:soft`` (less its value at rest); the ceiling counts
from the baseline. Above the largest sample the hard form has no derivative, so a fit starts just
below the largest excursion of the campaign (``peak_starts``).

Source: saturation; the soft form is the smooth minimum. Validity: instant recovery; the ceiling on
the compression side only. Validation: closed form in the tests.

Scope: the rig's.
"""

import numpy as np

from analysis.effects.effect import Array, Effect, EffectParameter, ShotContext, Values


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
            id="clipping:soft",
            slot="electronics",
            title="the output bends towards a ceiling",
            tell_tale="rounded flat tops",
            source="smooth minimum",
            validation="closed form",
            parameters=(
                _CEILING,
                EffectParameter(
                    "softness",
                    "1",
                    "rig",
                    "log",
                    0.05,
                    1e-3,
                    0.5,
                    (0.05,),
                    "width of the bend over the ceiling",
                ),
            ),
            order=70,
            output=_soft,
        ),
    ),
)
