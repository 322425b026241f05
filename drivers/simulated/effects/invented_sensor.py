"""Invented: what the crystal does with the force. No library knows these effects."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine, Gain, Memoryless, StateSpaceStage
from drivers.simulated.filters import resonance
from drivers.simulated.impact import Mechanics

RING_COMPRESSION_M = 1e-7  # D1, under 40 N on the paper's crystal


class AmplitudeDamping(Effect):
    """The crystal loses more of a large ring than of a small one.

    Damping of the cell times ``1 + a |D|/D1``, D its compression, D1 = 0.1 um. Source: own;
    micro-slip in glued and bolted joints (Goodman 1959), whose loss grows with the amplitude. A
    ring that falls fast at first and slowly later.
    """

    id = "x_amplitude_damping"
    slot = "sensor"
    parameters = (Parameter("growth", "1", 0.02, 20.0, 0.0, "a, at a compression of 0.1 um"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.damping_growth_per_m = self.values["growth"] / RING_COMPRESSION_M


class ChargeCreep(Effect):
    """The crystal's charge creeps, a spread of relaxation times instead of one.

    ``V + r sum_i (1/n) V * exp(-t/tau_i)/tau_i`` over one time per factor of four from 20 us to
    ``longest``.
    """

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


STRUCK_SPEED_M_PER_S = 0.77  # v1, after a fall of 30 mm
LEAST_STIFFNESS = 0.3  # share that no blow takes


class ConditionedCrystal(Effect):
    """A crystal that is softer the harder it was struck, from the first moment on.

    Stiffness of the cell times ``1 - a (v/v1)^2``, v the speed at touch-down, v1 = 0.77 m/s.
    Source: own; conditioning of cracked and glued solids (Johnson & Jia 2005), which heals
    before the next drop. Each shot has a pitch of its own.
    """

    id = "x_conditioned_crystal"
    slot = "sensor"
    parameters = (
        Parameter("softening", "1", 1e-4, 0.05, 0.0, "a, of stiffness at v1", either_sign=True),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the crystal's stiffness."""
        lost = self.values["softening"] * (speed_m_per_s / STRUCK_SPEED_M_PER_S) ** 2
        mechanics.cell_stiffness_n_per_m *= max(1.0 - lost, LEAST_STIFFNESS)


