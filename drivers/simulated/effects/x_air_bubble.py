"""Invented: a bubble under the tape, above which the coupon bends like a lid.

The spot that is hit stands on a spring of compliance ``c u``, u between 0 and 1, all equally
likely, anew in each shot: the whole over the bubble's middle, nothing beside it. A
fiftieth of the coupon moves with the spot. Source: clamped round plate (Timoshenko & Woinowsky-
Krieger 1959), Gaussian scatter of the places. Softer and longer by chance, most for the stiffest
contacts. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

LID_SHARE = 0.02  # of the coupon's mass
DAMPING_RATIO = 0.05
FIRM_M_PER_N = 2e-10  # below it the lid is as good as glued


class AirBubble(Effect):
    """A coupon that is not glued everywhere."""

    id = "x_air_bubble"
    slot = "mounting"
    per_material = True
    parameters = (
        Parameter("compliance_m_per_n", "m/N", 5e-9, 5e-7, 0.0, "c, over the bubble's middle"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Put a lid on the crystal; its mass was part of what moves and still is."""
        compliance = self.values["compliance_m_per_n"] * float(shot.rng.uniform())
        lid = LID_SHARE * mechanics.coupon_label_mass_kg
        if compliance < FIRM_M_PER_N or lid == 0.0:
            return
        mechanics.cell_mass_kg -= lid
        mechanics.coupon_mass_kg = lid
        mechanics.layer_stiffness_n_per_m = 1.0 / compliance
        mechanics.layer_damping_n_s_per_m = 2.0 * DAMPING_RATIO * math.sqrt(lid / compliance)
