"""Invented: the cell's seat hardens under load, as joints of rough faces do.

Stiffness below the crystal ``k (1 + a D/D1)``, D its compression, D1 = 0.1 um; softer by as much
in tension. Source: own, first term of any joint whose contact area grows with the load (Johnson
1985, ch. 13). The pitch of the ring hangs on its size. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

COMPRESSION_M = 1e-7


class HardeningSeat(Effect):
    """A seat that hardens."""

    id = "x_hardening_seat"
    slot = "mounting"
    parameters = (Parameter("hardening", "1", 5e-4, 0.2, 0.0, "a, at a compression of 0.1 um"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.cell_hardening_per_m = self.values["hardening"] / COMPRESSION_M
