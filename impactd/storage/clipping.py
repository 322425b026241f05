"""Whether a record reaches a limit of the converter or of the amplifier."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MIN_RUN = 3
_MARGIN = 1.5
_CONVERTER_LIMITS = {
    "i": (-32768, 32767),
    "u": (0, 65535),
}


def is_clipped(samples: NDArray[Any], *, quantum: float | None = None) -> bool:
    """Return whether a record reaches a limit.

    Three or more equal extreme samples in a row are the mark. At an end of a converter's codes that
    is enough. Elsewhere (an amplifier's limit) a smooth, coarsely quantised crest looks the same
    and must not be taken for it: a parabola that keeps L samples within one quantum q of its crest
    loses less than q ((L + 1) / (L - 1))^2 to the next sample, so only a plateau that ends
    in a larger step on both sides counts.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Codes, or values of any unit.
    quantum : float, optional
        Step of the converter in the unit of ``samples``; estimated when absent.

    Notes
    -----
    Source: own derivation (parabola through the crest).
    Validation: ``tests/impactd/storage/test_clipping.py``, clean and clipped half-sines over
    quantum and noise.
    """
    limits = _CONVERTER_LIMITS.get(samples.dtype.kind, ())
    for extreme, sign in ((samples.max(), 1.0), (samples.min(), -1.0)):
        start, stop = _longest_run(samples == extreme)
        length = stop - start
        if length < MIN_RUN:
            continue
        if samples.dtype.kind in "iu" and int(extreme) in limits:
            return True
        if start == 0 or stop == samples.size:
            continue
        step = quantum if quantum is not None else _step(samples)
        beside = np.array([samples[start - 1], samples[stop]], dtype=np.float64)
        drop = float(np.min(sign * (float(extreme) - beside)))
        if drop > _MARGIN * step * ((length + 1) / (length - 1)) ** 2:
            return True
    return False


def _longest_run(mask: NDArray[np.bool_]) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


def _step(samples: NDArray[Any]) -> float:
    if samples.dtype.kind in "iu":
        return 1.0
    values = np.unique(samples)
    return float(np.min(np.diff(values))) if values.size > 1 else 0.0
