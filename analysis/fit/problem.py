"""A joint fit as numbers: its parameters, the shots that share each, and the priors.

Global parameters (all logarithms):

==============================  ===============================================================
``sensor.ln_S|ln_w|ln_z|ln_M``  the cell: gain, frequency, damping ratio, crystal mass
``sphere.<name>``               plane-strain modulus E' of a sphere's material [Pa]
``surface.<name>``              plane-strain modulus E' of a coupon [Pa]
``pair.<sphere>/<surface>``     contact stiffness K of a pair, where no moduli can be told apart
``rebound.seen_ms``             how long after lift-off the stated rebound speeds were seen
``<effect>.<parameter>``        an effect's number, in the effect's own coordinate; ``[name]``
                                behind it where it belongs to a surface, a sphere or a pair
``input.<kind>[.<name>]``       a stated number with an uncertainty, see ``analysis.fit.inputs``
==============================  ===============================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Campaign, Rejected, Shot, Sphere, Surface
from analysis.effects.library import library_hooks
from analysis.errors import AnalysisError
from analysis.fit.cores import ONE_CORE, Cores, R, T
from analysis.fit.fit_shot import (
    ASSUMED_REPEATABILITY,
    FitShot,
    fit_shot,
    gain_is_observable,
    noise_by_instrument,
    places,
    usable_shots,
)
from analysis.fit.inputs import Input, exact_sentence, stated_numbers
from analysis.fit.priors import (
    SEEN,
    SEEN_NEEDS_SHOTS,
    SEEN_U_MS,
    SENSOR_FIELDS,
    SENSOR_OFFSET,
    UNKNOWN_LOG_U,
    Prior,
    modulus_prior,
    sensor_prior,
    sensor_transform,
)
from analysis.fit.stated_effects import effect_prior, stated_effects
from analysis.fit.thinning import thinned
from analysis.model import solver
from analysis.model.free_fall import AIR_ASSUMED
from analysis.model.impact_model import COUPON, SHARED, ImpactModel
from analysis.parameters import (
    CELL,
    GAIN,
    ParameterName,
    Side,
    of_effect,
    of_material,
    of_pair,
    of_sensor,
)
from analysis.temperature import at_temperature_of_shots

__all__ = [
    "ASSUMED_REPEATABILITY",
    "SENSOR_FIELDS",
    "SENSOR_OFFSET",
    "UNKNOWN_LOG_U",
    "FitShot",
    "JointProblem",
    "Prior",
    "build",
    "go_on",
    "modulus_prior",
    "sensor_transform",
]


_LARGEST_LOG = 300.0


def go_on() -> None:
    """Never end a fit early."""


@dataclass(frozen=True)
class LocalMap:
    """How a shot's shared local parameters follow the globals, but for the stiffness of moduli."""

    shot: Shot
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    """Which of them (``rows``) are a global as it stands, and which global."""
    slopes: NDArray[np.float64]
    """Their derivative by the globals, shape (s, g)."""
    fixed_gain: int | None
    heavy_crystal: int | None
    """Where the shot fixes the gain or the crystal's mass."""
    moduli: tuple[int, int] | None
    """The two globals that make ln K, where they do."""
    inputs: tuple[tuple[int, Input], ...]
    """What else the shot depends on, with its place among the globals."""
    added: NDArray[np.float64]
    """What the inputs that act to first order add to its record, shape (i, n)."""
    faster: NDArray[np.float64]
    """What they add to its promised ln v0, shape (i,)."""
    added_at: NDArray[np.intp]
    """Their places among the globals, shape (i,)."""
    follows: NDArray[np.float64]
    """How the parameters follow all inputs' distance from where they are stated, beside what moves
    the shot itself. Shape (s, i)."""
    input_slopes: NDArray[np.float64]
    """How the parameters follow inputs altogether, shape (s, g)."""


