"""From the local parameters of one shot to its trace, its rebound and their derivatives.

Local parameters are logarithms wherever the quantity is positive, so no bound is ever needed and
nothing is clamped. Shared ones belong to rig, pair or material; nuisances to the shot.

========== ============================ ======================================================
name       quantity                     unit of its exponential
========== ============================ ======================================================
ln_K       contact stiffness            N m^-1.5 (N m^-1.5 per kg in reduced units)
ln_S       gain S = k c; S of Eq. 7     N/V (kg or 1 for acceleration and force recordings)
ln_w       crystal frequency omega0     rad/s (KV; sqrt(k/M) without a coupon)
ln_z       crystal damping ratio zeta   1 (KV; without a coupon)
ln_M       crystal mass                 kg (KV; acts only through the recoil, in kv2 by the coupon)
seen_ms    when the rebound was seen    ms after lift-off (of a stated restitution, not of a trace)
ln_v0      impact speed                 m/s (nuisance)
ln_e       Eq. 6's restitution          1 (nuisance; in kv2 where the force ends, on a rigid cell)
t0_us      touch-down, in microseconds  after the window's first sample (nuisance)
baseline   offset                       unit of the signal (nuisance)
========== ============================ ======================================================

The base model ``kv2`` is KV closed: the dashpot's force loads the crystal too (third law), the
coupon's known mass rides on the crystal, and the contact ends when its total force does. Delta is
counted from where the cell rests under its own and the coupon's weight, so neither shows.

The output is ``k Delta / S`` (KV) or ``F_el / S`` (HSD), plus the baseline. Effects add local
parameters named ``<effect>.<parameter>``, in the coordinate that the effect states: shared ones,
or, where a number belongs to the shot, nuisances behind the four. Sizes of free signals come last.
What has no effect runs through the base solver alone.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Array
from analysis.campaign import UNKNOWN_POISSONS_RATIO
from analysis.effects.effect import Effect, EffectParameter, ShotContext
from analysis.effects.library import effect_named
from analysis.errors import UnknownModelError
from analysis.model import neighbours, solver
from analysis.model.effect_trace import Column, EffectValues
from analysis.model.hertz import contact_time
from analysis.parameters import of_effect

SHARED = {
    solver.HSD: ("ln_K", "ln_S", "seen_ms"),
    solver.KV: ("ln_K", "ln_S", "ln_w", "ln_z", "ln_M", "seen_ms"),
}
NUISANCE = ("ln_v0", "ln_e", "t0_us", "baseline")
REACTION, COUPON, FORCE_END = LAWS = ("reaction", "coupon", "force_end")
"""Laws of mechanics that ``kv2`` obeys and the paper's models do not: the dashpot's force loads the
crystal, the coupon rides on it, and a contact ends where its force does."""
COUPON_SHARE = "coupon_share"
"""Behind an effect's id: a local parameter that follows from the moduli of the two bodies."""


_LARGEST_COORDINATE = 200.0
"""Beyond this a logarithm overflows; such a point has no trace, and a fit steps back from it."""


@dataclass(frozen=True)
class ShotFrame:
    """What of a shot is fixed during a fit."""

    sample_rate_hz: float
    samples: int
    """Length of the fit window."""
    mass_kg: float
    """Sphere mass; 1 in reduced units. [kg]"""
    gravity_m_per_s2: float
    window_start_s: float = 0.0
    """First sample of the window after the record's first. [s]"""
    radius_m: float | None = None
    """This, ``drop_height_m`` and ``coupon_mass_kg`` are for effects that need them; None where
    unknown."""
    drop_height_m: float | None = None
    coupon_mass_kg: float | None = None
    rail: tuple[float, float] | None = None
    """Ends of the converter's range, where the record reaches one. [unit of the signal]"""
    sphere: str | None = None
    surface: str | None = None
    coupon_on_crystal_kg: float = 0.0
    """What ``kv2`` adds to the crystal's mass; 0 where unknown, or where the crystal's own mass is
    no parameter. [kg]"""
    coupon_poissons_ratio: float = UNKNOWN_POISSONS_RATIO.value
    place: float = 0.0
    """Of the shot in the order of its campaign: -0.5 the first, 0.5 the last. [1]"""

    def cut(self, signal: Array, jacobian: Array | None = None) -> None:
        """Hold a signal within the converter's range; beyond it nothing moves it.

        The signal, shape (n,), and its derivatives, shape (n, p), are overwritten.
        """
        if self.rail is None:
            return
        low, high = self.rail
        if jacobian is not None:
            jacobian[(signal > high) | (signal < low)] = 0.0
        np.clip(signal, low, high, out=signal)


