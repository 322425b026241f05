"""One rig for the tests of the effects, and the model under test at its physical values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import tf2ss

from analysis.effects.effect import Effect, ShotContext
from analysis.model.impact_model import (
    COUPON_SHARE,
    ImpactModel,
    Prediction,
    ShotFrame,
    model_named,
)

from .reference import Ground, Outcome, base_dashpot, impact

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rig:
    """A polymer sphere on a polymer coupon on the cell of the paper's Table 3."""

    radius: float = 4.76e-3
    mass: float = 0.407e-3
    stiffness: float = 4 / 3 * math.sqrt(4.76e-3) * 3e9 / (2 * (1 - 0.33**2))
    speed: float = 0.96
    restitution: float = 0.85
    cell_mass: float = 0.0354
    cell_stiffness: float = 4.16e8
    cell_damping: float = 560.0
    touch_down_us: float = 200.37
    samples: int = 1500
    coupon_mass: float = 3.6e-3
    drop_height: float = 0.047
    compliance_m_per_v: float = 1.2e-8
    coupon_share: float = 0.5
    poissons_ratio: float = 0.33
    place: float = 0.25

    @property
    def times(self) -> Array:
        """Return the sample times after touch-down."""
        return np.arange(self.samples) * 1e-6 - self.touch_down_us * 1e-6

    @property
    def ground(self) -> Ground:
        """Return the crystal on the frame."""
        return Ground([self.cell_mass], [(0, -1, self.cell_stiffness, self.cell_damping)])

    def dashpot(self, d: float, r: float) -> float:
        """Return the base model's dissipative force."""
        return float(base_dashpot(self.stiffness, self.mass, self.restitution)(d, r))

    def frame(self) -> ShotFrame:
        """Return the shot's fixed part."""
        return ShotFrame(
            1e6,
            self.samples,
            self.mass,
            9.80665,
            window_start_s=0.0123,
            radius_m=self.radius,
            drop_height_m=self.drop_height,
            coupon_mass_kg=self.coupon_mass,
            coupon_on_crystal_kg=self.coupon_mass,
            coupon_poissons_ratio=self.poissons_ratio,
            place=self.place,
        )

    def context(self) -> ShotContext:
        """Return what an effect may know."""
        return ShotContext(
            sample_rate_hz=1e6,
            window_start_s=0.0123,
            mass_kg=self.mass,
            stiffness=self.stiffness,
            speed_m_per_s=self.speed,
            touch_down_s=self.touch_down_us * 1e-6,
            radius_m=self.radius,
            drop_height_m=self.drop_height,
            coupon_mass_kg=self.coupon_mass,
            gravity_m_per_s2=9.80665,
            restitution=self.restitution,
            place=self.place,
        )

    def local(self, model: ImpactModel, values: Mapping[str, float] | None = None) -> Array:
        """Return local parameters; ``values`` are physical, by ``effect.parameter``."""
        omega = math.sqrt(self.cell_stiffness / self.cell_mass)
        gain = self.cell_stiffness * self.compliance_m_per_v if model.base != "hsd" else 1.0
        own = {
            "ln_K": math.log(self.stiffness),
            "ln_S": math.log(gain),
            "ln_w": math.log(omega),
            "ln_z": math.log(self.cell_damping / (2 * self.cell_mass * omega)),
            "ln_M": math.log(self.cell_mass),
            "ln_v0": math.log(self.speed),
            "ln_e": math.log(self.restitution),
            "t0_us": self.touch_down_us,
        }
        own |= dict.fromkeys(
            (name for name in model.names if name.endswith(COUPON_SHARE)), self.coupon_share
        )
        for effect in model.effects:
            for p in effect.parameters:
                own[f"{effect.id}.{p.name}"] = p.coordinate(
                    (values or {}).get(f"{effect.id}.{p.name}", p.starts[0])
                )
        return np.array([own.get(name, 0.0) for name in model.names])

    def steps(self, model: ImpactModel, local: Array) -> int:
        """Return the steps that model and effects ask for."""
        frame, values = self.frame(), model.effect_values(local)
        asked = [e.steps(values[e.id], self.context()) for e in model.effects if e.steps]
        return math.ceil(max([model.steps(local, frame), *asked]))

    def predict(self, name: str, values: Mapping[str, float] | None = None) -> Prediction:
        """Return the model's trace; in volts (kv) or newtons (hsd)."""
        model = model_named(name)
        local = self.local(model, values)
        return model.predict(local, self.frame(), steps=self.steps(model, local))

    def reference(self, **how: object) -> Outcome:
        """Return the reference impact, compression in volts; ``how`` as `impact` takes it."""
        how = {"ground": self.ground} | how
        found = impact(self.times, mass=self.mass, speed=self.speed, **how)  # type: ignore[arg-type]
        found.compression /= self.compliance_m_per_v
        return found

    def but(self, **changes: float) -> Rig:
        """Return this rig with something changed."""
        return replace(self, **changes)  # type: ignore[arg-type]


def neutral(effect: Effect) -> dict[str, float]:
    """Return the effect's neutral values: 0, infinity, or the limit where it is one."""
    limits = {
        "surface_roughness.roughness_m": 1e-16,
        "surface_roughness:toe.roughness_m": 1e-16,
        "surface_roughness:layer.roughness_m": 1e-16,
        "recontact.speed_ratio": 1e-9,
        "recontact:ringing.speed_ratio": 1e-9,
    }
    found = {}
    for p in effect.parameters:
        name = f"{effect.id}.{p.name}"
        plain = {"linear": 0.0, "inverse": math.inf, "log": p.starts[0]}[p.form]
        found[name] = limits.get(name, plain)
    return found


def simulated(system: tuple[Sequence[float], Sequence[float]], signal: Array) -> Array:
    """Return a filter's exact response to a signal at 1 MHz that is a parabola between samples.

    One matrix exponential carries the filter's state together with the parabola's value, slope and
    second derivative, which is the mean of the second differences at both ends; the signal is at
    rest before the first sample and straight behind the last.
    """
    scaled = [[c * 1e6**k for k, c in enumerate(reversed(part))][::-1] for part in system]
    a, b, c, d = tf2ss(*scaled)
    n = len(a)
    whole = np.zeros((n + 3, n + 3))
    whole[:n, :n], whole[:n, n : n + 1] = a, b
    whole[n, n + 1] = whole[n + 1, n + 2] = 1.0
    carry = expm(whole)[:n]
    wide = np.concatenate([[signal[0]], signal, [2 * signal[-1] - signal[-2]]])
    bend = np.diff(wide, 2)
    state = -np.linalg.solve(a, b[:, 0]) * signal[0]
    found = [signal[0] * float(d[0, 0]) + float(c[0] @ state)]
    for x, y, curve in zip(signal, signal[1:], 0.5 * (bend[1:] + bend[:-1]), strict=False):
        state = carry @ np.array([*state, x, y - x - curve / 2, curve])
        found.append(float(c[0] @ state) + float(d[0, 0]) * y)
    return np.array(found)


def apart(one: Array, other: Array) -> float:
    """Return the largest difference over the largest value of the second."""
    return float(np.abs(one - other).max() / np.abs(other).max())
