r"""Mains hum: the mains and its harmonics, of free size and phase in every shot.

.. math:: V \to V + \sum_{h=1}^{3..7} a_h \cos 2\pi h f t + b_h \sin 2\pi h f t

A fit window is a few milliseconds, a fraction of a period. There the mains frequency itself cannot
be told (0.1 % off is 1e-4 rad) and is not fitted; 50 Hz is the effect, 60 Hz its variant
``mains_hum:60_hz``. For the same reason the columns are made orthogonal, to one another and to the
baseline, with an rms of 1: they span the same signals, and their sizes are well determined where
those of sines and cosines would be differences of large numbers. Over less than a quarter of a
period they are the six signals that hold most of seven harmonics falling as 1/h (singular vectors):
of 80 mV of odd harmonics they leave 0.07 mV in 4 ms. Over longer windows they are three harmonics.

Over so little of a period a baseline that drifts looks the same. ``mains_hum:drift``, a polynomial
with free coefficients in every shot, is no effect of the library: hum is compared with it.

Source: Fourier. Validity: hum that is periodic over the record. Validation: a synthetic hum is in
the span, in the tests. The sizes are neutral at 0.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander

from analysis.aliases import Array
from analysis.effects.effect import Effect, ShotContext

_HARMONICS = 7
_SIZE = 6
_SHORT = 0.25
"""Of a period."""
_DEGREE = 4
"""Of the polynomial. Derived: it leaves at most 1 % of a sine's power over one period, whatever its
phase, and at least 32 % over two."""


@lru_cache(maxsize=64)
def _columns(mains_hz: float, sample_rate_hz: float, samples: int) -> Array:
    # phases are free, so they may as well count from the middle of the window, which keeps the
    # columns apart as long as possible and makes them the same for every shot
    phase = 2 * np.pi * mains_hz * (np.arange(samples) - samples // 2) / sample_rate_hz
    columns = [np.ones(samples)]
    for h in range(1, _HARMONICS + 1):
        columns += [np.cos(h * phase) / h, np.sin(h * phase) / h]
    hum = np.stack(columns, axis=1)
    if mains_hz * samples / sample_rate_hz < _SHORT:
        varying = hum[:, 1:] - hum[:, 1:].mean(axis=0)
        most = np.linalg.svd(varying, full_matrices=False)[0][:, :_SIZE]
    else:
        most = np.linalg.qr(hum[:, : 1 + _SIZE])[0][:, 1:]
    signed: Array = most * np.sign(most[-1]) * np.sqrt(samples)
    signed.flags.writeable = False
    return signed


def _hum(mains_hz: float) -> Callable[[int, ShotContext], Array]:
    return lambda samples, context: _columns(mains_hz, context.sample_rate_hz, samples)


def _drift(samples: int, context: ShotContext) -> Array:
    orders = legvander(np.linspace(-1.0, 1.0, samples), _DEGREE)[:, 1:]
    return np.asarray(orders * np.sqrt(2.0 * np.arange(1, _DEGREE + 1) + 1.0))


EFFECT = Effect(
    id="mains_hum",
    slot="electronics",
    title="mains hum and its harmonics",
    tell_tale="present before the trigger",
    source="Fourier",
    validation="span of a synthetic hum",
    parameters=(),
    basis=_hum(50.0),
    basis_size=_SIZE,
    variants=(
        Effect(
            id="mains_hum:60_hz",
            slot="electronics",
            title="mains hum of 60 Hz and its harmonics",
            tell_tale="present before the trigger",
            source="Fourier",
            validation="span of a synthetic hum",
            parameters=(),
            basis=_hum(60.0),
            basis_size=_SIZE,
        ),
    ),
    lookalikes=(
        Effect(
            id="mains_hum:drift",
            slot="electronics",
            title="the baseline drifts",
            tell_tale="no period before the trigger",
            source="own",
            validation="closed form",
            parameters=(),
            basis=_drift,
            basis_size=_DEGREE,
        ),
    ),
)