_READ_BY_BASES = operator.attrgetter(
    "sample_rate_hz", "samples", "mass_kg", "gravity_m_per_s2", "rail", "coupon_on_crystal_kg"
)
"""What a trace without effects depends on: not on radius, height and the coupon's own numbers."""


@dataclass(frozen=True)
class Prediction:
    """A trace with what the fit needs beside it."""

    signal: NDArray[np.float64]
    """Baseline included, shape (n,). [unit of the signal]"""
    rebound_ratio: float
    """Sphere's rebound speed over its impact speed. [1]"""
    contact_time_s: float
    deepest_indentation_m: float


def _nothing(frame: ShotFrame) -> Prediction:
    return Prediction(np.full(frame.samples, math.nan), math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class ImpactModel:
    """A base model by name, with the effects added to it."""

    base: str
    """``hsd``, ``kv`` or ``kv2``."""
    kind: int
    """`solver.HSD` or `solver.KV`."""
    effects: tuple[Effect, ...] = ()
    """In the order they were added."""
    step_share: float = 1.0
    """Share of the steps that an error of 1e-6 of the peak needs; the error goes like its fifth
    power. A diagnosis, which fits hundreds of models to noise of 1e-4, takes 0.75."""
    closed: bool = False
    """`LAWS` and a fall in air; ``kv2``."""
    left_out: tuple[str, ...] = ()
    """Which of `LAWS` it leaves out all the same, in their order."""
    most_steps: float = math.inf
    """That an effect's own motion may ask for. A model that asks for more has no trace: a fit turns
    back there, from a tape of a stiffness and damping that nothing has."""

    @property
    def name(self) -> str:
        """Return the name, e.g. ``kv+coupler_highpass``."""
        return "+".join((self.base_name, *(e.id for e in self.effects)))

    @property
    def base_name(self) -> str:
        """Return the base's name, e.g. ``kv2-reaction`` where ``kv2`` leaves a law out."""
        return "-".join((self.base, *self.left_out))

    def obeys(self, law: str) -> bool:
        """Tell whether it has one of `LAWS`."""
        return self.closed and law not in self.left_out

    @cached_property
    def shared(self) -> tuple[str, ...]:
        """Return the names of the shared local parameters, in order."""
        return SHARED[self.kind] + self._of_effects(shot=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return all local parameters: shared, then nuisances."""
        return self.shared + self.nuisances

    @cached_property
    def nuisances(self) -> tuple[str, ...]:
        """Return the names of a shot's own parameters: the four, effects' numbers, free sizes."""
        sizes = (of_effect(e.id, f"basis{i}") for e in self.effects for i in range(e.basis_size))
        return (*NUISANCE, *self._of_effects(shot=True), *sizes)

    @cached_property
    def places(self) -> dict[str, tuple[int, ...]]:
        """Return where each effect's parameters are among the local ones, by effect id."""
        at = {name: i for i, name in enumerate(self.names)}
        return {
            e.id: tuple(at[of_effect(e.id, p.name)] for p in e.parameters) for e in self.effects
        }

    @cached_property
    def coupon_share_at(self) -> int | None:
        """Return where the coupon's share in the compliance is among the local parameters."""
        asking = (e.id for e in self.effects if e.by_coupon_share)
        return next((self.names.index(of_effect(i, COUPON_SHARE)) for i in asking), None)

    @cached_property
    def number_at(self) -> dict[int, tuple[Effect, EffectParameter]]:
        """Return the effects' numbers by their places among the local parameters."""
        return {
            at: (e, p)
            for e in self.effects
            for at, p in zip(self.places[e.id], e.parameters, strict=True)
        }

    @cached_property
    def of_shot(self) -> tuple[tuple[int, EffectParameter], ...]:
        """Return the effects' numbers that each shot has for itself, with their places."""
        return tuple(
            (at, p)
            for e in self.effects
            for at, p in zip(self.places[e.id], e.parameters, strict=True)
            if p.scope == "shot"
        )

    @cached_property
    def first_size(self) -> int:
        """Return where the free sizes begin among the local parameters."""
        return len(self.names) - sum(e.basis_size for e in self.effects)

    @cached_property
    def moves(self) -> tuple[neighbours.Move, ...]:
        """Return how the local parameters are moved for their derivatives."""
        return neighbours.moves(self)

    @cached_property
    def chain(self) -> tuple[Effect, ...]:
        """Return the effects that the signal is read through, along its way."""
        return tuple(sorted((e for e in self.effects if e.output), key=lambda e: e.order))

    @cached_property
    def has_second_contacts(self) -> bool:
        """Tell whether the sphere touches again within a window."""
        return any(e.again is not None for e in self.effects)

    def _of_effects(self, *, shot: bool) -> tuple[str, ...]:
        names: list[str] = []
        for e in self.effects:
            own = (p.name for p in e.parameters if (p.scope == "shot") == shot)
            names.extend(of_effect(e.id, name) for name in own)
            if e.by_coupon_share and not shot:
                names.append(of_effect(e.id, COUPON_SHARE))
        return tuple(names)

    def with_effect(self, effect: Effect) -> ImpactModel:
        """Return this model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def silenced(self, effect_id: str) -> ImpactModel:
        """Return this model with the same numbers, one effect without a consequence."""
        return replace(
            self,
            effects=tuple(e.silent() if e.id == effect_id else e for e in self.effects),
        )

    @cached_property
    def _for_some(self) -> dict[tuple[str | None, str | None], ImpactModel]:
        return {}

    def felt_by(self, frame: ShotFrame) -> ImpactModel:
        """Return the model as a shot feels it: the same numbers, some without a consequence."""
        if all(e.only is None for e in self.effects):
            return self
        own = (frame.sphere, frame.surface)
        found = self._for_some.get(own)
        if found is None:
            # without `only`, so that this is asked once
            effects = (e if e.acts_on(*own) else e.silent() for e in self.effects)
            found = replace(self, effects=tuple(replace(e, only=None) for e in effects))
            self._for_some[own] = found
        return found

    def steps(self, local: Array, frame: ShotFrame) -> int:
        """Return the solver's steps for these parameters; kept while derivatives are taken."""
        model = self.felt_by(frame)
        return model._steps(model._column(local, frame))

    def _steps(self, column: Column) -> int:
        context = column.context
        duration = contact_time(context.stiffness, context.mass_kg, context.speed_m_per_s)
        omega0 = math.exp(column.local[2]) if self.kind == solver.KV else 0.0
        least = float(solver.contact_steps(omega0, duration, closed=self.closed))
        for effect in self.effects:
            if effect.steps is not None:
                asked = effect.steps(column.values[effect.id], context)
                if asked > self.most_steps:
                    raise OverflowError
                least = max(least, asked)
        return math.ceil(self.step_share * min(least, 2.0 * solver.MAX_STEPS))

    def _allowed(self, steps: int) -> int:
        if steps > solver.MAX_STEPS:
            raise OverflowError
        return steps

    def _column(self, local: Array, frame: ShotFrame) -> Column:
        """Return the local parameters with what the effects make of them, or OverflowError."""
        if not self.is_thinkable(local):
            raise OverflowError
        return Column(0, local, self.effect_values(local), self.context(local, frame))

    @np.errstate(over="ignore", invalid="ignore")  # of a motion that ran away
    def predict(self, local: Array, frame: ShotFrame, *, steps: int | None = None) -> Prediction:
        """Return the trace of one shot, by default with the solver steps of `steps`.

        The rebound is NaN when the contact did not end; a signal that ran away has no number
        either.
        """
        model = self.felt_by(frame)
        try:
            column = model._column(local, frame)
            steps = model._allowed(model._steps(column) if steps is None else steps)
            return model._predictions([column], frame, steps)[0]
        except OverflowError:  # an effect's numbers that no float can hold
            return _nothing(frame)

    @np.errstate(over="ignore", invalid="ignore")  # of a motion that ran away
    def predict_each(
        self, local: Array, frame: ShotFrame, values: Sequence[EffectValues], *, steps: int
    ) -> Array:
        """Return the traces of one shot for other values of its effects, on one grid.

        ``values`` has for each trace what is other than at ``local``, by effect id and name. The
        traces have shape (len(values), n); NaN where a motion cannot be followed. [unit of the
        signal]
        """
        model = self.felt_by(frame)
        structural = {e.id for e in model.effects if e.structure is not None}
        try:
            centre = model._column(local, frame)
            columns = [
                replace(
                    centre,
                    row=row,
                    values={**centre.values, **own},
                    same_structure=structural.isdisjoint(own),
                )
                for row, own in enumerate(values)
            ]
            return np.array([one.signal for one in model._predictions(columns, frame, steps)])
        except OverflowError:  # an effect's numbers that no float can hold
            return np.full((len(values), frame.samples), math.nan)

    def _predictions(self, columns: list[Column], frame: ShotFrame, steps: int) -> list[Prediction]:
        """Return the traces of columns that name rows 0, 1, ..."""
        table = np.zeros((len(columns), frame.samples))
        first, ends = neighbours.add_first_contacts(table, self, columns, steps)
        found = []
        for column, own, contact, end in zip(columns, table, first, ends, strict=True):
            neighbours.add_second_contacts(own, self, column, steps, end)
            signal = neighbours.read(own, self.chain, column)[-1]
            found.append(self._prediction(signal, contact, column))
            frame.cut(found[-1].signal)
        return found

    def reads_alike(self, one: ShotFrame, other: ShotFrame) -> bool:
        """Tell whether two frames have the same trace at the same local parameters."""
        if self.effects:
            return one == other
        return bool(_READ_BY_BASES(one) == _READ_BY_BASES(other))

    def slopes_by_units(
        self, local: Array, frame: ShotFrame, linear: tuple[Prediction, Array, Array]
    ) -> dict[str, tuple[Array, float]]:
        """Return how a trace follows sample rate and gravity, from its other derivatives.

        By ``time_base`` and ``gravity``: the derivatives of the signal, shape (n,), and of the
        rebound ratio by its logarithm. Empty where effects or a converter's end make the trace
        depend on them in other ways. ``linear`` is what `linearise` returns.

        Sample i is taken i / rate - t0 after touch-down. In lengths that are all l times as large
        :math:`F(l v_0, l g, l^{-1/2} K) = l F(v_0, g, K)`, and the rebound ratio is the same.
        """
        if self.effects or frame.rail is not None:
            return {}
        found, jacobian, rebound = linear
        speed, touch_down = len(self.shared), len(self.shared) + 2
        signal = found.signal - local[len(self.shared) + 3]
        since_us = np.arange(frame.samples) * 1e6 / frame.sample_rate_hz
        by_gravity = signal + 0.5 * jacobian[:, 0] - jacobian[:, speed]
        return {
            "time_base": (since_us * jacobian[:, touch_down], 0.0),
            "gravity": (by_gravity, float(0.5 * rebound[0] - rebound[speed])),
        }

    def is_thinkable(self, local: Array) -> bool:
        """Tell whether these coordinates stand for finite numbers."""
        at = len(self.shared)
        held = bool(np.abs(local[: at + 2]).max() < _LARGEST_COORDINATE)
        if held and self.of_shot:
            own = local[at + len(NUISANCE) : self.first_size]
            held = bool(np.abs(own).max() < _LARGEST_COORDINATE)
        return held

    def _prediction(self, read: Array, found: Array, column: Column) -> Prediction:
        """Return the trace with baseline and signals of free size."""
        signal = read + column.local[len(self.shared) + 3]
        free = neighbours.free_part(self, read.size, column)
        if free is not None:
            signal += free
        duration, rebound, deepest = found.tolist()
        return Prediction(signal, rebound / column.context.speed_m_per_s, duration, deepest)

    def context(self, local: Array, frame: ShotFrame) -> ShotContext:
        """Return what the effects may know of a shot at these local parameters."""
        at, share = len(self.shared), self.coupon_share_at
        return ShotContext(
            sample_rate_hz=frame.sample_rate_hz,
            window_start_s=frame.window_start_s,
            mass_kg=frame.mass_kg,
            stiffness=math.exp(local[0]),
            speed_m_per_s=math.exp(local[at]),
            touch_down_s=float(local[at + 2]) * 1e-6,
            restitution=math.exp(local[at + 1]),
            reacts=self.obeys(REACTION),
            ends_with_force=self.obeys(FORCE_END),
            coupon_on_crystal_kg=frame.coupon_on_crystal_kg if self.closed else 0.0,
            radius_m=frame.radius_m,
            drop_height_m=frame.drop_height_m,
            coupon_mass_kg=frame.coupon_mass_kg,
            gravity_m_per_s2=frame.gravity_m_per_s2,
            coupon_share=None if share is None else float(local[share]),
            coupon_poissons_ratio=frame.coupon_poissons_ratio,
            place=frame.place,
        )

    def speed_shift(self, local: Array, frame: ShotFrame) -> float:
        """Return by how much effects shift ln of the speed that the drop height promises."""
        having = [e for e in self.felt_by(frame).effects if e.speed is not None]
        if not having:
            return 0.0
        values, context = self.effect_values(local), self.context(local, frame)
        return sum(e.speed(values[e.id], context) for e in having if e.speed is not None)

    def effect_values(self, local: Array) -> dict[str, dict[str, float]]:
        """Return the effects' physical values, by effect id and parameter name."""
        return {
            e.id: {
                p.name: p.value(float(local[at]))
                for p, at in zip(e.parameters, self.places[e.id], strict=True)
            }
            for e in self.effects
        }

    def linearise(self, local: Array, frame: ShotFrame) -> tuple[Prediction, Array, Array]:
        """Return the trace with the derivatives of signal and rebound ratio.

        The jacobian has shape (n, p) [unit of the signal per unit of the parameter], the rebound
        gradient shape (p,). They are one-sided differences on one grid: the solver is smooth in
        every parameter, so a step of 1e-6 leaves about 1e-6 relative of truncation and 1e-8 of
        rounding. Baseline and free sizes are analytic, and so is the gain where nothing reads the
        signal.
        """
        table = np.zeros((local.size + 1, frame.samples))
        prediction, gradient = self.differentiate(table, local, frame)
        return prediction, table[1:].T, gradient

    @np.errstate(over="ignore", invalid="ignore")  # of a motion that ran away
    def differentiate(
        self, table: Array, local: Array, frame: ShotFrame, *, first: int = 0
    ) -> tuple[Prediction, Array]:
        """Fill a table with the derivatives of one shot's trace.

        The table, shape (p + 1, n), holds zeros; the derivative by each parameter from place
        ``first`` on is written to the row behind its place, and the first row is left to the
        caller. The rebound gradient has shape (p,).
        """
        model = self.felt_by(frame)
        try:
            centre = model._column(local, frame)
            steps = model._allowed(model._steps(centre))
            found, gradient = neighbours.fill_neighbours(
                table, model, frame, centre, steps=steps, first=first
            )
        except OverflowError:  # an effect's numbers that no float can hold
            table[:] = math.nan
            return _nothing(frame), np.full(local.size, math.nan)
        table[len(self.shared) + 4] = 1.0
        at = self.first_size + 1
        for effect in self.effects:
            if effect.basis is not None:
                columns = effect.basis(frame.samples, centre.context)
                table[at : at + effect.basis_size] = columns.T
                at += effect.basis_size
        prediction = model._prediction(table[0], found, centre)
        frame.cut(prediction.signal, table[1:].T)
        return prediction, gradient


BASES = {
    "hsd": ImpactModel("hsd", solver.HSD),
    "kv": ImpactModel("kv", solver.KV),
    "kv2": ImpactModel("kv2", solver.KV, closed=True),
}
MIXED = tuple(
    replace(BASES["kv2"], left_out=some) for count in (1, 2) for some in combinations(LAWS, count)
)
"""``kv2`` without one law or two; without all three it is ``kv`` with a fall in air."""


def model_named(name: str) -> ImpactModel:
    """Return a model by its name.

    The name is ``hsd``, ``kv``, ``kv2`` or one of `MIXED`, then effects: ``kv+echo``. An
    UnknownModelError lists those there are; it also tells of an effect that the base holds already.
    """
    wanted, *effects = name.split("+")
    known = BASES | {mixed.base_name: mixed for mixed in MIXED}
    if wanted not in known:
        raise UnknownModelError(
            f"There is no base model {wanted!r}; known are {', '.join(sorted(known))}, each with "
            "effects added as in kv+coupler_highpass."
        )
    base = known[wanted].base
    if len(set(effects)) != len(effects):
        raise UnknownModelError(f"{name!r} names an effect twice.")
    found = tuple(effect_named(e) for e in effects)
    for effect in found:
        if base not in effect.bases:
            raise UnknownModelError(
                f"{effect.id!r} cannot be added to {base!r}, only to {', '.join(effect.bases)}."
            )
    return replace(known[wanted], effects=found)
