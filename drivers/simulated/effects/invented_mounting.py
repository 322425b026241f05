"""Invented: what holds coupon and cell. No library knows these effects."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless
from drivers.simulated.impact import Mechanics

LID_SHARE = 0.02  # of the coupon's mass
LID_DAMPING_RATIO = 0.05  # as polymers have it
LID_FIRM_M_PER_N = 2e-10  # below it the lid is as good as glued


class AirBubble(Effect):
    """A bubble under the tape, above which the coupon bends like a lid.

    The spot that is hit stands on a spring of compliance ``c u``, u between 0 and 1, all
    equally likely, anew in each shot: the whole over the bubble's middle, nothing beside it. A
    fiftieth of the coupon moves with the spot. Source: clamped round plate (Timoshenko &
    Woinowsky- Krieger 1959), Gaussian scatter of the places. Softer and longer by chance, most
    for the stiffest contacts.
    """

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
        if compliance < LID_FIRM_M_PER_N or lid == 0.0:
            return
        mechanics.cell_mass_kg -= lid
        mechanics.coupon_mass_kg = lid
        mechanics.layer_stiffness_n_per_m = 1.0 / compliance
        mechanics.layer_damping_n_s_per_m = 2.0 * LID_DAMPING_RATIO * math.sqrt(lid / compliance)


SEAT_COMPRESSION_M = 1e-7  # D1, under 40 N on the paper's crystal


class HardeningSeat(Effect):
    """The cell's seat hardens under load, as joints of rough faces do.

    Stiffness below the crystal ``k (1 + a D/D1)``, D its compression, D1 = 0.1 um; softer by as
    much in tension. Source: own, first term of any joint whose contact area grows with the load
    (Johnson 1985, ch. 13). The pitch of the ring hangs on its size.
    """

    id = "x_hardening_seat"
    slot = "mounting"
    parameters = (Parameter("hardening", "1", 5e-4, 0.2, 0.0, "a, at a compression of 0.1 um"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.cell_hardening_per_m = self.values["hardening"] / SEAT_COMPRESSION_M


HOP_AREA_V_S = 1e-4  # J1, of 1 V for 0.1 ms
THUMP_S = 2e-4  # a choice: four periods of the crystal
HOP_LEAST_PEAK_V = 1e-4  # what is fainter is no hit


class _Hops:
    """Keeps its own time, and the landings that are still to come."""

    def __init__(self, share: float, hop_s: float) -> None:
        self._share, self._hop_s = share, hop_s
        self._now_s = 0.0
        self._landings: list[tuple[float, float]] = []  # begin and area of the pulse before

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        t = self._now_s + step_s * np.arange(1, volts.size + 1)
        self._now_s = float(t[-1])
        peak = int(np.argmax(volts))
        area = step_s * float(np.sum(volts))
        if volts[peak] > HOP_LEAST_PEAK_V and area > 0.0:
            self._landings.append((float(t[peak]) + self._hop_s * area / HOP_AREA_V_S, area))
        result = volts.copy()
        for begins_s, pulse in self._landings:
            x = (t - begins_s) / THUMP_S
            bell = np.where((x > 0.0) & (x < 1.0), 1.0 - np.cos(2.0 * np.pi * x), 0.0)
            result += self._share * pulse / THUMP_S * bell
        return result

    def is_quiet(self, threshold_v: float) -> bool:
        return all(begins_s + THUMP_S < self._now_s for begins_s, _ in self._landings)


class HoppingCell(Effect):
    """A cell that only stands on the table hops when it is hit, and thumps as it lands.

    A bell of 0.2 ms and of ``r`` times the area J of each pulse, ``T J/J1`` after it, J1 = 0.1
    mV s. Source: own; the blow throws cell and table apart at a speed in proportion to the
    momentum, gravity brings the cell back after twice that speed over g. Later and larger the
    harder the hit, and never a second touch of the sphere.
    """

    id = "x_hopping_cell"
    slot = "mounting"
    order = 6
    parameters = (
        Parameter("share", "1", 3e-4, 0.1, 0.0, "r, of the pulse's area"),
        Parameter("hop_s", "s", 1e-4, 1.5e-3, 5e-4, "T, of a hop after 0.1 mV s"),
    )

    def stage(self, shot: Shot) -> _Hops | None:
        """Return the cell, standing."""
        share = self.values["share"]
        return None if share == 0.0 else _Hops(share, self.values["hop_s"])


class LiftedTape(Effect):
    """The seat of the cell is softer in tension than in compression (a tape that lifts)."""

    id = "x_lifted_tape"
    slot = "mounting"
    parameters = (
        Parameter(
            "tension_stiffness_ratio", "1", 0.3, 0.999, 1.0, "stiffness in tension over compression"
        ),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a ratio whose distance from one is even in the logarithm."""
        lost = math.exp(rng.uniform(math.log(1e-3), math.log(0.7)))
        return {"tension_stiffness_ratio": 1.0 - lost}

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.tension_stiffness_ratio = self.values["tension_stiffness_ratio"]


