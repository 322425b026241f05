"""A recorded shot played through the simulated rig in place of a simulated impact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.flight import Segment


@dataclass(frozen=True)
class Recording:
    """A shot somebody recorded."""

    volts: NDArray[np.float64]
    """Signal with its own noise and baseline."""
    sample_rate_hz: float
    trigger_index: int
    """Sample near the first touch, 0 <= trigger_index < n."""

    def __post_init__(self) -> None:
        """Refuse what cannot be played."""
        if self.volts.ndim != 1 or self.volts.size < 2 or not np.all(np.isfinite(self.volts)):
            raise ValueError("A recording is one row of at least two finite samples.")
        if not 0 <= self.trigger_index < self.volts.size:
            raise ValueError(
                f"Trigger index {self.trigger_index} lies outside the {self.volts.size} samples."
            )
        if not self.sample_rate_hz > 0.0:
            raise ValueError(f"A sample rate is above zero, not {self.sample_rate_hz} Hz.")

    @classmethod
    def from_codes(
        cls,
        codes: NDArray[np.int16],
        *,
        volts_per_code: float,
        sample_rate_hz: float,
        trigger_index: int,
        offset_v: float = 0.0,
    ) -> Recording:
        """Return a recording from converter codes, as in a campaign folder or a shot file.

        ``volts = codes * volts_per_code + offset_v``.
        """
        volts = np.asarray(codes, dtype=np.float64) * volts_per_code + offset_v
        return cls(volts, sample_rate_hz, trigger_index)

    def render(self, landing_s: float, grid_start_s: float, sample_rate_hz: float) -> Segment:
        """Return the recording on the converter's grid, its trigger at the landing.

        At the recording's own rate the samples are shifted by whole steps and stay as they are,
        else they are interpolated on straight lines.

        Landing and grid are rig times; the rate is the true one of the converter.
        """
        landing = round((landing_s - grid_start_s) * sample_rate_hz)
        if abs(sample_rate_hz / self.sample_rate_hz - 1.0) < 1e-9:
            return Segment(landing - self.trigger_index, self.volts, replaces_noise=True)
        ratio = self.sample_rate_hz / sample_rate_hz
        before = int(self.trigger_index / ratio)
        after = int((self.volts.size - 1 - self.trigger_index) / ratio)
        places = self.trigger_index + np.arange(-before, after + 1) * ratio
        volts = np.interp(places, np.arange(self.volts.size), self.volts)
        return Segment(landing - before, volts, replaces_noise=True)
