r"""Second mode: another resonance of the cell, read in parallel.

.. math:: V \to V + \beta\,G_2 V, \quad G_2(s) = \frac{\omega^2}{s^2 + 2\zeta\omega s + \omega^2}

Source: modal sum of a linear sensor, truncated at one more mode. Validity: the mode does not act
back on the contact. beta may have either sign. Validation: ``scipy.signal.lsim`` in the tests.

Scope: the rig's, there is one cell.
"""

import math

from analysis.effects.effect import (
    Array,
    Effect,
    EffectParameter,
    ShotContext,
    Values,
    damping_ratio,
)
from analysis.effects.resonance import resonance


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    angle = 2 * math.pi * values["frequency_hz"] / context.sample_rate_hz
    found: Array = signal + values["share"] * resonance(signal, angle, values["damping_ratio"])
    return found


# a ring seen over many periods has no slope towards another frequency: look every 12 %
_FREQUENCIES_HZ = tuple(1.5e4 * 1.12**i for i in range(21))

EFFECT = Effect(
    id="second_mode",
    slot="sensor",
    title="the cell has a second resonance",
    tell_tale="beat on the ring",
    source="modal sum",
    validation="lsim",
    parameters=(
        EffectParameter(
            "share",
            "1",
            "rig",
            "linear",
            0.2,
            -2.0,
            2.0,
            (0.05, -0.1),
            "static part of the mode in the output, beta",
        ),
        EffectParameter(
            "frequency_hz",
            "Hz",
            "rig",
            "log",
            3e4,
            5e3,
            5e5,
            _FREQUENCIES_HZ,
            "natural frequency",
            resolved=True,
        ),
        damping_ratio(0.03, most=0.4, of="of the mode"),
    ),
    order=10,
    output=_output,
)
