"""The coupon's mass stands on its tape: ``k_t``, ``c_t`` between coupon and crystal.

``constant``: c_t whatever lies on the tape. ``loss_factor``: ``c_t = 2 eta sqrt(k_t m_c)``, the
same damping ratio under every coupon; eta is such that a coupon of 4 g has the stated c_t. Source:
Nashif, Jones & Henderson, Vibration Damping (1985), ch. 3: polymers are told by a loss factor.
Source: textbook two-mass chain. An infinitely stiff tape adds the coupon's mass to the crystal's;
the paper leaves that mass out, so on its rig the neutral value removes the coupon altogether.
Tell-tale: the ring shifts with the coupon (tested).
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

REFERENCE_COUPON_KG = 4e-3
"""Under which the damping is stated."""


class AdhesiveLayer(Effect):
    """A coupon on its tape."""

    id = "adhesive_layer"
    slot = "mounting"
    forms = ("constant", "loss_factor")
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 1e7, 1e10, math.inf, "k_t of the tape"),
        Parameter("damping_n_s_per_m", "N s/m", 20.0, 2000.0, 0.0, "c_t of the tape"),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a tape whose damping ratio under a coupon of 4 g is 2 % to 30 %."""
        stiffness = math.exp(rng.uniform(math.log(1e7), math.log(1e10)))
        ratio = math.exp(rng.uniform(math.log(0.02), math.log(0.3)))
        damping = 2.0 * ratio * math.sqrt(stiffness * REFERENCE_COUPON_KG)
        return {"stiffness_n_per_m": stiffness, "damping_n_s_per_m": damping}

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if math.isinf(self.values["stiffness_n_per_m"]):
            return
        mechanics.coupon_mass_kg = mechanics.coupon_label_mass_kg
        mechanics.layer_stiffness_n_per_m = self.values["stiffness_n_per_m"]
        mechanics.layer_damping_n_s_per_m = self.values["damping_n_s_per_m"]
        if self.form == "loss_factor":
            heavier = mechanics.coupon_label_mass_kg / REFERENCE_COUPON_KG
            mechanics.layer_damping_n_s_per_m *= math.sqrt(heavier)
