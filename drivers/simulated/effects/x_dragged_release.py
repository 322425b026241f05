"""Invented: a leaking seal holds the sphere back over its first way, now more, now less.

Height ``h - d x``, x exponential with mean one, anew in each shot. Source: own; work of a vacuum
that fails slowly, in units of the sphere's weight. A loss of height, not of a share of speed:
worst at low drops. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot

LEAST_HEIGHT_M = 1e-4  # a seal that would hold for ever is no release


class DraggedRelease(Effect):
    """A release that holds the sphere back for a while."""

    id = "x_dragged_release"
    slot = "release"
    parameters = (Parameter("mean_loss_m", "m", 5e-5, 1.5e-3, 0.0, "d, mean loss of height"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        loss = float(shot.rng.exponential(self.values["mean_loss_m"]))
        shot.drop_height_m = max(shot.drop_height_m - loss, LEAST_HEIGHT_M)
