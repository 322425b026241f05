r"""Coupler high-pass: the discharge of an IEPE supply, or AC coupling behind it.

.. math:: \dot V_{out} = \dot V - V_{out}/\tau

Source: first-order RC coupling; Omega's IEPE notes. Validation: step response exp(-t/tau) in the
tests.
"""

import math

import numpy as np
from numba import njit

from analysis.effects.effect import Array, Effect, EffectParameter, ShotContext, Values


@njit(cache=True)
def _highpass(x, decay):  # type: ignore[no-untyped-def]
    # trapezoidal in the input: exact for signals that are linear between samples
    out = np.empty_like(x)
    y = x[0]
    out[0] = y
    gain = 1.0 if decay == 1.0 else (decay - 1.0) / math.log(decay)
    for i in range(1, x.size):
        y = decay * y + gain * (x[i] - x[i - 1])
        out[i] = y
    return out


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    tau = values["time_constant_s"]
    found: Array = _highpass(signal, math.exp(-1.0 / (context.sample_rate_hz * tau)))
    return found


EFFECT = Effect(
    id="coupler_highpass",
    slot="electronics",
    title="the coupler forgets slow signals",
    tell_tale="undershoot after the pulse, impulse over time constant",
    source="first-order RC coupling",
    validation="step response",
    parameters=(
        EffectParameter("time_constant_s", "s", "rig", "inverse", 1e-3, 5e-5, 50.0,
                        (2e-3,), "discharge time constant"),
    ),
    order=50,
    output=_output,
)
