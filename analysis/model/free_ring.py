"""What a structure does after lift-off: a free linear motion, exact from sample to sample."""

# ruff: noqa: PLR0917 - a compiled kernel takes its numbers by position

from __future__ import annotations

import math

import numpy as np
from numba import njit

_TAYLOR = 14
_STRIDE = 32
"""Samples that are read off one state before it is carried on."""


@njit(cache=True, nogil=True, fastmath={"contract"})
def _product(out, left, right):  # type: ignore[no-untyped-def]
    """Write a matrix product; faster than BLAS for a handful of rows, and no allocation."""
    n = left.shape[0]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += left[i, k] * right[k, j]
            out[i, j] = total


@njit(cache=True, nogil=True, fastmath={"contract"})
def _propagator(E, A, rate, dt, work):  # type: ignore[no-untyped-def]
    """Write expm(A dt) into E by scaling and squaring; rates are measured in units of ``rate``.

    In these units displacement and velocity are of one size, which spares most of the squarings.
    """
    n = E.shape[0]
    X, term, other = work[0], work[1], work[2]
    X[:] = 0.0
    for i in range(n // 2):
        X[2 * i, 2 * i + 1] = rate * dt
        for j in range(n // 2):
            X[2 * i + 1, 2 * j] = A[i, 2 * j] * dt / rate
            X[2 * i + 1, 2 * j + 1] = A[i, 2 * j + 1] * dt
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(X[i, j])
        norm = max(norm, row)
    squarings = 0
    if norm > 0.5:
        squarings = math.ceil(math.log2(norm / 0.5))
    X *= 2.0**-squarings
    E[:] = 0.0
    term[:] = 0.0
    for i in range(n):
        E[i, i] = 1.0
        term[i, i] = 1.0
    for order in range(1, _TAYLOR):
        _product(other, term, X)
        for i in range(n):
            for j in range(n):
                term[i, j] = other[i, j] / order
                E[i, j] += term[i, j]
    for _ in range(squarings):
        _product(other, E, E)
        E[:] = other


@njit(cache=True, nogil=True)
def _fastest(A):  # type: ignore[no-untyped-def]
    """Return the largest angular frequency of a mass by itself, 1 where nothing holds any."""
    rate = 0.0
    for row in range(A.shape[0]):
        rate = max(rate, abs(A[row, 2 * row]))
    return math.sqrt(rate) if rate > 0.0 else 1.0


@njit(cache=True, nogil=True, fastmath={"contract"})
def _carried(s, P, other):  # type: ignore[no-untyped-def]
    """Replace the state by P s."""
    n = P.shape[0]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += P[i, j] * s[j]
        other[i] = total
    for i in range(n):
        s[i] = other[i]


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_free_ring(out, i, ahead, dt, A, reading, gain, s):  # type: ignore[no-untyped-def]
    """Add the structure's free motion to ``out`` from sample ``i`` on.

    Parameters
    ----------
    A : ndarray, shape (q, 2 q)
        Accelerations by displacements and velocities, see ``analysis.model.structure.Assembled``.
    reading : ndarray, shape (q,)
        What the cell reads of the displacements. [1]
    s : ndarray
        Displacements and velocities at lift-off, alternating; overwritten. [m, m/s]

    Notes
    -----
    Exact for any damping. Rows ``c_k = reading P^k`` read a whole stride of samples off one state,
    which the propagator of the stride then carries on.
    """
    n, size = out.size, A.shape[1]
    if i >= n:
        return
    P, Q = np.empty((size, size)), np.empty((size, size))
    work = np.empty((3, size, size))
    other = np.empty(size)
    rate = _fastest(A)
    for row in range(size // 2):
        s[2 * row + 1] /= rate
    _propagator(P, A, rate, ahead, work)
    _carried(s, P, other)
    _propagator(P, A, rate, dt, work)
    rows = np.zeros((size, _STRIDE))
    for row in range(size // 2):
        rows[2 * row, 0] = gain * reading[row]
    for k in range(1, _STRIDE):
        for col in range(size):
            total = 0.0
            for row in range(size):
                total += rows[row, k - 1] * P[row, col]
            rows[col, k] = total
    for doubling in range(5):
        if doubling % 2 == 0:
            _product(Q, P, P)
        else:
            _product(P, Q, Q)
    while i < n:
        count = min(_STRIDE, n - i)
        for col in range(size):
            value = s[col]
            for k in range(count):
                out[i + k] += rows[col, k] * value
        _carried(s, Q, other)
        i += count


@njit(cache=True, nogil=True)
def carry_on(A, span, s):  # type: ignore[no-untyped-def]
    """Replace a state by what its free motion has made of it after ``span`` seconds.

    ``A`` is as in `add_free_ring`. The state, shape (2 q,), has displacements and velocities
    alternating. [m, m/s]
    """
    size = A.shape[1]
    rate = _fastest(A)
    P, work, other = np.empty((size, size)), np.empty((3, size, size)), np.empty(size)
    _propagator(P, A, rate, span, work)
    for row in range(size // 2):
        s[2 * row + 1] /= rate
    _carried(s, P, other)
    for row in range(size // 2):
        s[2 * row + 1] *= rate
