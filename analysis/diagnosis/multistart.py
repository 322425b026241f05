"""The starts of refits: first-order sizes, and usual sizes where first order predicts nothing."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.basis.families import scale_of, tuned
from analysis.diagnosis.basis.groupings import Sizes
from analysis.diagnosis.basis.linear_filter import DAMPED
from analysis.diagnosis.basis.proposals import (
    Proposal,
    can_be_negative,
    column_is_difference,
    default_starts,
    rescoped,
    scopes_of,
)
from analysis.diagnosis.candidate import (
    KNOWN_BEFORE,
    STEPS_FROM_NEAR,
    Refit,
    extended,
    fitted_coordinate,
    price_of_scatter,
    refit,
)
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.linearised import Linearised
from analysis.effects.acts_on import ActsOn
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.below_one import USUAL_REBOUND
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.settle import settle
from analysis.parameters import of_effect

STARTS_PER_EFFECT, STARTS_PER_STRUCTURE = 2, 4
"""Forms or starts that the linear look puts first; what is below the sphere has more valleys."""
USUAL_MODULUS_PA = 3e9
"""Where an unknown plastic begins when the records themselves mislead."""
USUAL_STARTS, FAR_STARTS = 4, 8
"""Usual sizes of an effect that are fitted, from near and from afar, the mildest first."""
STEPS_TO_ORDER = 2
"""Of a shot's own parameters before starts are put in order. Measured on twelve orders in three
campaigns: of the six starts that 8 steps put first, 70 of 72 were among the eight that are kept, in
half of the time."""
RISES_AFTER = 0.2
"""Share of a pulse's width after touch-down at which it has risen by 5 %, or so."""
WELL_BELOW = 0.7
"""Share of the largest excursion that a ceiling, if there is one, does not touch."""


@dataclass(frozen=True)
class Start:
    """One way to begin fitting one effect."""

    proposal: Proposal
    scope: str
    coefficients: dict[str, float]
    """Amplitude by group; empty for the proposal's own."""
    promised: float
    """Linear gain less its price."""
    begin: joint.Fitted | None = None
    """Where the present model begins, if not at its best."""
    only: ActsOn | None = None
    """The materials that the effect acts on; None for all."""
    possible: bool = True
    """Some size that first order asks for is one that the effect can have."""

    def fitted(
        self, problem: JointProblem, base: joint.Fitted, max_iterations: int = STEPS_FROM_NEAR
    ) -> Refit:
        """Return the model with the effect, some steps on from here."""
        return refit(
            problem,
            base,
            self.proposal,
            scope=self.scope,
            coefficients=self.coefficients,
            linear_gain=self.promised,
            max_iterations=max_iterations,
            begin=self.begin,
            only=self.only,
        )


def starts(
    linearised: Linearised, tried: list[Proposal], *, alone: bool = False
) -> dict[str, list[Start]]:
    """Return for each library entry where to begin, the most promising first.

    ``alone``: the shots are one material's, whose numbers are its own or each shot's.
    """
    found: dict[str, list[Start]] = {}
    for proposal in tried:
        linearised.problem.checkpoint()
        for scope in scopes_of(proposal.effect):
            if alone and scope in ("surface", "sphere"):
                continue
            seen = linearised.explain(proposal.key, scope, heldout=False)
            sizes = dict(zip(seen.groups, seen.coefficients.values(), strict=True))
            own = seen.dof if scope == "shot" else 0
            paid = CRITERIA.price_of_number * (seen.dof - own)
            possible = _is_possible(proposal, sizes)
            gain = seen.gain if possible else 0.0
            promised = gain - paid - price_of_scatter(own, gain)
            own_starts = found.setdefault(proposal.effect_id, [])
            own_starts.append(Start(proposal, scope, sizes, promised, possible=possible))
            if seen.sizes is not None:
                own_starts += _on_some(proposal, seen.sizes)
    for some in found.values():
        some.sort(key=lambda s: -s.promised)
    return dict(sorted(found.items(), key=lambda item: -item[1][0].promised))


def where_it_rings(
    problem: JointProblem, fitted: joint.Fitted, tried: list[Proposal]
) -> list[Proposal]:
    """Return resonances that begin at the frequency and damping at which the residual rings.

    A sharp resonance has a valley narrower than the spacing of any usual frequencies.
    """
    names = ("frequency_hz", "damping_ratio")
    own = [p for p in tried if set(names) <= {one.name for one in p.effect.parameters}]
    if not own:
        return []
    scale = tuned(problem, fitted, scale_of(problem, fitted), (DAMPED,))
    rings = dict(zip(names, (scale.tuned_hz[DAMPED] / scale.pace, scale.tuned_zeta), strict=True))
    found = {}
    for proposal in own:
        at = tuple(
            one.coordinate(min(max(rings[one.name], one.low), one.high)) if one.name in rings else c
            for one, c in zip(proposal.effect.parameters, proposal.coordinates, strict=True)
        )
        moved = dataclasses.replace(proposal, coordinates=at)
        found[moved.key] = moved
    return list(found.values())


