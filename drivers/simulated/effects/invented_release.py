"""Invented: what changes the fall: its height or its speed. No library knows these effects."""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

GRAVITY_M_PER_S2 = 9.80665  # only says how long it falls, and how fast
LEAST_HEIGHT_M = 1e-4  # a seal that would hold for ever is no release


class AirDrag(Effect):
    """Air that is drawn up into the tube brakes the fall.

    ``v^2 = (g/b)(1 - exp(-2 b h))``: drag that grows with the square of the speed, from rest.
    Source: any textbook of mechanics; in still air b is 0.01 per metre for these spheres, a
    draught adds to it. A loss of speed that grows with the height: a law that wrong heights are
    compared with, never a name.
    """

    id = "x_air_drag"
    slot = "release"
    parameters = (Parameter("drag_per_m", "1/m", 0.05, 4.0, 0.0, "b"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        x = 2.0 * self.values["drag_per_m"] * shot.drop_height_m
        if x > 0.0:
            shot.speed_factor *= math.sqrt(-math.expm1(-x) / x)


class BrushBrake(Effect):
    """Something at the tube's end takes the same speed from every drop.

    Speed ``v - d``, whatever the height. Source: own; a viscous brake of fixed length, as a
    magnet at the end of the tube makes it: force in proportion to speed, momentum lost in
    proportion to the way. Neither a height nor a share of the speed: a law that wrong
    heights are compared with, never a name.
    """

    id = "x_brush_brake"
    slot = "release"
    parameters = (
        Parameter("lost_m_per_s", "m/s", 1e-3, 0.06, 0.0, "d, speed lost", either_sign=True),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the speed."""
        speed = math.sqrt(2.0 * GRAVITY_M_PER_S2 * shot.drop_height_m)
        shot.speed_factor *= max(1.0 - self.values["lost_m_per_s"] / speed, 0.05)


class DraggedRelease(Effect):
    """A leaking seal holds the sphere back over its first way, now more, now less.

    Height ``h - d x``, x exponential with mean one, anew in each shot. Source: own; work of a
    vacuum that fails slowly, in units of the sphere's weight. A loss of height, not of a share
    of speed: worst at low drops.
    """

    id = "x_dragged_release"
    slot = "release"
    parameters = (Parameter("mean_loss_m", "m", 5e-5, 1.5e-3, 0.0, "d, mean loss of height"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        loss = float(shot.rng.exponential(self.values["mean_loss_m"]))
        shot.drop_height_m = max(shot.drop_height_m - loss, LEAST_HEIGHT_M)


PINION_LEAST_SHARE = 0.1  # of the height, which stays above the coupon


class EccentricPinion(Effect):
    """The pinion that lifts the tube along its rack sits off its axle.

    Height ``h + a sin(2 pi h/p)``, p the way of one turn, the scale set to zero on the coupon.
    Source: own; an eccentric gear, as in any table of errors of measuring machines. Each height
    is wrong by an amount of its own, now too high, now too low, and the same in every drop.
    """

    id = "x_eccentric_pinion"
    slot = "release"
    parameters = (
        Parameter("eccentricity_m", "m", 2e-5, 1.5e-3, 0.0, "a", either_sign=True),
        Parameter("turn_m", "m", 0.012, 0.07, 0.03, "p, way of one turn"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the height."""
        h = shot.drop_height_m
        error = self.values["eccentricity_m"] * math.sin(2.0 * math.pi * h / self.values["turn_m"])
        shot.drop_height_m = max(h + error, PINION_LEAST_SHARE * h)


STAND_LEAST_FACTOR = 0.1  # of the speed: the sphere still falls


class RecoilingStand(Effect):
    """The valve's click sets the stand swinging, and the coupon comes to meet the sphere.

    Impact speed ``v + a exp(-t/tau) sin(2 pi f t)``, t the time of the fall. Source: own; a
    heavy table on soft feet, kicked at the release. The swing is met at a phase that the height
    decides: too fast from here, too slow from there, every time again.
    """

    id = "x_recoiling_stand"
    slot = "release"
    parameters = (
        Parameter("speed_m_per_s", "m/s", 5e-4, 0.04, 0.0, "a, of the coupon", either_sign=True),
        Parameter("frequency_hz", "Hz", 4.0, 40.0, 10.0, "f of the swing"),
        Parameter("decay_s", "s", 0.05, 0.5, 0.2, "tau of the swing"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the speed by that of the coupon at the touch."""
        fall_s = math.sqrt(2.0 * shot.drop_height_m / GRAVITY_M_PER_S2)
        phase = 2.0 * math.pi * self.values["frequency_hz"] * fall_s
        swing = math.exp(-fall_s / self.values["decay_s"]) * math.sin(phase)
        upward = self.values["speed_m_per_s"] * swing
        shot.speed_factor *= max(1.0 + upward / (GRAVITY_M_PER_S2 * fall_s), STAND_LEAST_FACTOR)


CLAMP_LEAST_HEIGHT_M = 1e-3  # below it no drop was asked for


class SlippingClamp(Effect):
    """The clamp that holds the tube slips down a little every so many drops, and stays.

    Height ``h - s floor(n/N)`` at the n-th release. Source: own. Steps in the order of the
    drops, the same number of metres at every height.
    """

    id = "x_slipping_clamp"
    slot = "release"
    parameters = (
        Parameter("step_m", "m", 3e-5, 1.2e-3, 0.0, "s, of one slip", either_sign=True),
        Parameter("drops_between", "1", 8.0, 30.0, 15.0, "N"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        slips = math.floor(shot.number / self.values["drops_between"])
        left = shot.drop_height_m - slips * self.values["step_m"]
        shot.drop_height_m = max(left, CLAMP_LEAST_HEIGHT_M)


class StickySeal(Effect):
    """The seal sometimes holds on to the sphere by one edge before it lets go altogether.

    In a share of the drops the sphere falls a fixed distance less, in all others the whole way.
    Source: own; a lip of rubber that sticks or does not. Two kinds of drops and nothing between
    them.
    """

    id = "x_sticky_seal"
    slot = "release"
    parameters = (
        Parameter("lost_m", "m", 1e-4, 4e-3, 0.0, "height lost when it sticks"),
        Parameter("share", "1", 0.1, 0.5, 0.3, "of the drops in which it sticks"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall of the drops that stick."""
        if shot.rng.random() < self.values["share"]:
            left = shot.drop_height_m - self.values["lost_m"]
            shot.drop_height_m = max(left, LEAST_HEIGHT_M)


SWINGING_TUBE_GRAVITY_M_PER_S2 = 9.81  # only scales the size


class SwingingTube(Effect):
    """The tube still moves up or down when it lets go, and the sphere takes that along.

    Impact speed ``v0 + a z``, z a standard normal number of each shot: the same metres per
    second at every height, hence worst at low drops. Source: own.
    """

    id = "x_swinging_tube"
    slot = "release"
    parameters = (
        Parameter("speed_m_per_s", "m/s", 2e-3, 0.06, 0.0, "a, of the tube at the release"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        free = math.sqrt(2.0 * SWINGING_TUBE_GRAVITY_M_PER_S2 * shot.drop_height_m)
        shot.speed_factor *= (
            1.0 + self.values["speed_m_per_s"] * float(shot.rng.standard_normal()) / free
        )


class TubeScrape(Effect):
    """The sphere scrapes along the tube and loses speed, by chance and never gaining."""

    id = "x_tube_scrape"
    slot = "release"
    parameters = (Parameter("mean_loss", "1", 0.002, 0.05, 0.0, "mean relative loss of speed"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        shot.speed_factor *= 1.0 - min(float(shot.rng.exponential(self.values["mean_loss"])), 0.5)
