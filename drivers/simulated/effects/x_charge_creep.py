"""Invented: the crystal's charge creeps, a spread of relaxation times instead of one.

``V + r sum_i (1/n) V * exp(-t/tau_i)/tau_i`` over one time per factor of four from 20 us
to ``longest``. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage


class ChargeCreep(Effect):
    """Dielectric absorption in the crystal."""

    id = "x_charge_creep"
    slot = "sensor"
    order = 25
    fine_grid = True
    parameters = (
        Parameter("share", "1", 0.0015, 0.3, 0.0, "r", either_sign=True),
        Parameter("longest_s", "s", 1e-4, 1e-2, 1e-3, "longest relaxation time"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the sum of relaxations."""
        if self.values["share"] == 0.0:
            return None
        times, tau = [], 20e-6
        while tau <= self.values["longest_s"]:
            times.append(tau)
            tau *= 4.0
        rates = 1.0 / np.array(times)
        weights = self.values["share"] / len(times) * rates
        return StateSpaceStage(np.diag(-rates), np.ones(len(times)), weights, 1.0)