def _is_possible(proposal: Proposal, sizes: dict[str, float]) -> bool:
    """Tell whether an effect can have any of its first-order sizes.

    It has one sign, and where the column is all that a start does *nothing* of it is none.
    """
    if column_is_difference(proposal):
        whole = 1.0 if proposal.amplitude is None else proposal.coordinates[proposal.amplitude]
        return any(size > CRITERIA.nothing * whole for size in sizes.values())
    signed = proposal.amplitude is not None and not can_be_negative(proposal.effect)
    return not signed or any(size > 0.0 for size in sizes.values())


def _on_some(proposal: Proposal, sizes: Sizes) -> list[Start]:
    """Return the most promising start on some materials of a kind, none where there is none."""
    either = can_be_negative(proposal.effect)
    found = []
    for only in sizes.candidates(either_sign=either)[:1]:
        promised = sizes.promise(only) - CRITERIA.price_of_number
        size = {only.label: sizes.common(only.names)[0]}
        found.append(Start(proposal, only.kind, size, promised, only=only))
    return found


def distinct(
    own: list[Start],
    few: JointProblem,
    base: joint.Fitted,
    *,
    bent: bool,
    begins: list[joint.Fitted],
    earlier: Refit | None = None,
) -> list[Start]:
    """Return the best few that differ in form or start, one for the whole rig among them.

    What acts on some materials only comes on top, where it promises most. Where slopes mislead so
    do sizes that do not rest on them: those that an earlier turn has fitted, else the usual ones.
    """
    some = [s for s in own[:1] if s.only is not None]
    own = [s for s in own if s.only is None and (s.possible or bent)]
    if not own:
        return some
    structure = own[0].proposal.effect.structure is not None
    wanted = STARTS_PER_STRUCTURE if structure else STARTS_PER_EFFECT
    found: list[Start] = []
    for entry in own:
        if all(entry.proposal.key != f.proposal.key for f in found):
            found.append(entry)
        if len(found) == wanted:
            break
    if all(f.scope != "rig" for f in found):
        found += [s for s in own if s.scope == "rig"][:1]
    return found + some + (_without_slopes(own, few, base, begins, earlier) if bent else [])


def _without_slopes(
    own: list[Start],
    few: JointProblem,
    base: joint.Fitted,
    begins: list[joint.Fitted],
    earlier: Refit | None,
) -> list[Start]:
    """Return each form's starts at the sizes of an earlier turn, else at its usual ones."""
    forms: dict[str, Start] = {}
    for start in own:
        forms.setdefault(start.proposal.effect.id, start)
    found = []
    for likely in forms.values():
        if likely.proposal.effect.basis is not None:
            continue
        sizes = None if earlier is None else _sizes_of(earlier, likely.proposal.effect)
        ways = (
            _usual(likely.proposal.effect, few, base, begins)
            if sizes is None
            else [(place, sizes) for place in (None, *begins[:1])]
        )
        for place, at in ways:
            proposal = dataclasses.replace(likely.proposal, coordinates=at)
            found.append(Start(proposal, likely.scope, {}, likely.promised, begin=place))
    return found


def _sizes_of(earlier: Refit, form: Effect) -> tuple[float, ...] | None:
    """Return the coordinates that a form's numbers had; None where these were others, or no fit."""
    if earlier.at_bound or earlier.fitted.failed:
        return None
    found = []
    for parameter in form.parameters:
        value = fitted_coordinate(earlier, parameter.name)
        if value is None:
            return None
        found.append(value)
    return tuple(found)


def _usual(
    effect: Effect, few: JointProblem, base: joint.Fitted, begins: list[joint.Fitted]
) -> list[tuple[joint.Fitted | None, tuple[float, ...]]]:
    """Return the usual sizes of an effect, whatever the linear look says, and where to begin."""
    coordinates = default_starts(effect, max(s.window.peak for s in few.shots))
    places: list[joint.Fitted | None] = [*(begins if ends_the_signal(effect) else begins[:1])]
    if effect.structure is None or not begins:
        places.append(None)
    found = []
    for place in places:
        kept = FAR_STARTS if place and len(effect.parameters) > 1 else USUAL_STARTS
        nearest = coordinates
        if len(coordinates) > kept:
            settled = place is not None and effect.structure is not None
            nearest = _mildest(effect, coordinates, few, place or base, settled=settled)
            nearest = _of_both_signs(nearest)[:kept]
        found += [(place, at) for at in nearest]
    return found


