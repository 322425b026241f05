"""Invented: the crystal loses more of a large ring than of a small one.

Damping of the cell times ``1 + a |D|/D1``, D its compression, D1 = 0.1 um. Source: own; micro-slip
in glued and bolted joints (Goodman 1959), whose loss grows with the amplitude. A ring that falls
fast at first and slowly later. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

COMPRESSION_M = 1e-7


class AmplitudeDamping(Effect):
    """A loss that grows with the ring."""

    id = "x_amplitude_damping"
    slot = "sensor"
    parameters = (Parameter("growth", "1", 0.02, 20.0, 0.0, "a, at a compression of 0.1 um"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.damping_growth_per_m = self.values["growth"] / COMPRESSION_M
