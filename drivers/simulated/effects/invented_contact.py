"""Invented: what happens between sphere and coupon. No library knows these effects."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless, StateSpaceStage
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import FILM, POWER, RATE_POWER, SECOND_SPOT, SNAP, SOFT_TOE

TIP_INDENTATION_M = 1e-5  # d1, a usual indentation: there the exponent changes nothing


class ConicalTip(Effect):
    """The sphere has a flat or a tip, and the exponent is not that of a sphere.

    Force times ``(delta/d1)^n``, d1 = 10 um: n = 1/2 is a cone, n = -1/2 a flat. Source:
    Sneddon 1965, between his two cases. Wrong at every speed in a way that no stiffness mends.
    """

    id = "x_conical_tip"
    slot = "contact"
    per_material = True
    parameters = (Parameter("exponent", "1", 1e-3, 0.2, 0.0, "n, beyond 3/2", either_sign=True),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(POWER, (self.values["exponent"], TIP_INDENTATION_M)))


class DustLayer(Effect):
    """Dust on the faces gives way at first touch and is crushed in the course of the drops.

    Force times ``1 - a exp(-n/n0) exp(-delta/s)`` at the n-th release. Source: own. A soft toe
    that heals.
    """

    id = "x_dust_layer"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 0.03, 0.9, 0.0, "a, of the force lost at touch"),
        Parameter("depth_m", "m", 1e-6, 1e-5, 3e-6, "s"),
        Parameter("drops_to_crush", "1", 5.0, 50.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        left = self.values["share"] * math.exp(-shot.number / self.values["drops_to_crush"])
        mechanics.terms.append(ContactTerm(SOFT_TOE, (left, self.values["depth_m"])))


SPHERE_INERTIA = 0.4  # I/(m R^2)


class EccentricSphere(Effect):
    """A sphere with a void inside, which turns away when its centre of mass is not above.

    Mass at the point of contact ``m / (1 + 5/2 e^2 sin^2(theta))``, e the offset of the centre
    of mass over R, theta its angle to the vertical, any direction as likely as any other in
    each shot. Source: textbook impact of a smooth body, ``1/m + l^2/I``; I of a solid sphere.
    Shorter and weaker pulses by chance, never longer ones, and the stiffness stays.
    """

    id = "x_eccentric_sphere"
    slot = "contact"
    per_material = True
    parameters = (Parameter("offset", "1", 0.03, 0.35, 0.0, "e, of the centre of mass, over R"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the mass that the contact feels."""
        cosine = float(shot.rng.uniform(-1.0, 1.0))
        lever = self.values["offset"] ** 2 * (1.0 - cosine**2)
        mechanics.sphere_mass_kg /= 1.0 + lever / SPHERE_INERTIA


