"""First-order high-pass of the IEPE coupler: ``y' + y/tau = V'``.

Source: any IEPE guide (discharge to 37 % in one time constant). Tell-tale: undershoot equal to
impulse / tau (tested).
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage
from drivers.simulated.filters import highpass


class CouplerHighpass(Effect):
    """Discharge of the coupler."""

    id = "coupler_highpass"
    slot = "electronics"
    order = 60
    parameters = (Parameter("time_constant_s", "s", 5e-4, 2.0, math.inf, "tau"),)

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the high-pass."""
        tau = self.values["time_constant_s"]
        return None if math.isinf(tau) else highpass(tau)
