r"""Echo: a delayed copy of the signal, from a cable's end or a wave's way through the coupon.

.. math:: V \to V(t) + r\,V(t - T)

Between samples the delayed copy is a polynomial of fifth degree through six of them; at 1 MHz its
error on a 20 kHz signal is below 1e-6 of the amplitude.

Source: one reflection. Validity: one path; what it loses per frequency is left out. r may be
negative (reflection at a softer end). Validation: closed forms of delayed signals in the tests.

Scope: the rig's, as a cable; an echo in the coupon would be the surface's.
"""

import math

import numpy as np
from numba import njit

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values

_NODES = 6


@njit(cache=True, nogil=True)
def _weights(out, at):  # type: ignore[no-untyped-def]
    """Write Lagrange's weights of nodes 0..5 for position ``at``."""
    for k in range(_NODES):
        w = 1.0
        for m in range(_NODES):
            if m != k:
                w *= (at - m) / (k - m)
        out[k] = w


@njit(cache=True, nogil=True)
def _delayed(x, delay):  # type: ignore[no-untyped-def]
    """Return ``x`` later by ``delay`` samples; at rest on ``x[0]`` before its start."""
    n = x.size
    out = np.empty_like(x)
    weights = np.empty(_NODES)
    whole = math.ceil(delay)
    # the wanted point lies between the stencil's third and fourth sample
    _weights(weights, 2.0 + (whole - delay))
    w0, w1, w2 = weights[0], weights[1], weights[2]
    w3, w4, w5 = weights[3], weights[4], weights[5]
    early, late = min(whole + 2, n), min(max(whole + 2, n + whole + 3 - _NODES), n)
    for i in range(early):
        first = i - whole - 2
        if first <= -_NODES:
            out[i] = x[0]
            continue
        total = 0.0
        for k in range(_NODES):
            total += weights[k] * x[min(max(first + k, 0), n - 1)]
        out[i] = total
    for i in range(early, late):
        f = i - whole - 2
        near = w0 * x[f] + w1 * x[f + 1] + w2 * x[f + 2]
        out[i] = near + w3 * x[f + 3] + w4 * x[f + 4] + w5 * x[f + 5]
    # the stencil would reach past the end: move it in
    for i in range(late, n):
        first = n - _NODES
        _weights(weights, i - delay - first)
        total = 0.0
        for k in range(_NODES):
            total += weights[k] * x[max(first + k, 0)]
        out[i] = total
    return out


def _output(signal: Array, values: Values, context: ShotContext) -> Array:
    # what is later than the whole record is as good as never
    delay = min(values["delay_s"] * context.sample_rate_hz, float(signal.size))
    found: Array = signal + values["strength"] * _delayed(signal, delay)
    return found


EFFECT = Effect(
    id="echo",
    slot="electronics",
    title="a delayed copy of the signal",
    tell_tale="delayed copy in the residual",
    source="one reflection",
    validation="closed forms",
    parameters=(
        EffectParameter("strength", "1", "rig", "linear", 0.1, -1.0, 1.0, (0.03,), "r"),
        EffectParameter(
            "delay_s", "s", "rig", "log", 1e-5, 1e-7, 6e-4, (1.2e-5, 3e-6, 3e-5, 6e-5), "T"
        ),
    ),
    order=30,
    output=_output,
)