def _mildest(
    effect: Effect,
    coordinates: list[tuple[float, ...]],
    few: JointProblem,
    base: joint.Fitted,
    *,
    settled: bool,
) -> list[tuple[float, ...]]:
    """Return starts in order of the misfit they begin with, those that change nothing last.

    A yield pressure that nothing reaches, a ceiling above all peaks: from there no slope leads on.
    Far from the data the shots' own parameters are settled first.
    """
    own = rescoped(effect, "rig")
    nuisances = base.nuisances
    if settled:
        nuisances = settle(few, base.theta, nuisances, kept=KNOWN_BEFORE)
    without = joint.total_cost(few, base.theta, nuisances)
    found = []
    for at in coordinates:
        names = (of_effect(own.id, p.name) for p in own.parameters)
        larger, theta, start = extended(few, base, own, dict(zip(names, at, strict=True)))
        if settled:
            start = settle(larger, theta, start, kept=KNOWN_BEFORE, steps=STEPS_TO_ORDER)
        cost = joint.total_cost(larger, theta, start)
        nothing = not math.isfinite(cost) or abs(cost - without) < CRITERIA.no_difference
        found.append((nothing, cost, at))
    return [at for _, _, at in sorted(found)]


def _of_both_signs(ordered: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return starts with the two signs of the size in turn; no slope leads from one to the other.

    A mode that takes away begins with a larger misfit than one that adds, nearly everywhere.
    """
    below = [at for at in ordered if at[0] < 0.0]
    above = [at for at in ordered if at[0] >= 0.0]
    pairs = itertools.zip_longest(*sorted((below, above), key=lambda own: own[:1] != ordered[:1]))
    return [at for pair in pairs for at in pair if at is not None]


def usual_place(problem: JointProblem, nuisances: Array) -> joint.Fitted:
    """Return a model at what was known before any record: where a large effect's fit may begin.

    Not fitted at all: the means of what is known well, the prepared start for the rest.
    """
    known = np.diag(problem.prior_precision) > CRITERIA.uncertain_u**-2
    theta = np.where(known, problem.prior_mean, problem.start)
    for at, name in enumerate(problem.names):
        if not known[at] and name.is_modulus:
            theta[at] = math.log(USUAL_MODULUS_PA)
    nuisances = nuisances.copy()
    for row, item in enumerate(problem.shots):
        if item.speed_prior is not None:
            nuisances[row, 0] = item.speed_prior.mean
        nuisances[row, 1] = math.log(USUAL_REBOUND.value)
        nuisances[row, 2] = _touch_down_us(item, float(nuisances[row, 2]))
    nothing = np.zeros((theta.size, theta.size))
    return joint.Fitted(theta, nuisances, [], nothing, math.inf, 0, False)


def extended_like(
    problem: JointProblem, prepared: Array, like: Refit
) -> tuple[JointProblem, Array, Array]:
    """Return a problem with an effect that was fitted beside another base or statement.

    With it where to start: the globals where that fit ended, the shots' own at the usual place.
    """
    larger, theta, nuisances = extended(problem, usual_place(problem, prepared), like.effect, {})
    known = dict(zip(like.problem.names, like.fitted.theta, strict=True))
    begin = [known.get(n, v) for n, v in zip(larger.names, theta, strict=True)]
    return larger, np.array(begin), nuisances


def _touch_down_us(item: FitShot, prepared_us: float) -> float:
    """Return the prepared touch-down, or one from where the pulse rises if the two contradict."""
    width_us = 1e6 * item.window.width_s
    rise_us = 1e6 * item.window.rise_index / item.frame.sample_rate_hz
    risen = rise_us - RISES_AFTER * width_us
    return risen if abs(prepared_us - risen) > RISES_AFTER * width_us else prepared_us


def below_a_ceiling(problem: JointProblem, begin: joint.Fitted) -> joint.Fitted:
    """Return the model fitted to what lies well within the campaign's largest excursion.

    Where the signal has an end, what is above it says nothing, and a model that must follow it is
    drawn far away; records and predictions that are cut alike below it agree whatever is above.
    ``begin`` where the cut records cannot be fitted.
    """
    level = WELL_BELOW * max(s.window.peak for s in problem.shots)
    shots = []
    for item in problem.shots:
        low, high = item.frame.rail or (-math.inf, math.inf)
        rail = (max(low, -level), min(high, level))
        signal = np.clip(item.window.signal, *rail)
        window = dataclasses.replace(item.window, signal=signal)
        frame = dataclasses.replace(item.frame, rail=rail)
        shots.append(dataclasses.replace(item, window=window, frame=frame))
    cut = dataclasses.replace(problem, shots=shots)
    nuisances = settle(cut, begin.theta, begin.nuisances, kept=KNOWN_BEFORE)
    found = joint.fit_to_compare(cut, nuisances, theta=begin.theta)
    return begin if found.failed else found


def ends_the_signal(effect: Effect) -> bool:
    """Tell whether an effect sets an end to the signal, in the signal's own unit."""
    return any(p.peak_starts for p in effect.parameters)
