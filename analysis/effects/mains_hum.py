r"""Mains hum: the mains and its harmonics, of free size and phase in every shot.

.. math:: V \to V + \sum_{h=1}^{3} a_h \cos 2\pi h f t + b_h \sin 2\pi h f t

A fit window is a few milliseconds, a fraction of a period. There the mains frequency itself cannot
be told (0.1 % off is 1e-4 rad) and is not fitted; 50 Hz is the effect, 60 Hz its variant
``mains_hum:60_hz``. For the same reason the columns are made orthogonal, to one another and to the
baseline, with an rms of 1: they span the same signals, and their sizes are well determined where
those of sines and cosines would be differences of large numbers.

Source: Fourier. Validity: hum that is periodic over the record. Validation: a synthetic hum is in
the span, in the tests. The sizes are neutral at 0.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from analysis.effects.effect import Array, Effect, ShotContext

_HARMONICS = 3


@lru_cache(maxsize=64)
def _columns(mains_hz: float, sample_rate_hz: float, samples: int) -> Array:
    # phases are free, so they may as well count from the middle of the window, which keeps the
    # columns apart as long as possible and makes them the same for every shot
    phase = 2 * np.pi * mains_hz * (np.arange(samples) - samples // 2) / sample_rate_hz
    columns = [np.ones(samples)]
    for h in range(1, _HARMONICS + 1):
        columns += [np.cos(h * phase), np.sin(h * phase)]
    q, r = np.linalg.qr(np.stack(columns, axis=1))
    signed: Array = q[:, 1:] * np.sign(np.diag(r)[1:]) * np.sqrt(samples)
    signed.flags.writeable = False
    return signed


def _hum(mains_hz: float) -> Callable[[int, ShotContext], Array]:
    return lambda samples, context: _columns(mains_hz, context.sample_rate_hz, samples)


EFFECT = Effect(
    id="mains_hum",
    slot="electronics",
    title="50 Hz hum and its harmonics",
    tell_tale="present before the trigger",
    source="Fourier",
    validation="span of a synthetic hum",
    parameters=(),
    basis=_hum(50.0),
    basis_size=2 * _HARMONICS,
    variants=(
        Effect(
            id="mains_hum:60_hz",
            slot="electronics",
            title="60 Hz hum and its harmonics",
            tell_tale="present before the trigger",
            source="Fourier",
            validation="span of a synthetic hum",
            parameters=(),
            basis=_hum(60.0),
            basis_size=2 * _HARMONICS,
        ),
    ),
)