class LooseningSeat(Effect):
    """The cell's seat works loose, hit by hit.

    Stiffness below the crystal times ``1 - a (1 - exp(-n/n0))`` at the n-th release. Source:
    own; a screw that settles. The ring's pitch falls in the course of the campaign, whatever
    falls on what.
    """

    id = "x_loosening_seat"
    slot = "mounting"
    parameters = (
        Parameter("final_loss", "1", 2e-4, 0.02, 0.0, "a, of stiffness", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 60.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        mechanics.cell_stiffness_n_per_m *= 1.0 - self.values["final_loss"] * settled


STRETCHED_STIFFNESS_RATIO = 0.2  # a choice
SCREW_DAMPING_RATIO = 0.03  # a choice: falls to 1/e in five periods


class RattlingScrew(Effect):
    """A loose screw below the coupon pushes back at once and pulls back hardly at all.

    A small mass on the crystal's top behind a spring that is a fifth as stiff when stretched:
    kicked away by the impact, back after longer than its own period. Source: own; bilinear
    oscillator (Shaw & Holmes 1983). Extra ring that is no sine and whose pitch follows no
    linear mode.
    """

    id = "x_rattling_screw"
    slot = "mounting"
    parameters = (
        Parameter("mass_ratio", "1", 1e-5, 0.02, 0.0, "mass of the screw over the crystal's"),
        Parameter("frequency_hz", "Hz", 3e3, 3e4, 1e4, "of the screw while it is pushed"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.mode_mass_kg = self.values["mass_ratio"] * mechanics.cell_mass_kg
        mechanics.mode_angular_frequency_rad_per_s = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.mode_damping_ratio = SCREW_DAMPING_RATIO
        mechanics.mode_stretched_ratio = STRETCHED_STIFFNESS_RATIO


class RubbingCoupon(Effect):
    """The coupon's edge rubs against the frame that centres it.

    A force ``f tanh(v/v1)`` against the motion of the crystal's top, v1 = 0.1 mm/s. Source:
    Coulomb's law, smoothed. The ring dies in a straight line and not exponentially, the smaller
    the sooner.
    """

    id = "x_rubbing_coupon"
    slot = "mounting"
    per_material = True
    parameters = (Parameter("friction_n", "N", 2e-3, 0.6, 0.0, "f"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.rubbing_n = self.values["friction_n"]


RIM_JOINT = 0.02  # of V_c, over which the two slopes join


class _Rim(Memoryless):
    def __init__(self, share: float, begins_v: float) -> None:
        self._share, self._begins_v = share, begins_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        joint_v = RIM_JOINT * self._begins_v
        beyond = joint_v * np.logaddexp(0.0, (volts - self._begins_v) / joint_v)
        return np.asarray(volts - self._share * beyond)


class SinkingCoupon(Effect):
    """The tape flows, and the coupon sinks until hard blows set it down on the cell's rim.

    ``V - s (V - V_c)`` beyond ``V_c = V_0/(1 + n/n0)`` at the n-th release, joined over 2 % of
    V_c: the rim carries a share of what comes on top. Source: own; a second path for the force
    behind a gap. A kink at a height of the signal, which comes down drop by drop until smaller
    pulses meet it too.
    """

    id = "x_sinking_coupon"
    slot = "mounting"
    order = 2
    per_material = True
    parameters = (
        Parameter("share", "1", 3e-3, 0.3, 0.0, "s, carried by the rim beyond the gap"),
        Parameter("begins_v", "V", 1.5, 5.0, 3.0, "V_0, signal that closes the gap at first"),
        Parameter("drops_to_halve", "1", 8.0, 60.0, 20.0, "n0"),
    )

    def stage(self, shot: Shot) -> _Rim | None:
        """Return the rim as it is at this shot."""
        v = self.values
        if v["share"] == 0.0:
            return None
        return _Rim(v["share"], v["begins_v"] / (1.0 + shot.number / v["drops_to_halve"]))


class SlippingCoupon(Effect):
    """A coupon slides on its tape in steps, until somebody pushes it back.

    The mass that rides on the crystal changes by ``a (floor(n/N) mod 3)`` of the crystal's at
    the n-th release. Source: own. The ring's pitch jumps up and down between drops, on the
    coupons concerned.
    """

    id = "x_slipping_coupon"
    slot = "mounting"
    per_material = True
    parameters = (
        Parameter("mass_share", "1", 2e-4, 0.02, 0.0, "a, of one step", either_sign=True),
        Parameter("drops_between", "1", 4.0, 15.0, 8.0, "N"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        steps = math.floor(shot.number / self.values["drops_between"]) % 3
        mechanics.cell_mass_kg *= 1.0 + self.values["mass_share"] * steps


TAPE_DAMPING_RATIO = 0.1  # as soft polymers have it
TAPED_MASS_KG = 4e-3  # of the coupon that the damping ratio is meant for


class StiffeningTape(Effect):
    """The coupon's tape stiffens as it is squeezed, as any thin soft layer does.

    Force of the tape ``k_t q (1 + q/q1)``, q its compression, linear in tension. Source: own,
    first term of a confined layer. Ring and pulse shift with the coupon, and more in hard
    blows.
    """

    id = "x_stiffening_tape"
    slot = "mounting"
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 5e6, 5e8, math.inf, "k_t at rest"),
        Parameter("depth_m", "m", 5e-8, 5e-6, 1e-6, "q1, compression that doubles it"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        stiffness = self.values["stiffness_n_per_m"]
        if math.isinf(stiffness):
            return
        mechanics.coupon_mass_kg = mechanics.coupon_label_mass_kg
        mechanics.layer_stiffness_n_per_m = stiffness
        mechanics.layer_damping_n_s_per_m = (
            2.0 * TAPE_DAMPING_RATIO * math.sqrt(stiffness * TAPED_MASS_KG)
        )
        mechanics.layer_hardening_per_m = 1.0 / self.values["depth_m"]
