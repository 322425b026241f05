"""Volts to codes, and a table of codes of an input at rest that a stream repeats."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.noise import NoiseSettings, noise_table

CODES = 65536
TABLE_SAMPLES = 1 << 20
"""A second at 1 MHz: longer than a record, and quickly made."""

_T = TypeVar("_T", np.float32, np.uint16)


@dataclass(frozen=True)
class Board:
    """A converter board's range and its own error, ``V = gain * Vraw + offset``."""

    range_v: float
    """Half the range, which is +/- this."""
    gain: float = 1.0
    offset_v: float = 0.0


@dataclass(frozen=True)
class QuietInput:
    """The values of a resting input, as a table that joins its own beginning."""

    noise_v: NDArray[np.float32]
    """Noise without the baseline, shape (TABLE_SAMPLES,)."""
    codes: NDArray[np.uint16]
    """Noise and baseline, converted."""


@lru_cache(maxsize=4)
def quiet_input(
    noise: NoiseSettings, seed: tuple[int, int], baseline_v: float, rate_hz: float, board: Board
) -> QuietInput:
    """Return the table of an input at rest, read at a rate; it is kept for the next same call.

    ``seed`` is the rig's and the number of the stream: no two streams share their noise.
    """
    noise_v = noise_table(
        noise, TABLE_SAMPLES, rate_hz, np.random.default_rng([seed[0], 50, seed[1]])
    )
    return QuietInput(noise_v, quantise(noise_v.astype(np.float64) + baseline_v, board))


def quantise(volts: NDArray[np.float64], board: Board) -> NDArray[np.uint16]:
    """Return offset binary codes; a converter stops at the ends of its range."""
    raw = (volts - board.offset_v) / board.gain
    ideal = np.rint((raw + board.range_v) * (CODES / (2.0 * board.range_v)))
    return np.clip(ideal, 0, CODES - 1).astype(np.uint16)


def coarser(codes: NDArray[np.int32], bits: int) -> NDArray[np.int32]:
    """Return what a converter of fewer bits gives for signed codes of 16.

    They are the nearest of its own codes, ``-2^(bits-1)`` to ``2^(bits-1) - 1``. A ValueError says
    that there is no such converter.
    """
    if not 8 <= bits <= 16:
        raise ValueError(f"A simulated converter has 8 to 16 bits, not {bits}.")
    if bits == 16:
        return codes
    step, top = 1 << (16 - bits), 1 << (bits - 1)
    return np.clip((codes + step // 2) // step, -top, top - 1)


def read_round(table: NDArray[_T], start: int, count: int) -> NDArray[_T]:
    """Return a copy of a part of a table that repeats; it may start at any distance."""
    at = start % table.size
    if at + count <= table.size:
        return table[at : at + count].copy()
    return np.take(table, np.arange(at, at + count), mode="wrap")
