"""Invented: what is added to the signal on its way, and to the converter's codes.

No library knows these effects.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class AdcNonlinearity(Effect):
    """The converter's steps are uneven and some codes never come.

    Codes move by ``a sin(2 pi code / period)`` (integral nonlinearity) and every 64th code is
    missing.
    """

    id = "x_adc_nonlinearity"
    slot = "electronics"
    order = 90
    parameters = (
        Parameter("amplitude_codes", "1", 1.0, 150.0, 0.0, "a"),
        Parameter("period_codes", "1", 300.0, 6000.0, 2000.0, "of the error along the range"),
    )

    def conversion(self) -> NDArray[np.uint16] | None:
        """Return the converter's code for each ideal code."""
        amplitude = self.values["amplitude_codes"]
        if amplitude == 0.0:
            return None
        ideal = np.arange(65536)
        moved = ideal + amplitude * np.sin(2.0 * np.pi * ideal / self.values["period_codes"])
        codes: NDArray[np.uint16] = np.clip(np.rint(moved), 0, 65535).astype(np.uint16)
        codes[codes % 64 == 63] -= 1
        return codes


GRAVITY_M_PER_S2 = 9.80665  # only says when it lands
SPHERE_RADIUS_M = 4e-3  # R, as the spheres have it
CHARGE_TURNS_WITHIN_S = 2e-5  # a choice: short beside a contact


