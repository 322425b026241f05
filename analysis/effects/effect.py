"""The form of an effect: what it changes, its parameters, and their groupings.

An effect is one file in this folder that defines ``EFFECT = Effect(...)``; nothing else registers
it. It hooks into the model at one or more of these places:

``contact``    a compiled term of the contact law (``analysis.model.effect_solver.TERM``)
``pack``       the effect's values and the shot's context -> the four numbers of its term, or of
               each of its ``memories``
``share``      the part of the dissipative force that also loads the structure
``mobility``   the speed at which the ground recedes per newton of the whole contact force
``bears``      the largest pull between the surfaces that does not part them [N]
``reach``      how far beyond the plane of touch-down the surfaces hold on to one another [m]
``structure``  adds masses and links below the sphere (``analysis.model.structure``)
``output``     changes the sampled signal, baseline not yet added
``speed``      shifts ln of the impact speed that the drop height promises
``again``      a second contact: (delay [s], its speed over the first one's)
``basis``      signals of free size in every shot, columns over the window
``steps``      how many steps over the contact the effect needs to be resolved

Every hook is a plain function of the effect's values and the shot; it must be deterministic, give
exactly the base model at its neutral value, and stay finite a little to either side of it, because
derivatives are taken there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from analysis.aliases import Array
from analysis.campaign import UNKNOWN_POISSONS_RATIO
from analysis.effects.acts_on import ActsOn
from analysis.errors import ParameterOutOfRangeError
from analysis.model.hertz import (
    closed_damping_coefficient,
    contact_time,
    damping_coefficient,
)
from analysis.model.solver import CONTACT_STEPS
from analysis.model.structure import Structure

Values = Mapping[str, float]

SLOTS = ("release", "contact", "mounting", "sensor", "electronics")
_LARGEST_LOG = 700.0
"""e^700 is nearly the largest number that a double holds."""
SCOPES = ("rig", "surface", "sphere", "pair", "shot")


@dataclass(frozen=True)
class ShotContext:
    """The properties of a shot that an effect may use."""

    sample_rate_hz: float
    window_start_s: float
    """First sample of the window after the record's first sample. [s]"""
    mass_kg: float
    """Sphere mass, 1 in reduced units. [kg]"""
    stiffness: float
    """K of the pair. [N m^-1.5]"""
    speed_m_per_s: float
    touch_down_s: float
    """After the window's first sample. [s]"""
    radius_m: float | None
    """None where unknown, as ``drop_height_m`` and ``coupon_mass_kg``."""
    drop_height_m: float | None
    coupon_mass_kg: float | None
    gravity_m_per_s2: float
    restitution: float = 1.0
    """Eq. 6's restitution of this shot, which sets the base model's dashpot. [1]"""
    reacts: bool = False
    """The base model's dashpot loads the crystal, too (``kv2``)."""
    ends_with_force: bool = False
    """The base model's contact ends when the force does (``kv2``)."""
    coupon_on_crystal_kg: float = 0.0
    """What the base model adds to the crystal's mass; 0 in the paper's models. [kg]"""
    coupon_share: float | None = None
    """The coupon's part in the compliance of the two bodies, (1/E2') / (1/E1' + 1/E2'); None for
    effects that do not ask for it. [1]"""
    coupon_poissons_ratio: float = UNKNOWN_POISSONS_RATIO.value
    """nu of the coupon, 0.35 where unknown. [1]"""
    place: float = 0.0
    """Of the shot in the order of its campaign: -0.5 the first, 0.5 the last. [1]"""

    @property
    def alpha(self) -> float:
        """Return Eq. 3's alpha, by the relation that goes with how the contact ends. [1]"""
        if self.ends_with_force:
            return closed_damping_coefficient(self.restitution)
        return damping_coefficient(self.restitution)

    def known(self, name: str) -> float:
        """Return a field that the effect cannot do without, else raise ParameterOutOfRangeError.

        An effect lists the field's name, e.g. ``radius_m``, under ``needs``.
        """
        value = getattr(self, name)
        if value is None:
            raise ParameterOutOfRangeError(name, value, "known for this effect to be tried")
        return float(value)


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect."""

    name: str
    """With its unit suffix."""
    unit: str
    """In words for people, SI."""
    scope: str
    """What it belongs to: rig, surface, sphere, pair, or shot; a shot's own number is eliminated
    with the shot's speed and touch-down, and nothing is known of it before."""
    form: str
    """The coordinate it is fitted in: ``log`` (ln of the value), ``linear`` (value / scale; neutral
    at 0) or ``inverse`` (scale / value; neutral at infinity, coordinate 0)."""
    scale: float
    """Of the coordinate; a value of this size is neither tiny nor huge."""
    low: float
    high: float
    """``low`` and ``high`` are physical bounds of the value; a fit that ends outside has not found
    this effect."""
    starts: tuple[float, ...]
    """Values from which a fit is started."""
    description: str
    peak_starts: tuple[float, ...] = ()
    """Starts as multiples of the largest excursion in the campaign, for a parameter that has the
    signal's own unit; where given they are better than ``starts``."""
    threshold: bool = False
    """Nothing happens on the far side of it, and nothing there has a slope towards it."""
    delays: bool = False
    """To first order it does no more than delay the signal, as a later touch-down does."""
    resolved: bool = False
    """The effect is told by it: a fit that ends beyond its bounds has found another, however little
    the data say of the number itself."""
    valleys: tuple[float, ...] = ()
    """Multiples of a value at which the squares may have another valley, as where it says when
    something comes back: a fit that ends in structure begins there once more."""
    ratio_to_entry: float = 1.0
    """Ratio to the value with which the form of the library's entry gives about the same trace."""
    stated: str = ""
    """Name of the number of a campaign's surface that is this one, measured beforehand; empty for
    none."""
    usual_u: float = math.inf
    """Standard deviation of the coordinate about neutral where nobody states it, because rigs are
    built so; infinite where nothing is known."""
    exact: float | None = None
    """Value that the law itself gives: it is not fitted, and stated without an uncertainty."""

    def value(self, coordinate: float) -> float:
        """Return the physical value at a coordinate."""
        if self.form == "log":
            return math.exp(coordinate)
        if self.form == "linear":
            return self.scale * coordinate
        return self.scale / coordinate if coordinate != 0.0 else math.inf

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a physical value."""
        if self.form == "log":
            return math.log(value)
        if self.form == "linear":
            return value / self.scale
        return self.scale / value

    def slope(self, coordinate: float) -> float:
        """Return d value / d coordinate, to carry an uncertainty over."""
        if self.form == "log":
            return math.exp(coordinate)
        if self.form == "linear":
            return self.scale
        return -self.scale / coordinate**2 if coordinate != 0.0 else math.inf

    def interval(self, coordinate: float, reach: float) -> tuple[float, float]:
        """Return the values within a reach of a coordinate, in which the fit is Gaussian.

        Of a quantity whose ``low`` is not negative, what lies below 0 is left out: the truth never
        lies there, so that an interval covers it as often as before. The upper end is infinite
        where the quantity has no upper limit.
        """
        first, last = coordinate - reach, coordinate + reach
        if self.form == "log":
            return math.exp(max(first, -_LARGEST_LOG)), math.exp(min(last, _LARGEST_LOG))
        if self.low >= 0.0:
            first, last = max(first, 0.0), max(last, 0.0)
        if self.form == "linear":
            return self.scale * first, self.scale * last
        if first < 0.0 < last:
            return -math.inf, math.inf  # on both sides of infinity
        ends = [math.inf if c == 0.0 else self.scale / c for c in (first, last)]
        return min(ends), max(ends)


@dataclass(frozen=True)
class Effect:
    """An effect of a real rig that the base model lacks."""

    id: str
    slot: str
    """Place in the instrument."""
    title: str
    """One line for people."""
    tell_tale: str
    """How it shows in a residual."""
    source: str
    """Where the equation is from."""
    validation: str
    """How it was checked, or "not validated"."""
    parameters: tuple[EffectParameter, ...]
    order: int = 0
    """Outputs are applied in rising order along the signal's way."""
    needs: tuple[str, ...] = ()
    """Fields of the context that must be known, else the effect cannot be tried."""
    contact: Any = None
    pack: Callable[[Values, ShotContext], tuple[float, ...]] | None = None
    memories: int = 1
    """How often its contact term is called, each time with a memory and four numbers of its own;
    the forces add up."""
    parts_by_force: bool = False
    """Its force could pull: on the paper's base models, which otherwise end a contact where the
    indentation ends, the contact then ends where the elastic force does."""
    share: Callable[[Values], float] | None = None
    base_dashpot: Callable[[Values], float] | None = None
    """Part of the base model's dashpot that is left."""
    mobility: Callable[[Values], float] | None = None
    bears: Callable[[Values, ShotContext], float] | None = None
    reach: Callable[[Values, ShotContext], float] | None = None
    structure: Callable[[Structure, Values, ShotContext], None] | None = None
    output: Callable[[Array, Values, ShotContext], Array] | None = None
    speed: Callable[[Values, ShotContext], float] | None = None
    again: Callable[[Values], tuple[float, float]] | None = None
    basis: Callable[[int, ShotContext], Array] | None = None
    basis_size: int = field(default=0)
    steps: Callable[[Values, ShotContext], float] | None = None
    bases: tuple[str, ...] = ("hsd", "kv", "kv2")
    """Base models it can be added to; a structure below the sphere exists only in ``kv`` and
    ``kv2``."""
    replaces_base: str = ""
    """Base model that adding this effect turns the present one into; its parameters are then that
    base's own. Empty for every effect that has a hook."""
    variants: tuple[Effect, ...] = ()
    """Other forms of the same effect, tried beside it under ids ``<id>:<form>``; the library lists
    them under this one."""
    lookalikes: tuple[Effect, ...] = ()
    """What nobody would list but the name must be told from, under ids ``<id>:<form>``; never tried
    by itself."""
    only: ActsOn | None = None
    """Whose shots it acts on; None for all."""
    rides: bool = False
    """Its second contact meets the structure as the first has left it, ringing."""
    by_coupon_share: bool = False
    """It depends on the coupon's share in the compliance of the two bodies, a local parameter
    ``<id>.coupon_share`` that follows from the moduli and is nobody's own."""
    by_name: bool = False
    """The search for effects does not try it: fitted in a model that names it, or where another
    form of the same effect explains nearly all of what is missing."""

    @property
    def hooks(self) -> tuple[object, ...]:
        """Return its functions."""
        return tuple(value for value in vars(self).values() if callable(value))

    def acts_on(self, sphere: str | None, surface: str | None) -> bool:
        """Tell whether a shot of this sphere on this surface feels it."""
        return self.only is None or self.only.includes(sphere, surface)

    def silent(self) -> Effect:
        """Return it with its numbers but no consequence, for shots that do not feel it."""
        return replace(
            self,
            contact=None,
            pack=None,
            share=None,
            mobility=None,
            bears=None,
            reach=None,
            structure=None,
            output=None,
            speed=None,
            again=None,
            steps=None,
            parts_by_force=False,
        )

    @property
    def in_solver(self) -> bool:
        """Whether it changes the equations of motion, not only what is read."""
        return any(x is not None for x in (self.contact, self.share, self.mobility, self.structure))


def damping_ratio(start: float, *, most: float, of: str) -> EffectParameter:
    """Return the damping ratio of a mode of the rig, a logarithm; beyond ``most`` it is no mode.

    ``start`` is the scale as well. ``of`` says in words whose it is.
    """
    return EffectParameter(
        "damping_ratio", "1", "rig", "log", start, 1e-6, most, (start,), of, resolved=True
    )


def resolving_steps(rate_per_s: float, context: ShotContext) -> float:
    """Return how many solver steps over a loss-free Hertz contact resolve a rate.

    The rate is the angular frequency of a mode, or the inverse of a decay time. The growth is that
    of ``analysis.model.solver.contact_steps`` as long as the motion is seen. What is faster than 30
    radians per contact barely moves and has only to be stable: the scheme bears steps of 1 / rate
    on an undamped mode (3 / rate on a decay), and its largest step is 4.4 contact times over the
    steps.
    """
    phase = rate_per_s * contact_time(context.stiffness, context.mass_kg, context.speed_m_per_s)
    return CONTACT_STEPS + 5.0 * phase + 0.1 * min(phase, 30.0) ** 2
