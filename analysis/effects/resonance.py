r"""A unit-gain resonance of second order, exact for signals that are parabolas between samples.

.. math:: \ddot q + 2\zeta\omega\dot q + \omega^2 q = \omega^2 x(t)

On a piece ``x = x0 + b t + c t (t - 1) / 2`` the solution is ``x - 2 zeta x' / omega + (4 zeta^2 -
1) x'' / omega^2`` plus a free oscillation, which the closed propagator carries on; so nothing is
lost but what the samples did not say. Straight lines would not do: a Butterworth amplifier is a
delay but for a term of third order, and what lines lose of a 20 kHz ring at 1 MHz, 1e-3, is a tenth
of that. Two effects read a signal this way: a second mode of the cell and an amplifier.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def free_oscillation(angle, zeta):  # type: ignore[no-untyped-def]
    """Return the propagator of one sample, time counted in samples.

    The angle is omega dt, > 0. The result is the rows of expm: (E11, E12, E21, E22).
    """
    loss = zeta * angle
    bend = angle * math.sqrt(abs(1.0 - zeta * zeta))
    if bend < 1e-4:
        c = math.exp(-loss)
        s = c * (1.0 + math.copysign(bend * bend / 6.0, zeta - 1.0))
    elif zeta < 1.0:
        c = math.exp(-loss) * math.cos(bend)
        s = math.exp(-loss) * math.sin(bend) / bend
    else:
        # the two decays apart, because cosh alone would overflow
        slow, fast = math.exp(bend - loss), math.exp(-bend - loss)
        c = 0.5 * (slow + fast)
        s = 0.5 * (slow - fast) / bend
    return c + loss * s, s, -angle * angle * s, c - loss * s


@njit(cache=True, nogil=True)
def curvature(x, i):  # type: ignore[no-untyped-def]
    """Return the second derivative of a signal between samples i - 1 and i, 0 < i < n.

    It is the mean of the second differences at both ends, as a cubic through the four samples
    around has it; at rest before the first sample, straight behind the last. [unit of x per
    sample^2]
    """
    before = x[i - 2] if i > 1 else x[0]
    after = x[i + 1] if i + 1 < x.size else 2.0 * x[i] - x[i - 1]
    return 0.5 * (after - x[i] - x[i - 1] + before)


@njit(cache=True, nogil=True)
def resonance(x, angle, zeta):  # type: ignore[no-untyped-def]
    """Return the response to samples ``x``, at rest on ``x[0]`` before them.

    ``angle`` is the natural angular frequency times the sample interval [rad], ``zeta`` the damping
    ratio. An infinite angle gives the input itself; a negative one, as a step across that neutral
    point gives it, turns the delay 2 zeta / angle round.
    """
    out = np.empty_like(x)
    q, v = x[0], 0.0
    out[0] = q
    lag = 2.0 * zeta / angle
    bent = (4.0 * zeta * zeta - 1.0) / (angle * angle)
    e11 = e12 = e21 = e22 = 0.0
    settles_within_a_sample = angle < 0.0 or zeta * angle > 600.0 or angle > 1e6
    if not settles_within_a_sample:
        e11, e12, e21, e22 = free_oscillation(angle, zeta)
    for i in range(1, x.size):
        c = curvature(x, i)
        slope = x[i] - x[i - 1] - 0.5 * c
        f = q - (x[i - 1] - lag * slope + bent * c)
        g = v - (slope - lag * c)
        slope += c
        q = e11 * f + e12 * g + x[i] - lag * slope + bent * c
        v = e21 * f + e22 * g + slope - lag * c
        out[i] = q
    return out
