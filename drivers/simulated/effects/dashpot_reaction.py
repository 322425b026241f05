"""The dissipative force loads the crystal as well, as Newton's third law asks.

Source: own; the paper passes only the elastic force. Tell-tale: earlier peak (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class DashpotReaction(Effect):
    """Reaction of the dashpot on the crystal."""

    id = "dashpot_reaction"
    slot = "contact"
    parameters = (
        Parameter("share", "1", 0.05, 1.0, 0.0, "part of the dissipative force passed on"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.dashpot_share += self.values["share"]
