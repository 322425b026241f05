"""A coupon of finite thickness on a firm ground is stiffer than a half-space.

Three stiffen the coupon alone, ``1/E* = 1/E1' + 1/(E2' f(X))``, X = sqrt(R delta)/h, see
`bonded_layer`: ``layer`` a numerical solution of sphere and bonded layer, ``dimitriadis`` 2002 for
any nu, ``garcia`` 2018 for nu = 0.5. ``whole``: K times
``1 + 1.133X + 1.283X^2 + 0.769X^3 + 0.0975X^4``, as it is often quoted from Dimitriadis; it
stiffens the sphere too, which no layer does, and is drawn on no rig.
Tell-tale: hardens with amplitude, shorter contact (tested).
"""

from __future__ import annotations

import math

from drivers.simulated.bonded_layer import dimitriadis, garcia, solved_layer
from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import LAYER, THICKNESS


class FiniteThickness(Effect):
    """A coupon of finite thickness."""

    id = "finite_thickness"
    slot = "contact"
    per_material = True
    forms = ("layer", "dimitriadis", "garcia", "whole")
    sound_forms = ("layer", "dimitriadis", "garcia")
    parameters = (
        Parameter("thickness_m", "m", 1e-3, 5e-2, math.inf, "h, thickness of the coupon"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        thickness_m = self.values["thickness_m"]
        if self.form == "whole":
            mechanics.terms.append(ContactTerm(THICKNESS, (thickness_m,)))
            return
        nu = mechanics.coupon_poissons_ratio
        share = mechanics.reduced_modulus_pa / mechanics.coupon_plane_strain_modulus_pa
        if self.form == "dimitriadis":
            coefficients = dimitriadis(nu)
        elif self.form == "garcia":
            coefficients = garcia()
        else:
            coefficients = solved_layer(nu, share)
        values = (thickness_m, share, *(float(c) for c in coefficients))
        mechanics.terms.append(ContactTerm(LAYER, values))
