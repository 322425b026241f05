r"""Second mode: another resonance of the cell, behind the crystal.

.. math:: V \to V + \beta\,G_2 V, \quad G_2(s) = \frac{\omega^2}{s^2 + 2\zeta\omega s + \omega^2}

A cascade: the mode is driven by what the crystal does (a case, a mount or a cable that the crystal
shakes), not by the force on the crystal beside it. With the crystal's :math:`G_1` the output is
:math:`G_1 (1 + \beta G_2) F`. In partial fractions that is a sum of two modes whose parts in the
output are not free: the second one's is :math:`\beta G_1(s_2)`, next to opposite in sign and
falling with the square of the frequencies' ratio where it lies above the crystal, while a mode that
the force drives beside the crystal has any real part. The two agree in what rings, not in its
phase.

Source: two second-order systems in series; partial fractions as in any text on linear systems, e.g.
Oppenheim & Willsky, Signals and Systems (1997), ch. 9. Validity: the mode does not act back on the
crystal. beta may have either sign. Validation: ``scipy.signal.lsim``; poles and residues of the two
modes, in the tests.

Scope: the rig's, there is one cell.
"""

import math

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values, damping_ratio
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
    source="two second-order systems in series",
    validation="lsim; poles and residues",
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
