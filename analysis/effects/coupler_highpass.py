r"""Coupler high-pass: the discharge of an IEPE supply, or AC coupling behind it.

.. math:: \dot V_{out} = \dot V - V_{out}/\tau

Source: first-order RC coupling; Omega's IEPE notes. Validity: one time constant dominates.
Validation: ``scipy.signal.lsim`` and the step response exp(-t/tau) in the tests.

Scope: the rig's. The signal is taken as settled before the window's first sample.
"""

import math

import numpy as np
from numba import njit

from analysis.effects.effect import Array, Effect, EffectParameter, ShotContext, Values


@njit(cache=True, nogil=True)
def _highpass(x, rate):  # type: ignore[no-untyped-def]
    # rate: samples over the time constant; exact for signals that are linear between samples
    out = np.empty_like(x)
    decay = math.exp(-rate)
    gain = -math.expm1(-rate) / rate if rate != 0.0 else 1.0
    y = x[0]
    out[0] = y
    for i in range(1, x.size):
        y = decay * y + gain * (x[i] - x[i - 1])
        out[i] = y
    return out


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    rate = 1.0 / (context.sample_rate_hz * values["time_constant_s"])
    found: Array = _highpass(signal, rate)
    return found


EFFECT = Effect(
    id="coupler_highpass",
    slot="electronics",
    title="the coupler forgets slow signals",
    tell_tale="undershoot after the pulse, impulse over time constant",
    source="first-order RC coupling",
    validation="lsim; step response",
    parameters=(
        EffectParameter(
            "time_constant_s",
            "s",
            "rig",
            "inverse",
            1e-3,
            5e-5,
            20.0,
            (2e-3,),
            "discharge time constant",
        ),
    ),
    order=50,
    output=_output,
)
