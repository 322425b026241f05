r"""Amplifier low-pass: the bandwidth of the chain between sensor and converter.

.. math::

    \tau\dot V_{out} + V_{out} = V, \quad \tau = 1/2\pi f_c
    \qquad\text{or}\qquad
    G(s) = \frac{\omega_c^2}{s^2 + \sqrt2\,\omega_c s + \omega_c^2}

Two forms, not a blend: the first order is the effect; Butterworth's second order is its variant
``amplifier_lowpass:second_order`` with the same single number, the -3 dB frequency. A continuous
order would be a second number that no first-order amplifier can fix, and would end on its bound.
Try both, keep the better; they differ by how sharply the ring is cut, not by the delay.

What stands in front of converters against aliases has more poles: the variants ``butterworth_3``
to ``butterworth_8`` and ``bessel_3`` to ``bessel_8``, again with the -3 dB frequency as their only
number, sections of order 1 and 2 one behind the other. They are fitted where a model names them
(``kv2+amplifier_lowpass:bessel_6``); the search for effects tries orders 1 and 2, because an order
more is little but a delay.

.. math::

    |G_{Butterworth}|^2 = \frac{1}{1 + (f/f_c)^{2n}}, \qquad
    G_{Bessel} = \frac{\theta_n(0)}{\theta_n(s/\omega_0)}

with theta_n the reverse Bessel polynomial. Order 1 of either is the effect itself. A chain of equal
RC stages is ``stages``,

.. math:: G(s) = (1 + \tau s)^{-n}

where n is a second number and need not be whole. Gauss's filter is the limit of large n: at 20 kHz,
32 stages turn a pulse of 100 us into one that differs by 0.3 % of its peak.

Source: Butterworth, Wireless Engineer 7 (1930) 536; Thomson, Proc. IEE 96 III (1949) 487; poles by
``scipy.signal.besselap``. Validity: a linear filter, settled before the record; a pulse that is
smooth over a sample. Validation: ``scipy.signal.lsim``, and the section tables that designers use,
in the tests. The neutral value is an infinite frequency.

Scope: the rig's.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.signal import besselap

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter, ShotContext, Values
from analysis.effects.resonance import curvature, resonance

Hook = Callable[[Array, Values, ShotContext], Array]


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


Section = tuple[float, float | None]
"""Natural over -3 dB frequency, and damping ratio; None for a section of order 1."""
HIGHEST_ORDER = 8
"""Poles of the steepest anti-alias filters that are made as one part."""


@cache
def butterworth_sections(order: int) -> tuple[Section, ...]:
    """Return sections whose poles lie evenly on a half circle."""
    pairs = [(1.0, math.sin(math.pi * (2 * i + 1) / (2 * order))) for i in range(order // 2)]
    return (*pairs, *([(1.0, None)] if order % 2 else []))


@cache
def bessel_sections(order: int) -> tuple[Section, ...]:
    """Return sections with the flattest delay."""
    poles = besselap(order, norm="mag")[1]
    upper = poles[poles.imag > 1e-9]
    pairs = [(float(abs(p)), float(-p.real / abs(p))) for p in upper]
    real = [(float(-p.real), None) for p in poles if abs(p.imag) <= 1e-9]
    return (*pairs, *real)


def _cascade(sections: Callable[[int], tuple[Section, ...]], order: int) -> Hook:
    def output(signal: Array, values: Values, context: ShotContext) -> Array:
        angle = 2 * math.pi * values["cutoff_hz"] / context.sample_rate_hz
        for ratio, zeta in sections(order):
            if zeta is None:
                signal = _lag(signal, 1.0 / (ratio * angle))
            else:
                signal = resonance(signal, ratio * angle, zeta)
        return signal

    return output


def _stages(signal: Array, values: Values, context: ShotContext) -> Array:
    order, cutoff = values["stages"], values["cutoff_hz"]
    tau = math.sqrt(2.0 ** (1.0 / order) - 1.0) * context.sample_rate_hz / cutoff
    # the transform takes the signal for periodic: it runs back and rests, so nothing jumps
    size = next_fast_len(3 * signal.size, real=True)
    rest = np.full(size - 2 * signal.size, signal[0])
    whole = rfft(np.concatenate([signal, signal[::-1], rest]))
    read = irfft(whole * (1.0 + 1j * tau * rfftfreq(size)) ** -order, size)
    return np.asarray(read[: signal.size])


_BESSEL_RATIO = math.sqrt((1 + math.sqrt(5)) / 2)
"""Natural over -3 dB frequency of Bessel's second order: x^4 + x^2 = 1 there."""

_PARAMETERS = (
    EffectParameter(
        "cutoff_hz",
        "Hz",
        "rig",
        "inverse",
        2e4,
        2e3,
        2e6,
        (6e4, 2e5, 2e4),
        "frequency at -3 dB",
        delays=True,
    ),
)


def _of_order(form: str, order: int) -> Effect:
    sections = {"butterworth": butterworth_sections, "bessel": bessel_sections}[form]
    return Effect(
        id=f"amplifier_lowpass:{form}_{order}",
        slot="electronics",
        title=f"the amplifier is slow, {form.capitalize()} of order {order}",
        tell_tale="delay, ring cut more sharply",
        source=form.capitalize(),
        validation="lsim; designers' tables",
        parameters=_PARAMETERS,
        order=60,
        output=_cascade(sections, order),
        by_name=True,
    )


_STAGES = Effect(
    id="amplifier_lowpass:stages",
    slot="electronics",
    title="the amplifier is slow, several equal stages",
    tell_tale="delay, ring cut more sharply",
    source="RC low-passes in a chain",
    validation="lsim",
    parameters=(
        *_PARAMETERS,
        EffectParameter(
            "stages", "1", "rig", "log", 1.0, 1.0, 32.0, (2.0, 5.0, 12.0), "equal RC stages"
        ),
    ),
    order=60,
    output=_stages,
    by_name=True,
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
        *(
            _of_order(form, order)
            for form in ("butterworth", "bessel")
            for order in range(3, HIGHEST_ORDER + 1)
        ),
        _STAGES,
    ),
)
