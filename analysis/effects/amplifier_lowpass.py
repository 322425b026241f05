r"""Amplifier low-pass: the bandwidth of what stands between sensor and converter.

.. math::

    \tau\dot V_{out} + V_{out} = V, \quad \tau = 1/2\pi f_c
    \qquad\text{or}\qquad
    G(s) = \frac{\omega_c^2}{s^2 + \sqrt2\,\omega_c s + \omega_c^2}

Two forms, not a blend: the first order is the effect; Butterworth's second order is its variant
``amplifier_lowpass:second_order`` with the same single number, the -3 dB frequency. A continuous
order would be a second number that no first-order amplifier can fix, and would end on its bound.
Try both, keep the better; they differ by how sharply the ring is cut, not by the delay.

Source: textbook filters. Validity: one stage dominates. Validation: ``scipy.signal.lsim`` in the
tests. The neutral value is an infinite frequency.

Scope: the rig's.
"""

import math

import numpy as np
from numba import njit

from analysis.effects.effect import Array, Effect, EffectParameter, ShotContext, Values
from analysis.effects.resonance import curvature, resonance


@njit(cache=True, nogil=True)
def _lag(x, tau):  # type: ignore[no-untyped-def]
    # tau in samples; exact for parabolas between samples, at rest before the first.
    # A step to the other side of tau = 0 turns the delay round.
    out = np.empty_like(x)
    decay = math.exp(-1.0 / tau) if tau > 0.0 else 0.0
    y = x[0]
    out[0] = y
    for i in range(1, x.size):
        c = curvature(x, i)
        behind = tau * (x[i] - x[i - 1] - (0.5 + tau) * c)
        y = decay * (y - x[i - 1] + behind) + x[i] - behind - tau * c
        out[i] = y
    return out


def _first(signal: Array, values: Values, context: ShotContext) -> Array:
    found: Array = _lag(signal, context.sample_rate_hz / (2 * math.pi * values["cutoff_hz"]))
    return found


def _second(signal: Array, values: Values, context: ShotContext) -> Array:
    angle = 2 * math.pi * values["cutoff_hz"] / context.sample_rate_hz
    found: Array = resonance(signal, angle, math.sqrt(0.5))
    return found


def _bessel(signal: Array, values: Values, context: ShotContext) -> Array:
    angle = 2 * math.pi * _BESSEL_RATIO * values["cutoff_hz"] / context.sample_rate_hz
    found: Array = resonance(signal, angle, math.sqrt(0.75))
    return found


_BESSEL_RATIO = math.sqrt((1 + math.sqrt(5)) / 2)
"""Natural over -3 dB frequency of Bessel's second order: x^4 + x^2 = 1 there."""

_PARAMETERS = (
    EffectParameter(
        "cutoff_hz", "Hz", "rig", "inverse", 2e4, 2e3, 2e6, (6e4, 2e5, 2e4), "frequency at -3 dB"
    ),
)


EFFECT = Effect(
    id="amplifier_lowpass",
    slot="electronics",
    title="the amplifier is slow",
    tell_tale="delay, lower ring",
    source="RC low-pass",
    validation="lsim",
    parameters=_PARAMETERS,
    order=60,
    output=_first,
    variants=(
        Effect(
            id="amplifier_lowpass:second_order",
            slot="electronics",
            title="the amplifier is slow, second order",
            tell_tale="delay, ring cut more sharply",
            source="Butterworth",
            validation="lsim",
            parameters=_PARAMETERS,
            order=60,
            output=_second,
        ),
        Effect(
            id="amplifier_lowpass:bessel",
            slot="electronics",
            title="the amplifier is slow, second order without overshoot",
            tell_tale="delay, ring cut more sharply",
            source="Bessel",
            validation="lsim",
            parameters=_PARAMETERS,
            order=60,
            output=_bessel,
        ),
    ),
)
