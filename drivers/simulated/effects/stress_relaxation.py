"""A body relaxes: ``sum g_i K (d - z_i)`` more force, ``z_i' = (d - z_i)/tau_i``, d = delta^(3/2).

``sls``: one arm, the standard linear solid. ``maxwell``: three arms, a decade apart, g/3 each.
``power_law``: ``G(t) ~ 1 + g (1 + t/tau)^(-1/2)`` (Williams 1964, modified power law); as
this is ``int exp(-x^2 (1 + t/tau)) dx / sqrt(pi)``, four nodes of Gauss and Hermite are its arms
(2e-3 up to t = 1.5 tau, a series of exponentials beyond).
Source: Lee & Radok 1960, with the indentation in place of the contact area's history, so valid
while loading. The force is carried by the body, hence felt by the crystal. It cannot pull: on a
rig whose contacts end with the indentation, one that relaxes ends with what the crystal feels.
Tell-tale: stiffer when the contact is short against tau (tested in both limits).
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import RELAXATION

_DECADES = (0.1, 1.0, 10.0)
_NODES = 8  # four of them above zero: four arms


def arms(form: str, strength: float, relaxation_time_s: float) -> list[tuple[float, float]]:
    """Return strength [1] and relaxation time [s] of every arm."""
    if form == "maxwell":
        share = strength / len(_DECADES)
        return [(share, decade * relaxation_time_s) for decade in _DECADES]
    if form == "power_law":
        x, w = np.polynomial.hermite.hermgauss(_NODES)
        above = x > 0.0
        weights = 2.0 * w[above] / math.sqrt(math.pi)
        return [
            (strength * float(share), relaxation_time_s / float(node) ** 2)
            for node, share in zip(x[above], weights, strict=True)
        ]
    return [(strength, relaxation_time_s)]


class StressRelaxation(Effect):
    """Stress relaxation of one material."""

    id = "stress_relaxation"
    slot = "contact"
    per_material = True
    forms = ("sls", "maxwell", "power_law")
    parameters = (
        Parameter("strength", "1", 0.01, 0.4, 0.0, "g, glassy over relaxed stiffness less one"),
        Parameter("relaxation_time_s", "s", 1e-6, 1e-4, 1e-5, "tau"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        for arm in arms(self.form, self.values["strength"], self.values["relaxation_time_s"]):
            mechanics.terms.append(ContactTerm(RELAXATION, arm))
