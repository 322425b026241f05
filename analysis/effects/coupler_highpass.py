r"""Coupler high-pass: the discharge of an IEPE supply, or AC coupling behind it.

.. math:: \dot V_{out} = \dot V - V_{out}/\tau

A coupler before an AC-coupled input has two poles, and its undershoot comes back through zero. Form
``coupler_highpass:two_pole``, fitted where a model names it:

.. math:: \ddot V_{out} + \dot V_{out}/\tau + V_{out}/(\tau T) = \ddot V

Two RC stages of tau_1 and tau_2 have 1/tau = 1/tau_1 + 1/tau_2 and T = tau_1 + tau_2; T below
4 tau swings, as a stage with an inductance or feedback does. Without return, T infinite, it is the
first-order coupler.

Source: RC coupling; Omega's IEPE notes; two stages: Horowitz & Hill, The Art of Electronics, ch. 1.
Validity: one time constant dominates, or two. Validation: ``scipy.signal.lsim``, the step response
exp(-t/tau), and two RC stages one behind the other in the tests.

Scope: the rig's. The signal is taken as settled before the window's first sample.
"""

import math

import numpy as np
from numba import njit

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values


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


@njit(cache=True, nogil=True)
def _propagator(rate, stiffness):  # type: ignore[no-untyped-def]
    # of y'' + rate y' + stiffness y = 0 over one sample; both are far below 1
    half = 0.5 * rate
    apart = half * half - stiffness
    bend = math.sqrt(abs(apart))
    if bend < 1e-3:
        cosine, sine = 1.0 + 0.5 * apart, 1.0 + apart / 6.0
    elif apart > 0.0:
        cosine, sine = math.cosh(bend), math.sinh(bend) / bend
    else:
        cosine, sine = math.cos(bend), math.sin(bend) / bend
    decay = math.exp(-half)
    c, s = decay * cosine, decay * sine
    return c + half * s, s, -stiffness * s, c - half * s


@njit(cache=True, nogil=True)
def _two_poles(x, rate, back):  # type: ignore[no-untyped-def]
    # y'' + rate y' + rate back y = x'', time in samples; exact for signals that are linear between
    # samples, whose bends at the samples are steps of y'. Rates may be a little below zero.
    out = np.empty_like(x)
    e11, e12, e21, e22 = _propagator(rate, rate * back)
    y, v, slope = x[0], -rate * x[0], 0.0
    out[0] = y
    for i in range(1, x.size):
        v += x[i] - x[i - 1] - slope
        slope = x[i] - x[i - 1]
        y, v = e11 * y + e12 * v, e21 * y + e22 * v
        out[i] = y
    return out


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    rate = 1.0 / (context.sample_rate_hz * values["time_constant_s"])
    found: Array = _highpass(signal, rate)
    return found


def _two_pole_output(signal: Array, values: Values, context: ShotContext) -> Array:
    rate = 1.0 / (context.sample_rate_hz * values["time_constant_s"])
    back = 1.0 / (context.sample_rate_hz * values["return_time_s"])
    found: Array = _two_poles(signal, rate, back)
    return found


_TIME_CONSTANT = EffectParameter(
    "time_constant_s",
    "s",
    "rig",
    "inverse",
    1e-3,
    5e-5,
    20.0,
    (2e-3,),
    "discharge time constant",
)

EFFECT = Effect(
    id="coupler_highpass",
    slot="electronics",
    title="the coupler forgets slow signals",
    tell_tale="undershoot after the pulse, impulse over time constant",
    source="first-order RC coupling",
    validation="lsim; step response",
    parameters=(_TIME_CONSTANT,),
    order=50,
    output=_output,
    variants=(
        Effect(
            id="coupler_highpass:two_pole",
            slot="electronics",
            title="the coupler forgets slow signals, with two poles",
            tell_tale="undershoot after the pulse that comes back through zero",
            source="two RC stages, or one that swings",
            validation="lsim; two RC stages",
            parameters=(
                _TIME_CONSTANT,
                EffectParameter(
                    "return_time_s",
                    "s",
                    "rig",
                    "inverse",
                    1e-2,
                    1e-4,
                    1e3,
                    (1e-2,),
                    "sum of two stages' time constants; below four of the first it swings",
                ),
            ),
            order=50,
            output=_two_pole_output,
            by_name=True,
        ),
    ),
)
