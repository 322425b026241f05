"""Invented: the sphere scrapes along the tube and loses speed, by chance and never gaining.

Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class TubeScrape(Effect):
    """A tube that scrapes."""

    id = "x_tube_scrape"
    slot = "release"
    parameters = (Parameter("mean_loss", "1", 0.002, 0.05, 0.0, "mean relative loss of speed"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        shot.speed_factor *= 1.0 - min(float(shot.rng.exponential(self.values["mean_loss"])), 0.5)