class HardSkin(Effect):
    """A sphere or coupon with a hard skin, stiff at first and soft once it is through.

    Force times ``1 + a exp(-delta/s)``. Source: own; the first term of a contact that feels a
    thin layer less and less as it grows beyond it.
    """

    id = "x_hard_skin"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 0.01, 3.0, 0.0, "a, of the force, more at first touch"),
        Parameter("depth_m", "m", 1e-6, 2e-5, 5e-6, "s"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact: a soft toe of the other sign."""
        values = (-self.values["share"], self.values["depth_m"])
        mechanics.terms.append(ContactTerm(SOFT_TOE, values))


INNER_DAMPING_RATIO = 0.03  # a choice: falls to 1/e in five periods


class InnerMass(Effect):
    """The sphere rings in itself while it touches.

    A part ``r`` of its mass hangs on a spring inside it, of frequency ``f``. Source: own; the
    lowest mode of a body as one mass and one spring. Heard in the contact only: it is silent
    for the cell where the sphere leaves.
    """

    id = "x_inner_mass"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 2e-3, 0.3, 0.0, "r, of the sphere's mass"),
        Parameter("frequency_hz", "Hz", 8e3, 6e4, 2e4, "f of the mass inside, the rest held"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.inner_mass_share = self.values["share"]
        mechanics.inner_angular_frequency_rad_per_s = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.inner_damping_ratio = INNER_DAMPING_RATIO


EVERYWHERE_M = 1.0  # a snap as wide as this has no depth of its own


class InternalFriction(Effect):
    """A material that rubs in itself resists on the way in and holds back on the way out.

    Force times ``1 + h`` while the contact closes and ``1 - h`` while it opens, joined over 2
    cm/s. Source: loss without a rate, two slopes as in Walton & Braun 1986. The force falls at
    the deepest point, the same share is lost at every speed, and the crystal feels all of it.
    """

    id = "x_internal_friction"
    slot = "contact"
    per_material = True
    parameters = (Parameter("share", "1", 1e-3, 0.15, 0.0, "h, of the force"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Weaken the way out and strengthen the way in: a snap of the other sign, everywhere."""
        share = self.values["share"]
        mechanics.reduced_modulus_pa *= 1.0 - share
        stronger = -2.0 * share / (1.0 - share)
        mechanics.terms.append(ContactTerm(SNAP, (stronger, 0.0, EVERYWHERE_M)))


class LubricationFilm(Effect):
    """A viscous film squeezed out between the bodies, ``c exp(-delta/h) delta'``.

    Loads the crystal as well; on the way back it pulls with a tenth of the strength
    (cavitation).
    """

    id = "x_lubrication_film"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("damping_n_s_per_m", "N s/m", 0.03, 10.0, 0.0, "c at touch"),
        Parameter("depth_m", "m", 2e-6, 3e-5, 1e-5, "h, indentation that squeezes the film out"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(
            ContactTerm(FILM, (self.values["damping_n_s_per_m"], self.values["depth_m"], 0.1))
        )


SLIDING_SCATTER = 0.3  # of the share of the impulse, from shot to shot
SLIDING_JOINT = 0.02  # share of the impulse over which sliding ends


class _Shear(Memoryless):
    def __init__(self, cross: float, slides_until: float) -> None:
        self._cross, self._until = cross, slides_until

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        delivered = np.cumsum(volts)
        most = float(np.max(delivered, initial=0.0))
        if most == 0.0:
            return volts
        sliding = expit((self._until - np.maximum.accumulate(delivered) / most) / SLIDING_JOINT)
        return np.asarray(volts * (1.0 + self._cross * sliding))


class ObliqueFriction(Effect):
    """The sphere lands obliquely and slides at first; the cell feels the shear.

    ``V (1 + q s(t))``: s is one while the sphere slides and falls to zero when its share of the
    impulse has been delivered, some shots earlier, some later. Source: own; sliding of a solid
    sphere ends at the impulse ``2 m v_t / (7 mu)`` (Maw, Barber & Fawcett 1976), and a cell has
    a cross sensitivity. A step in the pulse, none in the ring.
    """

    id = "x_oblique_friction"
    slot = "contact"
    order = 4
    per_material = True
    parameters = (
        Parameter(
            "cross_share", "1", 1e-3, 0.05, 0.0, "q, shear felt over force", either_sign=True
        ),
        Parameter("slides_until", "1", 0.2, 0.8, 0.5, "share of the impulse when sliding ends"),
    )

    def stage(self, shot: Shot) -> _Shear | None:
        """Return the shear of this hit."""
        scatter = math.exp(SLIDING_SCATTER * float(shot.rng.standard_normal()))
        if self.values["cross_share"] == 0.0:
            return None
        return _Shear(self.values["cross_share"], self.values["slides_until"] * scatter)


class PowerLawStiffness(Effect):
    """Stiffness grows with the rate, force times ``1 + a (|delta'|/v1)^n``, v1 = 1 m/s.

    Smoothed by one percent of v1 where the rate is zero.
    """

    id = "x_power_law_stiffness"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("strength", "1", 0.002, 0.5, 0.0, "a, stiffening at 1 m/s"),
        Parameter("exponent", "1", 0.3, 1.5, 1.0, "n"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(
            ContactTerm(RATE_POWER, (self.values["strength"], 1.0, self.values["exponent"]))
        )


class Seam(Effect):
    """A moulded sphere lands now on its seam, now beside it.

    Radius of the contact times ``exp(a z)``, z a standard normal number of each shot. Source:
    own. Stiffness that is every shot's own, with the same losses and the same cell.
    """

    id = "x_seam"
    slot = "contact"
    per_material = True
    parameters = (Parameter("spread", "1", 5e-4, 0.1, 0.0, "a, of the radius in the logarithm"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the radius."""
        mechanics.sphere_radius_m *= math.exp(
            self.values["spread"] * float(shot.rng.standard_normal())
        )


class SecondAsperity(Effect):
    """Beyond a gap a second spot touches, with a stiffness of its own.

    Force plus ``b K (delta - gap)^(3/2)`` once ``delta > gap``. Source: own; two Hertz contacts
    in parallel, one of them late (a burr, a dent, a grain). A kink in the rise whose depth is
    the same at every speed.
    """

    id = "x_second_asperity"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 3e-3, 0.5, 0.0, "b, stiffness over that of the first spot"),
        Parameter("gap_m", "m", 1e-6, 1.5e-5, 1e-5, "indentation at which it touches"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the spot to the force of contact."""
        mechanics.terms.append(
            ContactTerm(SECOND_SPOT, (self.values["share"], self.values["gap_m"]))
        )


class SnapThrough(Effect):
    """A domed coupon snaps flat on the way in and does not snap back on the way out.

    Force times ``1 - a exp(-((delta - d)/(d/3))^2)`` while the contact closes, as it was while
    it opens, joined over 2 cm/s. Source: own, in the spirit of shallow arches (Timoshenko &
    Gere 1961, ch. 7). A notch in the rise at the same depth in every shot.
    """

    id = "x_snap_through"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 2e-3, 0.2, 0.0, "a, loss of force at the snap"),
        Parameter("depth_m", "m", 2e-6, 2e-5, 1e-5, "d, indentation of the snap"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the snap to the force of contact."""
        depth = self.values["depth_m"]
        mechanics.terms.append(ContactTerm(SNAP, (self.values["share"], depth, depth / 3.0)))


STIFFENING_SPEED_M_PER_S = 0.77  # v1, after a fall of 30 mm


class SpeedStiffening(Effect):
    """A material that is stiffer the faster it is hit, all through the contact.

    Reduced modulus times ``(v/v1)^n``, v the speed at touch-down, v1 = 0.77 m/s. Source: own;
    power law in the rate of strain, as polymers show over decades. Each shot by itself is the
    base model.
    """

    id = "x_speed_stiffening"
    slot = "contact"
    per_material = True
    parameters = (Parameter("exponent", "1", 5e-4, 0.1, 0.0, "n", either_sign=True),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the modulus."""
        ratio = speed_m_per_s / STIFFENING_SPEED_M_PER_S
        mechanics.reduced_modulus_pa *= ratio ** self.values["exponent"]


class SphereSpin(Effect):
    """An oblique hit spins the sphere; friction excites a slow decaying sideways mode.

    Adds ``r V * g`` with g a damped sine of a few hundred hertz: its size follows the impulse
    and differs from shot to shot.
    """

    id = "x_sphere_spin"
    slot = "contact"
    order = 5
    per_material = True
    parameters = (
        Parameter("share", "1", 5e-4, 0.2, 0.0, "r, per one radian of the mode"),
        Parameter("frequency_hz", "Hz", 300.0, 2500.0, 800.0, "of the mode"),
        Parameter("decay_s", "s", 3e-4, 3e-3, 1e-3, "of the mode"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the mode, as strong as this hit was oblique."""
        oblique = float(abs(shot.rng.standard_normal()))
        if self.values["share"] == 0.0:
            return None
        w, a = 2.0 * math.pi * self.values["frequency_hz"], 1.0 / self.values["decay_s"]
        system = np.array([[0.0, 1.0], [-(w * w + a * a), -2.0 * a]])
        gain = self.values["share"] * oblique * w * w
        return StateSpaceStage(system, np.array([0.0, 1.0]), np.array([gain, 0.0]), 1.0)


class WarmingSphere(Effect):
    """The material warms up in the course of the campaign and softens or hardens.

    Reduced modulus times ``1 + a (1 - exp(-n/n0))`` at the n-th release. Source: own; polymers
    lose a percent of modulus in one or two kelvin. A drift between shots that no signal chain
    explains, as contact times drift too.
    """

    id = "x_warming_sphere"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("final_change", "1", 6e-4, 0.06, 0.0, "a", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 60.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the modulus."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        mechanics.reduced_modulus_pa *= 1.0 + self.values["final_change"] * settled
