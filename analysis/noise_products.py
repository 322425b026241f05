"""Inner products of whitened rows: a normal matrix without the whitened Jacobian in memory."""

from __future__ import annotations

import numpy as np
from numba import njit

_SHARE = 512
"""Samples at a time: a dozen rows of so many stay in the processor's nearest memory."""


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _whiten(out, row, first, coefficients, scale):  # type: ignore[no-untyped-def]
    """Write the innovations of a row from sample ``first`` on, two coefficients at a time."""
    m, order = out.size, coefficients.size
    here = row[first : first + m]
    for i in range(m):
        out[i] = scale * here[i]
    for j in range(1, order, 2):
        a, b = scale * coefficients[j - 1], scale * coefficients[j]
        one, two = row[first - j : first - j + m], row[first - j - 1 : first - j - 1 + m]
        for i in range(m):
            out[i] -= a * one[i] + b * two[i]
    if order % 2:
        a = scale * coefficients[order - 1]
        one = row[first - order : first - order + m]
        for i in range(m):
            out[i] -= a * one[i]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_products(found, white):  # type: ignore[no-untyped-def]
    """Add the products of all pairs of rows below and on the diagonal, two rows by two."""
    rows, m = white.shape
    for r in range(0, rows - 1, 2):
        x0, x1 = white[r], white[r + 1]
        for q in range(0, r + 1, 2):
            y0, y1 = white[q], white[q + 1]
            p00 = p01 = p10 = p11 = 0.0
            for i in range(m):
                p00 += x0[i] * y0[i]
                p01 += x0[i] * y1[i]
                p10 += x1[i] * y0[i]
                p11 += x1[i] * y1[i]
            found[r, q] += p00
            found[r, q + 1] += p01
            found[r + 1, q] += p10
            found[r + 1, q + 1] += p11
    if rows % 2:
        x0 = white[rows - 1]
        for q in range(rows):
            y0 = white[q]
            p00 = 0.0
            for i in range(m):
                p00 += x0[i] * y0[i]
            found[rows - 1, q] += p00


@njit(cache=True, nogil=True)
def white_products(rows, coefficients, innovation_rms):  # type: ignore[no-untyped-def]
    """Return the inner products of rows that an autoregressive filter makes white.

    ``rows``, shape (k, n), are equally spaced in time; ``coefficients`` and ``innovation_rms`` are
    as in ``analysis.noise.NoiseModel``. The products are those of the n - p innovations, in units
    of their variance.
    """
    count, n = rows.shape
    found = np.zeros((count, count))
    buffer = np.empty(count * _SHARE)
    scale = 1.0 / innovation_rms
    for first in range(coefficients.size, n, _SHARE):
        m = min(_SHARE, n - first)
        white = buffer[: count * m].reshape((count, m))
        for r in range(count):
            _whiten(white[r], rows[r], first, coefficients, scale)
        _add_products(found, white)
    for r in range(count):
        for q in range(r):
            found[q, r] = found[r, q]
    return found
