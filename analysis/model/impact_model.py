"""From the local parameters of one shot to its trace, its rebound and their derivatives.

Local parameters are logarithms wherever the quantity is positive, so no bound is ever needed and
nothing is clamped. Shared ones belong to rig, pair or material; nuisances to the shot.

========== ============================ ======================================================
name       quantity                     unit of its exponential
========== ============================ ======================================================
ln_K       contact stiffness            N m^-1.5 (N m^-1.5 per kg in reduced units)
ln_S       gain S = k c; S of Eq. 7     N/V (kg or 1 for acceleration and force recordings)
ln_w       crystal frequency omega0     rad/s (KV)
ln_z       crystal damping ratio zeta   1 (KV)
ln_M       crystal mass                 kg (KV; acts only through the recoil)
seen_ms    when the rebound was seen    ms after lift-off (of a stated restitution, not of a trace)
ln_v0      impact speed                 m/s (nuisance)
ln_e       Eq. 6's restitution          1 (nuisance)
t0_us      touch-down, in microseconds  after the window's first sample (nuisance)
baseline   offset                       unit of the signal (nuisance)
========== ============================ ======================================================

The output is ``k Delta / S`` (KV) or ``F_el / S`` (HSD), plus the baseline. Effects add shared
local parameters named ``<effect>.<parameter>``, in the coordinate that the effect states; what has
no effect runs through the base solver alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.effects.effect import Effect, ShotContext
from analysis.effects.library import contact_terms, effect_named
from analysis.errors import UnknownModelError
from analysis.model import solver
from analysis.model.effect_solver import integrate_with_effects
from analysis.model.hertz import contact_time, damping_coefficient
from analysis.model.structure import Structure

SHARED = {
    solver.HSD: ("ln_K", "ln_S", "seen_ms"),
    solver.KV: ("ln_K", "ln_S", "ln_w", "ln_z", "ln_M", "seen_ms"),
}
NUISANCE = ("ln_v0", "ln_e", "t0_us", "baseline")

Array = NDArray[np.float64]

_LARGEST_COORDINATE = 200.0
"""Beyond this a logarithm overflows; such a point has no trace, and a fit steps back from it."""
_LOG_STEP = 1e-6
_TIME_STEP_US = 1e-4


@dataclass(frozen=True)
class ShotFrame:
    """What of a shot is fixed during a fit.

    Attributes
    ----------
    sample_rate_hz : float
        [Hz]
    samples : int
        Length of the fit window.
    mass_kg : float
        Sphere mass; 1 in reduced units. [kg]
    gravity_m_per_s2 : float
        [m/s^2]
    window_start_s : float
        First sample of the window after the record's first. [s]
    radius_m, drop_height_m, coupon_mass_kg, coupon_thickness_m : float or None
        For effects that need them; None where unknown.
    """

    sample_rate_hz: float
    samples: int
    mass_kg: float
    gravity_m_per_s2: float
    window_start_s: float = 0.0
    radius_m: float | None = None
    drop_height_m: float | None = None
    coupon_mass_kg: float | None = None
    coupon_thickness_m: float | None = None


@dataclass(frozen=True)
class Prediction:
    """A trace with what the fit needs beside it.

    Attributes
    ----------
    signal : ndarray, shape (n,)
        Baseline included. [unit of the signal]
    rebound_ratio : float
        Sphere's rebound speed over its impact speed. [1]
    contact_time_s : float
        [s]
    deepest_indentation_m : float
        [m]
    """

    signal: NDArray[np.float64]
    rebound_ratio: float
    contact_time_s: float
    deepest_indentation_m: float


@dataclass(frozen=True)
class ImpactModel:
    """A base model by name, with the effects added to it.

    Attributes
    ----------
    base : str
        ``hsd`` or ``kv``.
    kind : int
        `solver.HSD` or `solver.KV`.
    effects : tuple of Effect
        In the order they were added.
    step_share : float
        Share of the steps that an error of 1e-6 of the peak needs; the error goes like its fifth
        power. The discovery, which fits hundreds of models to noise of 1e-4, takes 0.75.
    """

    base: str
    kind: int
    effects: tuple[Effect, ...] = ()
    step_share: float = 1.0

    @property
    def name(self) -> str:
        """Return the name, e.g. ``kv+coupler_highpass``."""
        return "+".join((self.base, *(e.id for e in self.effects)))

    @cached_property
    def shared(self) -> tuple[str, ...]:
        """Return the names of the shared local parameters, in order."""
        extra = tuple(f"{e.id}.{p.name}" for e in self.effects for p in e.parameters)
        return SHARED[self.kind] + extra

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return all local parameters: shared, then nuisances."""
        return self.shared + self.nuisances

    @cached_property
    def nuisances(self) -> tuple[str, ...]:
        """Return the names of a shot's own parameters."""
        extra = (f"{e.id}.basis{i}" for e in self.effects for i in range(e.basis_size))
        return (*NUISANCE, *extra)

    def with_effect(self, effect: Effect) -> ImpactModel:
        """Return this model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def steps(self, local: Array, frame: ShotFrame) -> int:
        """Return the solver's steps for these parameters; kept while derivatives are taken."""
        duration = contact_time(
            math.exp(local[0]), frame.mass_kg, math.exp(local[len(self.shared)])
        )
        omega0 = math.exp(local[2]) if self.kind == solver.KV else 0.0
        least = float(solver.contact_steps(omega0, duration))
        if any(e.steps is not None for e in self.effects):
            values, context = self.effect_values(local), self.context(local, frame)
            asked = [e.steps(values[e.id], context) for e in self.effects if e.steps is not None]
            least = max(least, *asked)
        return math.ceil(self.step_share * min(least, 2.0 * solver.MAX_STEPS))

    def predict(self, local: Array, frame: ShotFrame, *, steps: int | None = None) -> Prediction:
        """Return the trace of one shot.

        Parameters
        ----------
        local : ndarray, shape (len(names),)
            Local parameters in the order of ``names``.
        frame : ShotFrame
            The shot's fixed part.
        steps : int, optional
            Solver steps; by default from `steps`.

        Returns
        -------
        Prediction
            NaN rebound when the contact did not end.
        """
        nothing = Prediction(np.full(frame.samples, math.nan), math.nan, math.nan, math.nan)
        if not np.abs(local[: len(self.shared) + 2]).max() < _LARGEST_COORDINATE:
            return nothing
        try:
            return self._predicted(local, frame, steps)
        except OverflowError:  # an effect's numbers that no float can hold
            return nothing

    def _predicted(self, local: Array, frame: ShotFrame, steps: int | None) -> Prediction:
        """Return the trace, or raise OverflowError."""
        signal = np.zeros(frame.samples)
        if steps is None:
            steps = self.steps(local, frame)
        if steps > solver.MAX_STEPS:
            raise OverflowError
        if self.effects:
            duration, rebound, deepest = self._add_with_effects(signal, local, frame, steps)
        else:
            duration, rebound, deepest = self._add_to(signal, local, frame, steps)
        at = len(self.shared)
        signal += local[at + 3]
        if self.effects:
            self._add_basis(signal, local, frame)
        return Prediction(signal, rebound / math.exp(local[at]), duration, deepest)

    def _add_basis(self, signal: Array, local: Array, frame: ShotFrame) -> None:
        """Add the signals of free size, each with this shot's own coefficients."""
        at = len(self.shared) + len(NUISANCE)
        for effect in self.effects:
            if effect.basis is not None:
                columns = effect.basis(frame.samples, self.context(local, frame))
                signal += columns @ local[at : at + effect.basis_size]
                at += effect.basis_size

    def _crystal(self, local: Array) -> tuple[float, float, float, float]:
        """Return M, k, mu and the gain on the output, from the identifiable forms."""
        if self.kind != solver.KV:
            return math.nan, math.nan, math.nan, math.exp(-local[1])
        omega0, zeta, mass = math.exp(local[2]), math.exp(local[3]), math.exp(local[4])
        k = mass * omega0**2
        return mass, k, 2 * zeta * mass * omega0, k * math.exp(-local[1])

    def _add_to(
        self, signal: Array, local: Array, frame: ShotFrame, steps: int
    ) -> tuple[float, float, float]:
        """Integrate the base model into ``signal``."""
        crystal_mass, k, mu, gain = self._crystal(local)
        ln_v0, ln_e, t0_us = local[len(self.shared) : len(self.shared) + 3]
        found = solver.integrate(
            signal,
            self.kind,
            -t0_us * 1e-6,
            1.0 / frame.sample_rate_hz,
            math.exp(local[0]),
            frame.mass_kg,
            math.exp(ln_v0),
            damping_coefficient(math.exp(ln_e)),
            frame.gravity_m_per_s2,
            crystal_mass,
            k,
            mu,
            gain,
            steps,
        )
        return float(found[0]), float(found[1]), float(found[2])

    def context(self, local: Array, frame: ShotFrame) -> ShotContext:
        """Return what the effects may know of a shot at these local parameters."""
        at = len(self.shared)
        return ShotContext(
            sample_rate_hz=frame.sample_rate_hz,
            window_start_s=frame.window_start_s,
            mass_kg=frame.mass_kg,
            stiffness=math.exp(local[0]),
            speed_m_per_s=math.exp(local[at]),
            touch_down_s=float(local[at + 2]) * 1e-6,
            restitution=math.exp(local[at + 1]),
            radius_m=frame.radius_m,
            drop_height_m=frame.drop_height_m,
            coupon_mass_kg=frame.coupon_mass_kg,
            coupon_thickness_m=frame.coupon_thickness_m,
            gravity_m_per_s2=frame.gravity_m_per_s2,
        )

    def speed_shift(self, local: Array, frame: ShotFrame) -> float:
        """Return by how much effects shift ln of the speed that the drop height promises."""
        having = [e for e in self.effects if e.speed is not None]
        if not having:
            return 0.0
        values, context = self.effect_values(local), self.context(local, frame)
        return sum(e.speed(values[e.id], context) for e in having if e.speed is not None)

    def effect_values(self, local: Array) -> dict[str, dict[str, float]]:
        """Return the effects' physical values at these local parameters.

        Parameters
        ----------
        local : ndarray, shape (p,)
            Local parameters; only the shared ones are read.

        Returns
        -------
        dict of dict
            By effect id, by parameter name.
        """
        at = len(SHARED[self.kind])
        values: dict[str, dict[str, float]] = {}
        for effect in self.effects:
            own = {}
            for parameter in effect.parameters:
                own[parameter.name] = parameter.value(float(local[at]))
                at += 1
            values[effect.id] = own
        return values

    def _add_with_effects(
        self, signal: Array, local: Array, frame: ShotFrame, steps: int
    ) -> tuple[float, float, float]:
        """Integrate the model with its effects into ``signal``, then read it through the chain."""
        values = self.effect_values(local)
        context = self.context(local, frame)
        if any(e.in_solver for e in self.effects):
            found = self._solve_with_effects(
                signal, local, frame, steps=steps, values=values, context=context
            )
        else:
            found = self._add_to(signal, local, frame, steps)
        for effect in self.effects:
            if effect.again is not None:
                self._add_again(signal, local, frame, steps, effect.again(values[effect.id]))
        for effect in sorted(self.effects, key=lambda e: e.order):
            if effect.output is not None:
                signal[:] = effect.output(signal, values[effect.id], context)
        return found

    def _add_again(
        self,
        signal: Array,
        local: Array,
        frame: ShotFrame,
        steps: int,
        second: tuple[float, float],
    ) -> None:
        """Add a second contact, (delay [s], speed over the first speed), in the base model."""
        at, (delay_s, ratio) = len(self.shared), second
        later = local.copy()
        later[at] += math.log(ratio)
        later[at + 2] += delay_s * 1e6
        self._add_to(signal, later, frame, steps)

    def _solve_with_effects(
        self,
        signal: Array,
        local: Array,
        frame: ShotFrame,
        *,
        steps: int,
        values: dict[str, dict[str, float]],
        context: ShotContext,
    ) -> tuple[float, float, float]:
        terms, places = contact_terms()
        packed = np.zeros((max(len(terms), 1), 5))
        active, share, mobility = [], 0.0, 0.0
        crystal_mass, k, mu, gain = self._crystal(local)
        structure = Structure.kelvin_voigt(crystal_mass, k, mu)
        for effect in self.effects:
            own = values[effect.id]
            if effect.contact is not None and effect.pack is not None:
                packed[places[effect.id], :4] = effect.pack(own, context)
                active.append(places[effect.id])
            if effect.share is not None:
                share = effect.share(own)
            if effect.mobility is not None:
                mobility += effect.mobility(own)
            if effect.structure is not None:
                effect.structure(structure, own, context)
        system, load, reading, top = structure.assemble()
        if self.kind == solver.HSD:
            system, load, reading, top = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0
        ln_v0, ln_e, t0_us = local[len(self.shared) : len(self.shared) + 3]
        found = integrate_with_effects(
            signal,
            -t0_us * 1e-6,
            1.0 / frame.sample_rate_hz,
            math.exp(local[0]),
            frame.mass_kg,
            math.exp(ln_v0),
            damping_coefficient(math.exp(ln_e)),
            frame.gravity_m_per_s2,
            share,
            mobility,
            terms,
            np.array(sorted(active), dtype=np.int64),
            packed,
            system,
            load,
            reading,
            top,
            gain,
            steps,
        )
        return float(found[0]), float(found[1]), float(found[2])

    def linearise(self, local: Array, frame: ShotFrame) -> tuple[Prediction, Array, Array]:
        """Return the trace with the derivatives of signal and rebound ratio.

        Parameters
        ----------
        local : ndarray, shape (p,)
            Local parameters.
        frame : ShotFrame
            The shot's fixed part.

        Returns
        -------
        prediction : Prediction
            At ``local``.
        jacobian : ndarray, shape (n, p)
            Derivative of the signal. [unit of the signal per unit of the parameter]
        rebound_gradient : ndarray, shape (p,)
            Derivative of the rebound ratio.

        Notes
        -----
        One-sided differences on one grid: the solver is smooth in every parameter, so a step of
        1e-6 leaves about 1e-6 relative of truncation and 1e-8 of rounding. Baseline and free sizes
        are analytic, and so is the gain of a linear chain.
        """
        steps = self.steps(local, frame)
        centre = self.predict(local, frame, steps=steps)
        jacobian = np.zeros((frame.samples, local.size), order="F")
        gradient = np.zeros(local.size)
        linear = not any(e.output is not None or e.basis is not None for e in self.effects)
        at = len(self.shared)
        for j, name in enumerate(self.names[: at + len(NUISANCE)]):
            if name == "baseline":
                jacobian[:, j] = 1.0
            elif name == "ln_S" and linear:
                jacobian[:, j] = local[at + 3] - centre.signal
            elif name != "seen_ms":
                step = _TIME_STEP_US if name == "t0_us" else _LOG_STEP
                moved = local.copy()
                moved[j] += step
                ahead = self.predict(moved, frame, steps=steps)
                jacobian[:, j] = (ahead.signal - centre.signal) / step
                if name != "t0_us":
                    gradient[j] = (ahead.rebound_ratio - centre.rebound_ratio) / step
        place = at + len(NUISANCE)
        for effect in self.effects:
            if effect.basis is not None:
                columns = effect.basis(frame.samples, self.context(local, frame))
                jacobian[:, place : place + effect.basis_size] = columns
                place += effect.basis_size
        return centre, jacobian, gradient


BASES = {"hsd": solver.HSD, "kv": solver.KV}


def model_named(name: str) -> ImpactModel:
    """Return a model by its name.

    Parameters
    ----------
    name : str
        ``hsd`` or ``kv``, then effects: ``kv+coupler_highpass+echo``.

    Returns
    -------
    ImpactModel
        The model.

    Raises
    ------
    UnknownModelError
        If there is no such base or effect; the message lists those there are.
    """
    base, *effects = name.split("+")
    if base not in BASES:
        raise UnknownModelError(
            f"There is no base model {base!r}; known are {', '.join(sorted(BASES))}, each with "
            "effects added as in kv+coupler_highpass."
        )
    if len(set(effects)) != len(effects):
        raise UnknownModelError(f"{name!r} names an effect twice.")
    return ImpactModel(base, BASES[base], tuple(effect_named(e) for e in effects))