class ChargedSphere(Effect):
    """A rubbed sphere carries charge, and the cell's bare cap picks it up.

    ``a (1 + z/2) / (1 + u |t|/R)`` around the landing, u the impact speed and R = 4 mm, z a
    standard normal number of each shot; a share of the charge stays on the coupon at the touch,
    so that the sign turns within 20 us. Source: own; image charge on a plane, contact
    electrification. There before the trigger, in step with the impact, never through the
    crystal.
    """

    id = "x_charged_sphere"
    slot = "electronics"
    order = 81
    parameters = (
        Parameter("amplitude_v", "V", 1e-3, 0.2, 0.0, "a, at the touch"),
        Parameter("left_share", "1", 0.1, 2.0, 0.5, "of the charge left at the touch"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what is picked up."""
        size = self.values["amplitude_v"] * (1.0 + 0.5 * float(shot.rng.standard_normal()))
        if size == 0.0:
            return None
        fall_s = math.sqrt(2.0 * shot.drop_height_m / GRAVITY_M_PER_S2)
        since = t_s - fall_s
        near = 1.0 / (1.0 + GRAVITY_M_PER_S2 * fall_s * np.abs(since) / SPHERE_RADIUS_M)
        left = 0.5 * (1.0 + np.tanh(since / CHARGE_TURNS_WITHIN_S))
        return np.asarray(size * near * (1.0 - self.values["left_share"] * left))


SPIKE_DECAY_S = 3e-6  # tau, a choice: a few samples
SPIKE_FOLLOWED = 10.0  # times the decay


class Glitches(Effect):
    """Short spikes at arbitrary times, as a motor next door or a bad plug makes them.

    ``+-a exp(-t/tau)``, tau = 3 us, after intervals that are exponentially distributed, sizes
    too. Source: own; shot noise of large charges. There before the trigger, never in step with
    anything.
    """

    id = "x_glitches"
    slot = "electronics"
    order = 86
    parameters = (
        Parameter("amplitude_v", "V", 3e-3, 0.3, 0.0, "a, mean size"),
        Parameter("rate_hz", "1/s", 300.0, 1e4, 1e3, "spikes in a second"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the spikes of this shot."""
        if self.values["amplitude_v"] == 0.0 or t_s.size == 0:
            return None
        rng = shot.rng
        count = int(rng.poisson((t_s[-1] - t_s[0]) * self.values["rate_hz"]))
        spikes = np.zeros_like(t_s)
        for at in rng.uniform(t_s[0], t_s[-1], count):
            size = self.values["amplitude_v"] * rng.exponential() * rng.choice((-1.0, 1.0))
            a, b = np.searchsorted(t_s, (at, at + SPIKE_FOLLOWED * SPIKE_DECAY_S))
            spikes[a:b] += size * np.exp(-(t_s[a:b] - at) / SPIKE_DECAY_S)
        return spikes


class MicrophonicCable(Effect):
    """The valve's jolt makes the cable swing, and a swinging cable makes a voltage.

    ``a z exp(-t/tau) sin(2 pi f t + phase)``, t from the release, z (standard normal) and the
    phase free from shot to shot. Source: own; triboelectric noise of coaxial cables (Perls 1952
    measured it). There before the trigger, at a frequency that has nothing to do with the
    mains.
    """

    id = "x_microphonic_cable"
    slot = "electronics"
    order = 83
    parameters = (
        Parameter("amplitude_v", "V", 4e-4, 0.05, 0.0, "a, at the release"),
        Parameter("frequency_hz", "Hz", 400.0, 6000.0, 1500.0, "f of the swing"),
        Parameter("decay_s", "s", 0.03, 0.2, 0.1, "tau"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the voltage of this shot's swing."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        size = self.values["amplitude_v"] * float(shot.rng.standard_normal())
        if size == 0.0:
            return None
        ring = np.sin(2.0 * math.pi * self.values["frequency_hz"] * t_s + phase)
        return np.asarray(size * np.exp(-t_s / self.values["decay_s"]) * ring)


class PopcornNoise(Effect):
    """An input stage that jumps between two levels at its own times (burst noise).

    ``+-a``, changing after times that are exponentially distributed. Source: random telegraph
    signal (Machlup 1954). There before the trigger, never in step with anything.
    """

    id = "x_popcorn_noise"
    slot = "electronics"
    order = 84
    parameters = (
        Parameter("amplitude_v", "V", 5e-4, 0.05, 0.0, "a"),
        Parameter("dwell_s", "s", 5e-5, 1e-3, 2e-4, "mean time on one level"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the jumps of this shot."""
        if self.values["amplitude_v"] == 0.0 or t_s.size == 0:
            return None
        mean = (t_s[-1] - t_s[0]) / self.values["dwell_s"]
        jumps = np.sort(shot.rng.uniform(t_s[0], t_s[-1], shot.rng.poisson(mean)))
        level = np.searchsorted(jumps, t_s) % 2
        return np.asarray(self.values["amplitude_v"] * (2.0 * level - 1.0))


class SolenoidPickup(Effect):
    """The valve's solenoid rings when it lets go, and the cable picks that up.

    ``a exp(-t/tau) sin(2 pi f t)``, t from the release: the same in every shot at the same time
    after the valve, so that a higher drop meets a later and weaker part of it. Source: own;
    flyback of a coil into its snubber. There before the trigger, never in step with the impact.
    """

    id = "x_solenoid_pickup"
    slot = "electronics"
    order = 82
    parameters = (
        Parameter("amplitude_v", "V", 5e-4, 0.1, 0.0, "a, at the release"),
        Parameter("frequency_hz", "Hz", 300.0, 3000.0, 800.0, "f"),
        Parameter("decay_s", "s", 0.02, 0.1, 0.05, "tau"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what is picked up."""
        if self.values["amplitude_v"] == 0.0:
            return None
        ring = np.sin(2.0 * math.pi * self.values["frequency_hz"] * t_s)
        return np.asarray(self.values["amplitude_v"] * np.exp(-t_s / self.values["decay_s"]) * ring)


class StuckBit(Effect):
    """One bit of the converter is always set.

    Codes of every second stretch of ``2^b`` are lifted by ``2^b``. Source: own; a bad joint on
    a data line. Locked to the level of the signal, at rest and in the pulse.
    """

    id = "x_stuck_bit"
    slot = "electronics"
    order = 91
    parameters = (Parameter("bit", "1", 3.0, 9.0, -1.0, "b, counted from the lowest"),)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a bit, each as likely as any other."""
        return {"bit": float(rng.integers(3, 10))}

    def conversion(self) -> NDArray[np.uint16] | None:
        """Return the converter's code for each ideal code."""
        bit = round(self.values["bit"])
        if bit < 0:
            return None
        return np.arange(65536, dtype=np.uint16) | np.uint16(1 << bit)


WALK_SCALE_S = 1e-3  # in which it walks by a


class WanderingBaseline(Effect):
    """The baseline walks at random, every shot on a way of its own.

    Sum of independent steps, a in one millisecond. Source: own; a leaking input capacitor.
    There before the trigger, and in step with nothing.
    """

    id = "x_wandering_baseline"
    slot = "electronics"
    order = 88
    parameters = (
        Parameter("walk_v", "V", 5e-4, 0.1, 0.0, "a, standard deviation after one millisecond"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return this shot's way."""
        if self.values["walk_v"] == 0.0 or t_s.size < 2:
            return None
        steps = shot.rng.standard_normal(t_s.size)
        share = np.sqrt(np.diff(t_s, prepend=t_s[0]) / WALK_SCALE_S)
        return np.asarray(self.values["walk_v"] * np.cumsum(share * steps))
