"""The effects that can be added to a model, and the first-order gain of each."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter
from analysis.effects.library import library
from analysis.fit.joint import Fitted
from analysis.fit.problem import FitShot, JointProblem
from analysis.model.impact_model import ImpactModel

AMPLITUDE_STEP = 0.05
"""Part of the start's amplitude at which a column is taken; small, so that it is a derivative."""


DELAY_STEPS = 3
"""Newton steps to the touch-down that takes up a delay. Derived: of a phase p each leaves p^3 / 6.
A cutoff of 60 kHz delays by 4 us, 0.9 rad of a ring at 40 kHz: 0.1, 3e-4 and 1e-11 rad are left."""
RUN_AWAY = 1e100
"""Signal of a motion that ran away, whose squares would overflow. [unit of the signal]"""


@dataclass(frozen=True)
class Proposal:
    """One effect from one start: what it would add to each shot, to first order."""

    effect: Effect
    """In the form that is tried."""
    effect_id: str
    """Of the library's entry, without the form."""
    coordinates: tuple[float, ...]
    """Where the effect's parameters start."""
    amplitude: int | None
    """Which parameter the column's coefficient multiplies; None where the whole column is a
    difference and a coefficient of one means the start itself."""

    @property
    def key(self) -> str:
        """Return a name that is unique among proposals."""
        return f"{self.effect.id}@{','.join(f'{c:.4g}' for c in self.coordinates)}"


def amplitude_of(effect: Effect) -> int | None:
    """Return which parameter of an effect is its size; None where none is neutral at a point."""
    for at, parameter in enumerate(effect.parameters):
        flat = parameter.peak_starts or parameter.threshold
        if parameter.form in ("linear", "inverse") and not flat:
            return at
    return None


def size_of(effect: Effect) -> int | None:
    """Return which parameter says how much of an effect a material has; None of a free signal."""
    amplitude = amplitude_of(effect)
    return 0 if amplitude is None and effect.parameters else amplitude


def can_be_negative(effect: Effect) -> bool:
    """Tell whether an effect's size may be on either side of its neutral value."""
    at = amplitude_of(effect)
    return at is not None and effect.parameters[at].low < 0.0


def _starts(parameter: EffectParameter, top: float) -> Sequence[float]:
    """Return a number's starts, those of sizes in the signal's unit by its largest excursion."""
    return [top * s for s in parameter.peak_starts] or parameter.starts