@dataclass
class JointProblem:
    """Everything a joint fit needs."""

    model: ImpactModel
    campaign: Campaign
    shots: list[FitShot]
    """In order of time."""
    names: Sequence[ParameterName]
    start: NDArray[np.float64]
    """Where a fit begins, shape (g,): the prior's mean, until `analysis.fit.start` has looked."""
    prior_mean: NDArray[np.float64]
    """Shape (g,); 0 where nothing is known."""
    prior_precision: NDArray[np.float64]
    """With ``prior_mean``: Gaussian knowledge of the globals, shape (g, g)."""
    by_pair: bool
    """Whether pairs have a stiffness each instead of materials a modulus."""
    rejected: list[Rejected] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)
    """What had to be assumed, in words."""
    inputs: tuple[Input, ...] = ()
    """Stated numbers that are globals too, the last ones; see ``analysis.fit.freed_inputs``."""
    checkpoint: Callable[[], None] = go_on
    """Called before every shot that is evaluated; what it raises ends the fit."""
    cores: Cores = ONE_CORE
    """How work on this problem is spread over cores."""
    _maps: dict[tuple[Any, ...], LocalMap] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _moved: dict[int, tuple[FitShot, bytes, FitShot]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """Each shot where its inputs were last asked to be, by the shot's identity."""

    def each(self, work: Callable[[T], R], pieces: Sequence[T]) -> Generator[R]:
        """Yield what some work makes of independent pieces, in their order, on all cores.

        The work must change nothing that anybody else looks at.
        """
        parts = [p for one in self.shots for p in (one, one.shot, one.window, one.frame, one.noise)]
        hooks = [*library_hooks(), *(hook for e in self.model.effects for hook in e.hooks)]
        shared = [self.campaign, *parts, *self.inputs, self.checkpoint, self.cores, *hooks]
        yield from self.cores.each(work, pieces, shared)

    def with_shots(self, places: Iterable[int]) -> JointProblem:
        """Return the problem with some of its shots."""
        return replace(self, shots=[self.shots[i] for i in places])

    def __getstate__(self) -> dict[str, Any]:
        """Return the problem without what it has looked up by the identity of shots."""
        return {**self.__dict__, "_maps": {}, "_moved": {}}

    def is_thinkable(self, theta: NDArray[np.float64]) -> bool:
        """Tell whether the inputs among these globals stand for finite numbers."""
        first = len(self.names) - len(self.inputs)
        return all(
            i.is_thinkable(float(t)) for i, t in zip(self.inputs, theta[first:], strict=True)
        )

    def item_at(self, item: FitShot, theta: NDArray[np.float64]) -> FitShot:
        """Return a shot with masses, heights and the like as these globals have them."""
        if not self.inputs:
            return item
        coordinates = theta[len(self.names) - len(self.inputs) :].tobytes()
        last = self._moved.get(id(item))
        if last is None or last[0] is not item or last[1] != coordinates:
            last = self._moved[id(item)] = item, coordinates, self._moved_to(item, theta)
        return last[2]

    def _moved_to(self, item: FitShot, theta: NDArray[np.float64]) -> FitShot:
        if not self.is_thinkable(theta):  # such a step is refused by `shared_local`
            return item
        at = self._map_of(item)
        for j, one in at.inputs:
            if j not in at.added_at:
                item = one.moved(item, float(theta[j]) - one.stated)
        if not at.added.size:
            return item
        by = theta[at.added_at]
        speed = item.speed_prior
        if speed is not None:
            speed = Prior(speed.mean + float(by @ at.faster), speed.u)
        window = replace(item.window, signal=item.window.signal - by @ at.added)
        return replace(item, window=window, speed_prior=speed)

    def inputs_of(self, item: FitShot) -> tuple[tuple[int, Input], ...]:
        """Return the inputs that a shot depends on, with their places among the globals."""
        return self._map_of(item).inputs if self.inputs else ()

    def _map_of(self, item: FitShot) -> LocalMap:
        """Return how a shot's shared local parameters follow the globals, at any values."""
        key = (
            id(item.shot),
            item.frame.place,
            item.fixed_gain is None,
            item.heavy_crystal is None,
            item.radius_m is None,
        )
        found = self._maps.get(key)
        if found is None:
            found = self._maps[key] = self._new_map(item)
        return found

    def index(self, name: str) -> int | None:
        """Return a global's position, None where it is no parameter."""
        return self.names.index(name) if name in self.names else None

    def positions(self, names: Sequence[str]) -> list[int] | None:
        """Return the positions of these globals, None unless all of them are parameters."""
        found = [self.index(n) for n in names]
        known = [j for j in found if j is not None]
        return known if len(known) == len(found) else None

    def gradient_of(self, name: str) -> NDArray[np.float64]:
        """Return the derivative of a global's number by the globals, shape (g,).

        A name of the cell stands for the cell's parameter itself, which follows the inputs of its
        calibration, too.
        """
        found = np.zeros(len(self.names))
        at = self.names.index(name)
        found[at] = 1.0
        if self.names[at].kind == "sensor":
            for j, one in enumerate(self.inputs, start=len(self.names) - len(self.inputs)):
                found[j] = one.cell.get(self.names[at].quantity, 0.0)
        return found

    def value_of(self, name: str, theta: NDArray[np.float64]) -> float:
        """Return that number at some globals, as `gradient_of` has it."""
        first = len(self.names) - len(self.inputs)
        away = theta - np.concatenate([np.zeros(first), [one.stated for one in self.inputs]])
        return float(self.gradient_of(name) @ away)

    def material_keys(self, shot: FitShot) -> tuple[ParameterName, ParameterName] | None:
        """Return the two moduli that make this shot's stiffness, None in pair mode."""
        if self.by_pair or shot.radius_m is None:
            return None
        return of_material("sphere", shot.shot.sphere), of_material("surface", shot.shot.surface)

    def effect_key(self, row: int, shot: FitShot) -> ParameterName | None:
        """Return the global's name of an effect's shared local parameter for this shot.

        None where the shot does not feel the effect, or the number follows from the moduli.
        """
        found = self.model.number_at.get(row)
        if found is None:
            return None
        effect, parameter = found
        if not effect.acts_on(shot.shot.sphere, shot.shot.surface):
            return None
        if parameter.scope == "rig":
            group = "" if effect.only is None else effect.only.label
        else:
            owner = {"surface": shot.shot.surface, "sphere": shot.shot.sphere, "pair": shot.pair}
            group = owner[parameter.scope] or "?"
        return of_effect(effect.id, parameter.name, group)

    def effect_keys(self, row: int) -> list[ParameterName]:
        """Return the globals' names of an effect's shared local parameter, over all shots."""
        return sorted({key for s in self.shots if (key := self.effect_key(row, s)) is not None})

    def shared_local(
        self, shot: FitShot, theta: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a shot's shared local parameters and their derivative by the globals.

        Shapes (s,), in the order of ``model.shared``, and (s, g). The shot is as `item_at` returns
        it.
        """
        at, first = self._map_of(shot), len(self.names) - len(self.inputs)
        values, chain = np.zeros(len(self.model.shared)), at.slopes.copy()
        known = theta.tolist()
        if not all(i.is_thinkable(t) for i, t in zip(self.inputs, known[first:], strict=True)):
            values[0] = -math.inf
            return values, chain
        values[at.rows] = theta[at.columns]
        if at.fixed_gain is not None and shot.fixed_gain is not None:
            values[at.fixed_gain] = shot.fixed_gain
        if at.heavy_crystal is not None and shot.heavy_crystal is not None:
            values[at.heavy_crystal] = shot.heavy_crystal
        if at.moduli is not None:
            assert shot.radius_m is not None
            j, k = at.moduli
            # no modulus is e^300 Pa: a step that goes there has no trace, and is refused
            if max(abs(known[j]), abs(known[k])) > _LARGEST_LOG:
                values[0] = -math.inf
                return values, chain
            one, other = math.exp(-known[j]), math.exp(-known[k])
            values[0] = math.log(4 / 3 * math.sqrt(shot.radius_m)) - math.log(one + other)
            chain[0, j] += one / (one + other)
            chain[0, k] += other / (one + other)
        self._follow_moduli(shot, values, chain)
        if at.inputs:
            stated = np.array([one.stated for one in self.inputs])
            values += at.follows @ (theta[first:] - stated)
            chain += at.input_slopes
        return values, chain

    def _new_map(self, shot: FitShot) -> LocalMap:
        names, size, first = self.model.shared, len(self.names), len(self.names) - len(self.inputs)
        fixed = {
            "ln_S": shot.fixed_gain is not None,
            "ln_M": shot.heavy_crystal is not None,
            "seen_ms": SEEN not in self.names,
        }
        keys = self.material_keys(shot)
        column_of: dict[int, int] = {}
        if keys is None:
            column_of[0] = self.names.index(of_pair(shot.pair))
        for row, name in enumerate(names[1:], start=1):
            if row >= len(SHARED[self.model.kind]):
                key = self.effect_key(row, shot)
                if key is not None:
                    column_of[row] = self.names.index(key)
            elif not fixed.get(name, False):
                column_of[row] = self.names.index(SEEN if name == "seen_ms" else of_sensor(name))
        rows, columns = list(column_of), list(column_of.values())
        slopes = np.zeros((len(names), size))
        slopes[rows, columns] = 1.0
        inputs = tuple(
            (j, one) for j, one in enumerate(self.inputs, start=first) if one.acts_on(shot)
        )
        adding = [(j, one, signal) for j, one in inputs if (signal := one.signal(shot)) is not None]
        follows, by_inputs = np.zeros((len(names), len(self.inputs))), np.zeros_like(slopes)
        for j, known in inputs:
            of_cell = known.cell_slopes(shot, names)
            of_shot = known.local_slopes(shot, names, by_moduli=keys is not None)
            for row, slope in (*of_shot, *of_cell):
                by_inputs[row, j] += slope
            # all others have moved the shot itself
            by_itself = of_shot if known.kind == "converter_gain" else []
            for row, slope in (*by_itself, *of_cell):
                follows[row, j - first] += slope
        return LocalMap(
            shot.shot,
            np.array(rows, dtype=np.intp),
            np.array(columns, dtype=np.intp),
            slopes,
            names.index("ln_S") if fixed["ln_S"] else None,
            names.index("ln_M") if fixed["ln_M"] and "ln_M" in names else None,
            None if keys is None else (self.names.index(keys[0]), self.names.index(keys[1])),
            inputs,
            np.array([signal for _, _, signal in adding]),
            np.array([one.faster_by(shot) for _, one, _ in adding]),
            np.array([j for j, _, _ in adding], dtype=np.intp),
            follows,
            by_inputs,
        )

    def _follow_moduli(
        self, shot: FitShot, values: NDArray[np.float64], chain: NDArray[np.float64]
    ) -> None:
        """Fill in the coupon's share in the compliance for an effect that needs it."""
        at = self.model.coupon_share_at
        if at is not None:
            values[at], chain[at] = self.coupon_share(shot, values[0], chain[0])

    def coupon_share(
        self, shot: FitShot, ln_k: float, slope: NDArray[np.float64]
    ) -> tuple[float, NDArray[np.float64]]:
        """Return the coupon's share in the compliance of a pair, and its derivative by the globals.

        ``slope`` is that of ln K. In pair mode K is the whole compliance, and a stated modulus one
        part of it; where neither is stated the sphere counts as rigid.
        """
        chain = np.zeros_like(slope)
        keys = self.material_keys(shot)
        if keys is not None:
            j, k = (self.names.index(key) for key in keys)
            share = float(slope[k])
            chain[j], chain[k] = share * (1.0 - share), -share * (1.0 - share)
            return share, chain
        ball = self.campaign.spheres.get(shot.shot.sphere or "")
        coupon = self.campaign.surfaces.get(shot.shot.surface or "")
        for body, sign in ((ball, -1.0), (coupon, 1.0)):
            known = modulus_prior(body.youngs_modulus_pa, body.poissons_ratio) if body else None
            if known is not None and shot.radius_m is not None:
                part = 0.75 * math.exp(ln_k - known.mean) / math.sqrt(shot.radius_m)
                return (part if sign > 0 else 1.0 - part), sign * part * slope
        return 1.0, chain


def _material_priors(campaign: Campaign, shots: list[FitShot]) -> dict[ParameterName, Prior | None]:
    found: dict[ParameterName, Prior | None] = {}
    for item in shots:
        sides: tuple[tuple[Side, str | None, Sphere | Surface | None], ...] = (
            ("sphere", item.shot.sphere, campaign.spheres.get(item.shot.sphere or "")),
            ("surface", item.shot.surface, campaign.surfaces.get(item.shot.surface or "")),
        )
        for side, name, material in sides:
            known = None
            if material is not None:
                known = modulus_prior(material.youngs_modulus_pa, material.poissons_ratio)
            found.setdefault(of_material(side, name), known)
    return found


def build(campaign: Campaign, model: ImpactModel, *, by_pair: bool = False) -> JointProblem:
    """Return the joint problem of a campaign, as stated: `analysis.fit.start` begins it.

    An AnalysisError says that no shot can be used. ``by_pair`` gives each pair its own stiffness
    instead of each material a modulus: for single shots, whose moduli are told apart later, by the
    network.
    """
    kv = model.kind == solver.KV
    campaign, temperature_told = at_temperature_of_shots(campaign)
    campaign, thinning_told = thinned(campaign)
    usable, rejected = usable_shots(campaign)
    if not usable:
        reasons = "; ".join(f"{r.name}: {r.reason}" for r in rejected[:3])
        raise AnalysisError(f"No shot of this campaign can be used ({reasons or 'it has none'}).")
    noise = noise_by_instrument(tuple(usable))
    gain = gain_is_observable(campaign, kv=kv)
    at = places(campaign)
    shots = [
        fit_shot(
            s,
            campaign,
            noise[s.quantity, s.sample_rate_hz],
            known_gain=gain,
            kv=kv,
            closed=model.closed,
            rides=model.obeys(COUPON),
            place=at[id(s)],
        )
        for s in usable
    ]
    names: list[ParameterName] = []
    sensor_names = ("ln_S", "ln_w", "ln_z", "ln_M") if kv else ("ln_S",)
    for name in sensor_names:
        if name == "ln_S" and all(s.fixed_gain is not None for s in shots):
            continue
        if name == "ln_M" and all(s.heavy_crystal is not None for s in shots):
            continue
        names.append(of_sensor(name))
    problem = JointProblem(
        model, campaign, shots, names, np.zeros(0), np.zeros(0), np.zeros((0, 0)), by_pair, rejected
    )
    priors = _material_priors(campaign, [s for s in shots if problem.material_keys(s)])
    names.extend(sorted(priors))
    names.extend(sorted({of_pair(s.pair) for s in shots if problem.material_keys(s) is None}))
    told = sum(1 for s in shots if s.shot.restitution is not None)
    if told >= SEEN_NEEDS_SHOTS and not by_pair:
        names.append(SEEN)
    for row in range(len(SHARED[model.kind]), len(model.shared)):
        names.extend(problem.effect_keys(row))
    _set_priors(problem, priors)
    if model.closed:
        problem.assumptions.extend(_closed_assumptions(problem))
    problem.assumptions.extend((*campaign.assumptions, *_reduced_units(shots)))
    if any(s.speed_prior for s in shots) and campaign.speed_repeatability is None:
        problem.assumptions.append(
            f"No speed repeatability given: {ASSUMED_REPEATABILITY:.0%} from shot to shot assumed."
        )
    problem.assumptions.extend((*temperature_told, *thinning_told))
    by_ratio = model.coupon_share_at is not None
    _, exact = stated_numbers(campaign, shots, by_ratio=by_ratio)
    exact += tuple(s.path for _, s in stated_effects(problem) if s.uncertainty is None)
    if exact:
        problem.assumptions.append(exact_sentence(exact))
    return problem


def _reduced_units(shots: list[FitShot]) -> list[str]:
    """Return what is not in SI because no mass, or no gain, is stated, in words."""
    found = []
    massless = sorted(
        {s.shot.sphere or "a sphere without a name" for s in shots if not s.mass_is_stated}
    )
    if massless:
        found.append(f"No mass given for {', '.join(massless)}: 1 kg taken. Stiffness is per mass.")
    if not all(s.in_si for s in shots):
        found.append(
            "Without the sphere's mass, and of volts without the cell's gain, speeds, depths and "
            "stiffness are in reduced units: no speed in m/s is stated."
        )
    return found


def _closed_assumptions(problem: JointProblem) -> list[str]:
    """Return what the closed base model takes for granted about these shots, in words."""
    found = []
    if any(s.shot.drop_height_m is not None and s.radius_m is not None for s in problem.shots):
        found.append(AIR_ASSUMED)
    without = sorted({s.shot.surface or "?" for s in problem.shots if not s.frame.coupon_mass_kg})
    if without:
        found.append(
            f"No coupon mass given for {', '.join(without)}: 0 g taken, so that nothing rides on "
            "the crystal there."
        )
    reduced = sorted(
        {s.shot.surface or "?" for s in problem.shots if s.frame.coupon_mass_kg and s.heavy_crystal}
    )
    if reduced:
        found.append(
            f"The coupon's mass counts as the crystal's for {', '.join(reduced)}: without the "
            "sphere's radius and mass neither is a parameter."
        )
    return found


def _weighted_mean(
    precision: NDArray[np.float64], weighted: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the mean of numbers that are known with a precision, 0 of what is not known at all."""
    return np.asarray(np.linalg.solve(precision + 1e-12 * np.eye(weighted.size), weighted))


def _set_priors(problem: JointProblem, priors: dict[ParameterName, Prior | None]) -> None:
    size = len(problem.names)
    precision = np.zeros((size, size))
    weighted = np.zeros(size)
    sensor = problem.campaign.sensor
    if problem.model.kind == solver.KV:
        at = problem.positions(CELL)
        if at is not None:  # in reduced units the cell's certificate says nothing
            full, load = sensor_prior(sensor)
            precision[np.ix_(at, at)] = full
            weighted[at] = load
    elif sensor.hsd_n_per_v is not None and GAIN in problem.names:
        j = problem.names.index(GAIN)
        relative = max(sensor.hsd_n_per_v.u / sensor.hsd_n_per_v.value, 1e-6)
        precision[j, j] = relative**-2
        weighted[j] = math.log(sensor.hsd_n_per_v.value) / relative**2
    for name, prior in priors.items():
        if prior is not None:
            j = problem.names.index(name)
            precision[j, j] = prior.u**-2
            weighted[j] = prior.mean / prior.u**2
    if SEEN in problem.names:
        j = problem.names.index(SEEN)
        precision[j, j] = SEEN_U_MS**-2
    for j, name in enumerate(problem.names):
        prior = effect_prior(problem, name)
        if prior is not None:
            precision[j, j] = prior.u**-2
            weighted[j] = prior.mean * precision[j, j]
    problem.prior_precision = precision
    problem.prior_mean = _weighted_mean(precision, weighted)
    problem.start = problem.prior_mean.copy()