@njit(cache=True)
def _leak(volts, q, leak, back, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        y = volts[i] - q
        # the film passes at most what drives it, however coarse the step
        q += y * min(leak * y * y, 1.0) - back * q
        out[i] = volts[i] - q
    return q


class _Film:
    def __init__(self, leak_per_s: float, return_s: float) -> None:
        self._leak_per_s, self._return_s, self._q = leak_per_s, return_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        leak, back = step_s * self._leak_per_s, step_s / self._return_s
        self._q = float(_leak(volts, self._q, leak, back, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._q) < threshold_v


class DampCrystal(Effect):
    """A damp film on the crystal's edge leaks, and the more the higher the voltage.

    ``y = V - q``, ``q' = b y^3/V1^2 - q/tau``, V1 = 1 V: charge creeps over and comes back
    later. Source: own; conduction that grows with the field, as of dirty insulators. Large
    pulses lose at their back and swing under zero for a while, small ones next to nothing: no
    time constant fits both.
    """

    id = "x_damp_crystal"
    slot = "sensor"
    order = 22
    parameters = (
        Parameter("leak_per_s", "1/s", 0.3, 100.0, 0.0, "b, at 1 V"),
        Parameter("return_s", "s", 5e-4, 2e-2, 3e-3, "tau, until the charge is back"),
    )

    def stage(self, shot: Shot) -> _Film | None:
        """Return the film."""
        v = self.values
        return None if v["leak_per_s"] == 0.0 else _Film(v["leak_per_s"], v["return_s"])


class _DeadZone(Memoryless):
    def __init__(self, width_v: float) -> None:
        self._width_v = width_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(volts - self._width_v * np.tanh(volts / self._width_v))


class DeadZone(Effect):
    """The sensor says less than it should near zero (crossover distortion).

    ``V - w tanh(V/w)``: a signal well above ``w`` loses w, the end of the ring vanishes.
    Source: own, smooth form of the dead zone of a class-B stage (Horowitz & Hill 2015, 2.4) or
    of a stack with a gap.
    """

    id = "x_dead_zone"
    slot = "sensor"
    order = 14
    parameters = (Parameter("width_v", "V", 3e-4, 0.1, 0.0, "w, what is lost"),)

    def stage(self, shot: Shot) -> _DeadZone | None:
        """Return the dead zone."""
        width = self.values["width_v"]
        return None if width == 0.0 else _DeadZone(width)


DISPERSED_ECHO_DAMPING_RATIO = 0.9  # a choice: smeared, without a ring


class _Echo:
    def __init__(self, ratio: float, delay_s: float, smear: StateSpaceStage) -> None:
        self._ratio, self._delay_s, self._smear = ratio, delay_s, smear
        self._past = DelayLine(delay_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        late = self._past.at(self._past.hear(volts, step_s) - self._delay_s)
        return np.asarray(volts - self._ratio * self._smear.process(late, step_s))

    def is_quiet(self, threshold_v: float) -> bool:
        silent = self._past.is_quiet(threshold_v / abs(self._ratio))
        return silent and self._smear.is_quiet(threshold_v)


class DispersedEcho(Effect):
    """A wave comes back from the cell's far end, turned over and smeared on its way.

    ``V - r (V late by T) through two poles at f``. Source: own; reflection at a free end,
    losses that grow with the pitch. No copy of the signal: an area without its edges.
    """

    id = "x_dispersed_echo"
    slot = "sensor"
    order = 9
    fine_grid = True
    parameters = (
        Parameter("ratio", "1", 1.5e-3, 0.15, 0.0, "r"),
        Parameter("delay_s", "s", 1e-5, 2e-4, 5e-5, "T"),
        Parameter("smear_hz", "Hz", 1.5e3, 1.5e4, 5e3, "f of the two poles"),
    )

    def stage(self, shot: Shot) -> _Echo | None:
        """Return the wave."""
        v = self.values
        if v["ratio"] == 0.0:
            return None
        return _Echo(
            v["ratio"],
            v["delay_s"],
            resonance(v["smear_hz"], DISPERSED_ECHO_DAMPING_RATIO, 1.0, 0.0),
        )


DRY_STAND_DAMPING_RATIO = 0.005  # a choice: friction takes the rest


class DryStand(Effect):
    """The stand gives way and rubs on what it stands on, until friction holds it.

    A base mass on a spring of frequency ``f``, with dry friction ``F`` and hardly a dashpot.
    Source: own; oscillator with Coulomb's friction (Den Hartog 1931). Its ring falls by equal
    steps and ends.
    """

    id = "x_dry_stand"
    slot = "sensor"
    parameters = (
        Parameter("base_mass_kg", "kg", 0.1, 30.0, math.inf, "of the stand"),
        Parameter("frequency_hz", "Hz", 500.0, 5e3, 2e3, "f of the stand on its spring"),
        Parameter("friction_n", "N", 0.03, 3.0, 0.0, "F"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mass, w = self.values["base_mass_kg"], 2.0 * math.pi * self.values["frequency_hz"]
        if math.isinf(mass):
            return
        mechanics.base_mass_kg = mass
        mechanics.base_stiffness_n_per_m = mass * w * w
        mechanics.base_damping_n_s_per_m = 2.0 * DRY_STAND_DAMPING_RATIO * mass * w
        mechanics.base_friction_n = self.values["friction_n"]


@njit(cache=True)
def _follow(volts, before, z, reach, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        change = volts[i] - before
        z += change - abs(change) * z * abs(z) / (reach * reach)
        before = volts[i]
        out[i] = z
    return z


class _BoucWen:
    def __init__(self, share: float, reach_v: float) -> None:
        self._share, self._reach_v = share, reach_v
        self._before_v, self._z = 0.0, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        z = np.zeros_like(volts)
        self._z = float(_follow(volts, self._before_v, self._z, self._reach_v, z))
        self._before_v = float(volts[-1])
        # What stays behind leaks away with the charge; the offset of rest is no signal.
        return np.asarray(volts + self._share * (z - np.linspace(0.0, self._z, z.size)))

    def is_quiet(self, threshold_v: float) -> bool:
        return True


class HystereticSensor(Effect):
    """The crystal's charge lags behind its load (Bouc-Wen hysteresis).

    ``V + h z``, ``z' = V' - |V'| z |z| / z0^2``: z follows V up to about ``z0`` and keeps it on
    the way back.
    """

    id = "x_hysteretic_sensor"
    slot = "sensor"
    order = 12
    fine_grid = True
    parameters = (
        Parameter("share", "1", 0.0015, 0.2, 0.0, "h", either_sign=True),
        Parameter("reach_v", "V", 0.2, 3.0, 1.0, "z0"),
    )

    def stage(self, shot: Shot) -> _BoucWen:
        """Return the hysteresis."""
        return _BoucWen(self.values["share"], self.values["reach_v"])


class OffCentre(Effect):
    """An off-centre hit on the cell loads its crystal only in part.

    Gain ``1 - a z^2`` with z a standard normal number of each shot: never more than a central
    hit gives. Source: own, first term of any smooth sensitivity with its maximum in the middle.
    """

    id = "x_off_centre"
    slot = "sensor"
    order = 15
    parameters = (Parameter("mean_loss", "1", 3e-4, 0.03, 0.0, "a, mean loss of gain"),)

    def stage(self, shot: Shot) -> Gain:
        """Return this hit's gain."""
        return Gain(1.0 - self.values["mean_loss"] * float(shot.rng.standard_normal()) ** 2)


class _TwoGains(Memoryless):
    def __init__(self, change: float) -> None:
        self._change = change

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(np.where(volts < 0.0, (1.0 + self._change) * volts, volts))


class PushPullGain(Effect):
    """The crystal gives another charge for pull than for push.

    ``V`` where it is positive, ``(1 + a) V`` where it is negative. Source: own; a stack whose
    preload is too small reads tension through its bolt alone. A kink at zero.
    """

    id = "x_push_pull_gain"
    slot = "sensor"
    order = 13
    parameters = (
        Parameter("change", "1", 1e-3, 0.15, 0.0, "a, of the gain in pull", either_sign=True),
    )

    def stage(self, shot: Shot) -> _TwoGains | None:
        """Return the two gains."""
        change = self.values["change"]
        return None if change == 0.0 else _TwoGains(change)


ROOM_SOFTENING = 0.15  # 0.03 % of stiffness over 0.2 % of charge, in a kelvin


class RoomTemperature(Effect):
    """The room warms and cools while the drops go on, and the crystal with it.

    Gain ``1 + a s`` and crystal stiffness times ``1 - 0.15 a s``, ``s = sin(2 pi n/N)`` at the
    n-th release. Source: own; lead zirconate titanate gains some 0.2 % of charge and softens by
    some 0.03 % in a kelvin. A drift that comes back.
    """

    id = "x_room_temperature"
    slot = "sensor"
    order = 16
    parameters = (
        Parameter("change", "1", 5e-4, 0.04, 0.0, "a, of the gain", either_sign=True),
        Parameter("drops_a_turn", "1", 12.0, 60.0, 30.0, "N"),
    )

    def _now(self, shot: Shot) -> float:
        turns = shot.number / self.values["drops_a_turn"]
        return self.values["change"] * math.sin(2.0 * math.pi * turns)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the crystal's stiffness."""
        mechanics.cell_stiffness_n_per_m *= 1.0 - ROOM_SOFTENING * self._now(shot)

    def stage(self, shot: Shot) -> Gain:
        """Return this shot's gain."""
        return Gain(1.0 + self._now(shot))


SQUARED_MODE_DAMPING_RATIO = 0.01  # a choice: falls to 1/e in sixteen periods


class _Bulge:
    def __init__(self, share: float, frequency_hz: float) -> None:
        self._mode = resonance(frequency_hz, SQUARED_MODE_DAMPING_RATIO, share, 0.0)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(volts + self._mode.process(volts * volts, step_s))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._mode.is_quiet(threshold_v)


class SquaredMode(Effect):
    """The crystal bulges as it is pressed, and the bulge rings on its own.

    ``V + r g * V^2/V1``, V1 = 1 V, g a damped sine of frequency ``f`` and area one. Source:
    own; a sideways mode that the square of the compression drives, as geometry does at second
    order (Nayfeh & Mook 1979). A line beside the ring that grows with the square of the pulse,
    and is not there in low drops.
    """

    id = "x_squared_mode"
    slot = "sensor"
    order = 11
    parameters = (
        Parameter("share", "1", 3e-5, 0.01, 0.0, "r, at a signal of 1 V", either_sign=True),
        Parameter("frequency_hz", "Hz", 4e3, 2.5e4, 1e4, "f"),
    )

    def stage(self, shot: Shot) -> _Bulge | None:
        """Return the mode, at rest."""
        share = self.values["share"]
        return None if share == 0.0 else _Bulge(share, self.values["frequency_hz"])


TABLE_MODES = 7  # a choice: the last is 49 times as high
TABLE_WAVE_DAMPING_RATIO = 0.03  # a choice: falls to 1/e in five periods


class TableWave(Effect):
    """The table bends under the cell and sends the blow back, its high notes first.

    Adds ``r V * sum_j (-1)^j g_j``, g_j damped sines of f, 4 f, 9 f, ... with an integral of
    one over the number of them: modes of a beam, whose sum is an echo that disperses. Source:
    own; frequencies of a bar in bending (Rayleigh, Theory of Sound, ch. 8).
    """

    id = "x_table_wave"
    slot = "sensor"
    order = 8
    parameters = (
        Parameter("share", "1", 5e-4, 0.1, 0.0, "r", either_sign=True),
        Parameter("frequency_hz", "Hz", 300.0, 2000.0, 800.0, "f of the lowest mode"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the table."""
        if self.values["share"] == 0.0:
            return None
        system, enters = np.zeros((2 * TABLE_MODES, 2 * TABLE_MODES)), np.zeros(2 * TABLE_MODES)
        leaves = np.zeros(2 * TABLE_MODES)
        for j in range(TABLE_MODES):
            w = 2.0 * math.pi * self.values["frequency_hz"] * (j + 1) ** 2
            at = slice(2 * j, 2 * j + 2)
            system[at, at] = [[0.0, 1.0], [-w * w, -2.0 * TABLE_WAVE_DAMPING_RATIO * w]]
            enters[2 * j + 1] = 1.0
            leaves[2 * j] = (-1) ** j * self.values["share"] * w * w / TABLE_MODES
        return StateSpaceStage(system, enters, leaves, 1.0)