def _combined(effect: Effect, lists: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Return every combination of some starts, as coordinates."""
    return [
        tuple(p.coordinate(v) for p, v in zip(effect.parameters, values, strict=True))
        for values in itertools.product(*lists)
    ]


def default_starts(effect: Effect, top: float) -> list[tuple[float, ...]]:
    """Return an effect's usual numbers as coordinates; top is the campaign's largest excursion."""
    return _combined(effect, [_starts(p, top) for p in effect.parameters])


def can_be_tried(effect: Effect, problem: JointProblem) -> str | None:
    """Return why an effect cannot be tried on these data, None where it can."""
    if effect.replaces_base:
        return "it is a base model of its own"
    if problem.model.base not in effect.bases:
        return f"it has no meaning in the base model {problem.model.base}"
    for need in effect.needs:
        if any(getattr(s.frame, need) is None for s in problem.shots):
            return f"{need} is not known for every shot"
    if effect.speed is not None and any(s.speed_prior is None for s in problem.shots):
        return "drop heights are not known for every shot"
    return None


def proposals(problem: JointProblem) -> tuple[list[Proposal], dict[str, str]]:
    """Return what can be tried on top of a model: all effects, forms and starts.

    Behind it, by effect id, why the rest cannot.
    """
    top = max(s.window.peak for s in problem.shots)
    present = {e.id.partition(":")[0] for e in problem.model.effects}
    found, refused = [], {}
    for listed in library().values():
        if listed.id in present or listed.by_name:
            continue
        why = can_be_tried(listed, problem)
        if why is not None:
            refused[listed.id] = why
            continue
        for effect in (listed, *listed.variants):
            if effect.by_name or problem.model.base not in effect.bases:
                continue
            amplitude = amplitude_of(effect)
            lists = [_starts(p, top) for p in effect.parameters]
            if amplitude is not None:  # a column's coefficient is the amplitude
                lists[amplitude] = lists[amplitude][:1]
            found += [Proposal(effect, listed.id, at, amplitude) for at in _combined(effect, lists)]
    return found, refused


def asked_by_their_column(problem: JointProblem) -> list[Proposal]:
    """Return the effects that a residual is asked for by their own column, in their usual form.

    To first order an effect whose only number is a size has one column, and nothing about it has to
    be guessed. A contact's effect with further numbers is asked at each of their usual values:
    moduli follow what it does, so that next to nothing is left of it.
    """
    return [
        one
        for one in proposals(problem)[0]
        if one.effect.id == one.effect_id
        and one.amplitude == 0
        and (len(one.coordinates) == 1 or one.effect.slot == "contact")
    ]


def column(
    proposal: Proposal, models: tuple[ImpactModel, ImpactModel], local: Array, item: FitShot,
    base: Array, *, coupon_share: float = 1.0,
) -> tuple[Array, Array]:  # fmt: skip
    """Return what a proposal adds to one shot per unit coefficient: signal and promised ln v0.

    Of shapes (n, q) and (q,), q being 1 or the number of free sizes of an effect with a basis.
    ``models`` are the present one and the same with the effect, all of its numbers the rig's;
    ``base`` is the present model's signal, ``coupon_share`` the coupon's share in the compliance of
    the two bodies, for an effect that depends on it.
    """
    effect, (model, tried) = proposal.effect, models
    if effect.basis is not None:
        found = effect.basis(item.frame.samples, model.context(local, item.frame))
        return found * item.window.peak, np.zeros(found.shape[1])
    at = len(model.shared)
    coordinates = np.array(proposal.coordinates)
    step, delays = 1.0, False
    if proposal.amplitude is not None:
        # where the derivative is a delay, what matters is of a higher order, and shows at full size
        delays = effect.parameters[proposal.amplitude].delays
        step = (1.0 if delays else AMPLITUDE_STEP) * coordinates[proposal.amplitude]
        coordinates[proposal.amplitude] = step
    share = [coupon_share] if effect.by_coupon_share else []
    moved = np.concatenate([local[:at], coordinates, share, local[at:]])
    signal = tried.predict(moved, item.frame).signal
    shift = tried.speed_shift(moved, item.frame) - model.speed_shift(local, item.frame)
    if not np.abs(signal).max() < RUN_AWAY:  # nor is a NaN
        signal = base
    elif delays:
        base = _delayed_as(signal, base, model, local, item)
    return ((signal - base) / step)[:, None], np.array([shift / step])


def column_is_difference(proposal: Proposal) -> bool:
    """Tell whether what an effect does grows with a power of its size: its column is no derivative.

    What begins at a threshold does not.
    """
    effect, at = proposal.effect, proposal.amplitude
    if effect.basis is not None or not effect.parameters:
        return False
    if at is not None:
        return effect.parameters[at].delays
    return not any(p.threshold or p.peak_starts for p in effect.parameters)


def growth(proposal: Proposal, problem: JointProblem, fitted: Fitted) -> float:
    """Return with which power of its size an effect grows near a start; 0 where none is seen.

    Asked of the strongest shot: what is left of the effect there beside all other parameters, at
    the start and at half its size. Negative where a larger number does less.
    """
    row = max(range(len(problem.shots)), key=lambda at: problem.shots[at].window.peak)
    item = problem.item_at(problem.shots[row], fitted.theta)
    shared, _ = problem.shared_local(item, fitted.theta)
    local = np.concatenate([shared, fitted.nuisances[row]])
    found, jacobian, _ = problem.model.linearise(local, item.frame)
    known, _ = np.linalg.qr(jacobian)
    wider = problem.model.with_effect(rescoped(proposal.effect, "rig"))
    share, _ = problem.coupon_share(item, float(shared[0]), np.zeros(fitted.theta.size))
    at = size_of(proposal.effect) or 0
    parameter, sizes = proposal.effect.parameters[at], []
    for part in (1.0, 0.5):
        coordinates = list(proposal.coordinates)
        coordinates[at] = parameter.coordinate(part * parameter.value(coordinates[at]))
        moved = dataclasses.replace(proposal, coordinates=tuple(coordinates))
        models = problem.model, wider
        shown, _ = column(moved, models, local, item, found.signal, coupon_share=share)
        shown = shown[:, 0] * (1.0 if proposal.amplitude is None else coordinates[at])
        sizes.append(float(np.linalg.norm(shown - known @ (known.T @ shown))))
    if not (min(sizes) > 0.0 and math.isfinite(sum(sizes))):
        return 0.0
    return math.log2(sizes[0] / sizes[1])


def times_for(share: float, power: float) -> float:
    """Return how much larger an effect must be to do a share of what it does, by `growth`.

    Infinite or 0 where it hardly grows, 1 where it does not.
    """
    with np.errstate(over="ignore"):
        return float(np.exp(math.log(share) / power)) if power else 1.0


def _delayed_as(
    signal: Array, base: Array, model: ImpactModel, local: Array, item: FitShot
) -> Array:
    """Return a model's signal, ``base``, with touch-down moved to be nearest to ``signal``."""
    touch_down, moved = model.names.index("t0_us"), local.copy()
    for _ in range(DELAY_STEPS):
        slope = np.gradient(base) * item.frame.sample_rate_hz * 1e-6
        moved[touch_down] -= float(slope @ (signal - base)) / max(float(slope @ slope), 1e-300)
        base = model.predict(moved, item.frame).signal
    return base


def rescoped(effect: Effect, scope: str) -> Effect:
    """Return an effect whose amplitude is one for each rig, surface, sphere or shot.

    Its other numbers are the rig's; of one without an amplitude all numbers go to that group.
    """
    amplitude = amplitude_of(effect)
    parameters = tuple(
        dataclasses.replace(p, scope=scope if amplitude is None or at == amplitude else "rig")
        for at, p in enumerate(effect.parameters)
    )
    return dataclasses.replace(effect, parameters=parameters)


def scopes_of(effect: Effect) -> tuple[str, ...]:
    """Return the groups worth trying: of contact and mounting the materials too."""
    if effect.basis is not None:
        return ("shot",)
    if effect.base_dashpot is not None:
        return ("rig",)  # which law a contact obeys is no property of a material
    if effect.slot == "contact":
        return ("rig", "surface", "sphere")
    if effect.slot == "mounting" and amplitude_of(effect) is not None:
        return ("rig", "surface", "shot")
    return ("rig",)
