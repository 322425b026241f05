"""A second touch within the record, some time after the first began.

Source: own; a sphere that meets the tube's edge or a splinter. Tell-tale: second pulse (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class Recontact(Effect):
    """A second touch."""

    id = "recontact"
    slot = "release"
    parameters = (
        Parameter("delay_s", "s", 2e-4, 2e-3, 0.0, "after the first touch"),
        Parameter("speed_ratio", "1", 1e-3, 0.5, 0.0, "its speed over the first"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if self.values["speed_ratio"] == 0.0 or self.values["delay_s"] == 0.0:
            return
        mechanics.recontact_delay_s = self.values["delay_s"]
        mechanics.recontact_speed_m_per_s = self.values["speed_ratio"] * speed_m_per_s
