"""A second resonance of the cell behind the first: ``V + beta G2(s) V``.

``G2 = w2^2/(s^2 + 2 zeta2 w2 s + w2^2)``, driven by what the crystal reads and added to it. Source:
two second-order systems in series. Tell-tale: beat on the ring (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage
from drivers.simulated.filters import resonance


class SecondMode(Effect):
    """A resonance that the crystal drives."""

    id = "second_mode"
    slot = "sensor"
    order = 20
    fine_grid = True
    parameters = (
        Parameter("frequency_hz", "Hz", 2e4, 1e5, 5e4, "w2 / 2 pi"),
        Parameter("damping_ratio", "1", 0.01, 0.1, 0.03, "zeta2"),
        Parameter("share", "1", 0.003, 0.3, 0.0, "beta", either_sign=True),
    )

    def stage(self, shot: Shot) -> StateSpaceStage:
        """Return the resonance and what passes beside it."""
        v = self.values
        return resonance(v["frequency_hz"], v["damping_ratio"], v["share"], 1.0)
