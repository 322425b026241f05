"""Which moduli a diagnosis states, and how far their intervals reach.

A modulus is stated where the model that stands leaves only noise, and withheld everywhere else:
nobody knows how far what the model lacks moves it. An effect's own numbers stand there without an
uncertainty. Where several names leave noise alike, or several forms of a law, the interval reaches
to the ends of every one of theirs; so does that of an effect's own number over forms.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Json
from analysis.diagnosis.candidate import STEPS_FROM_NEAR, Refit
from analysis.diagnosis.held_out import as_fit_result
from analysis.diagnosis.procedure import Diagnosis
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.score_test import check_residual
from analysis.fit import joint
from analysis.fit.freed_inputs import SETTLING_STEPS, inputs_freed
from analysis.fit.measurand import measurand
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult
from analysis.fit.statements import effect_parameters_json, withheld
from analysis.parameters import key_in_moduli
from analysis.written_numbers import K_95

STRUCTURE_LEFT = (
    "the residual of these shots is not only noise, and how far what is missing moves this modulus "
    "is unknown"
)
"""Why a modulus is withheld."""
KNOWN_OF_PAIR = ("sphere", "surface", "shots", "stiffness", "stiffness_over_mass")
"""What is known of a pair whatever its reduced modulus is."""


def is_noise_without_statements(stated: JointProblem, result: FitResult) -> bool:
    """Return whether nothing but noise is left without the statements that the shots contradict.

    ``stated`` is the problem with masses, heights and the like as they are stated. A sum of squares
    is a weak test: a height that was wrong by a quarter moved that of 54 shots by less than chance
    does, and another statement seemed to explain it. So the score test is asked where the shots put
    all these numbers.
    """
    clear = result.without_conflicts
    if clear is None or not result.explained_by_a_statement:
        return False
    wide, theta, own = clear.problem, clear.fitted.theta, len(stated.names)
    moved = dataclasses.replace(
        unwatched(stated),  # short, and without it nothing could be said
        shots=[wide.item_at(item, theta) for item in stated.shots],
        prior_mean=wide.prior_mean[:own],
        prior_precision=wide.prior_precision[:own, :own],
    )
    nuisances = clear.fitted.nuisances
    near = joint.fit(moved, nuisances, theta=theta[:own], max_iterations=SETTLING_STEPS)
    return not near.failed and not check_residual(moved, near)[1].structured


def withhold_sought(block: Json, result: FitResult, *, explained: bool) -> None:
    """Withhold in a block every modulus that was sought, and whatever would give it away.

    One stays that hardly moves without a statement that the shots contradict, where these have
    ``explained`` all, as `is_noise_without_statements` tells. Those of references are as they were
    stated, not as a misfit bends them.
    """
    undetermined = {one.key for one in result.undetermined}
    for name, entry in block["moduli"].items():
        if entry["status"] == "reference":
            block["moduli"][name] = _as_stated(result, name, entry)
        elif name not in undetermined and not (explained and entry["without_conflicts"]["stable"]):
            block["moduli"][name] = withheld(entry["side"], STRUCTURE_LEFT)
    if not result.shots:
        return
    block["budget"] = None
    block["pairs"] = {
        pair: {key: value for key, value in entry.items() if key in KNOWN_OF_PAIR}
        for pair, entry in block["pairs"].items()
    }
    for name in result.problem.names:
        if name.is_modulus:
            block["parameters"].pop(name, None)
        elif name.kind == "effect":
            block["parameters"][name] = without_uncertainty(block["parameters"].get(name))


def without_uncertainty(number: Json | None) -> Json:
    """Return a number of an effect where structure is left: nobody knows how far that moves it."""
    known = number or {"value": None, "unit": ""}
    return {"value": known["value"], "u": None, "unit": known["unit"]}


def _as_stated(result: FitResult, key: str, entry: Json) -> Json:
    """Return a reference's modulus as the campaign states it."""
    campaign, names = result.problem.campaign, result.problem.names
    name = next(n for n in names if n.is_modulus and key_in_moduli(n, names) == key)
    material = (campaign.spheres if name.kind == "sphere" else campaign.surfaces)[name.owner]
    known = material.youngs_modulus_pa
    assert known is not None
    return {
        "youngs_modulus_Pa": measurand(known.value, known.u, "Pa"),
        "plane_strain_modulus_Pa": None,
        "side": entry["side"],
        "status": "reference",
    }


@dataclass(frozen=True)
class Member:
    """One of the models that the data cannot distinguish."""

    name: str
    """Id of the effect in which it differs."""
    result: FitResult
    squares: float
    """Whitened squares that it leaves, its numbers paid for, as far as models differ in them."""


def family_members(diagnosis: Diagnosis, after: FitResult) -> list[Member]:
    """Return the models that the data do not tell apart, the one that stands first.

    In each of the others one name is replaced, or one form. ``after`` is the first one, masses and
    the like as uncertain as they are. Every other one has been fitted: along a bent valley it goes
    no further than a search lets it.
    """

    def ended(rival: Refit) -> FitResult:
        """Return another model as the result of a fit."""
        exact = as_fit_result(rival.problem, rival.fitted, heldout=False, steps=STEPS_FROM_NEAR)
        return inputs_freed(exact, steps=STEPS_FROM_NEAR)

    found: list[Member] = []
    for taken in diagnosis.chosen:
        forms = diagnosis.forms_as_good.get(taken.effect_id, [])
        rivals = [*diagnosis.rivals.get(taken.effect_id, []), *forms]
        if rivals and not found:
            found.append(Member(taken.effect.id, after, diagnosis.steps[-1].fitted.cost))
        results = taken.problem.each(ended, rivals)
        for rival, result in zip(rivals, results, strict=True):
            squares = rival.fitted.cost + _price(rival) - _price(taken)
            found.append(Member(rival.effect.id, result, squares))
    return found


def _price(refit: Refit) -> float:
    return refit.gain - refit.score()


def widen_over_family(block: Json, family: Sequence[Member]) -> None:
    """Widen every modulus in the first member's block so that it holds whichever model is true.

    The value is the mean of all members by linearisation, weighted by exp(-squares/2); the 95 %
    interval is the least that is symmetric in the logarithm and holds those of all.
    """
    squares = np.array([one.squares for one in family])
    weights = np.exp(-0.5 * (squares - squares.min()))
    weights /= weights.sum()
    moduli = [one.result.moduli() for one in family]
    for name, entry in block["moduli"].items():
        if not entry["plane_strain_modulus_Pa"]:
            continue
        every = [one.get(name) or {} for one in moduli]
        open_in = [
            one.name
            for one, own in zip(family, every, strict=True)
            if not own.get("plane_strain_modulus_Pa")
        ]
        if open_in:
            reason = (
                f"these data cannot distinguish {family[0].name} from {open_in[0]}, so the "
                "modulus is not determined"
            )
            block["moduli"][name] = withheld(entry["side"], reason)
            if block["budget"] is not None:
                block["budget"]["moduli"].pop(name, None)
            continue
        for key in ("plane_strain_modulus_Pa", "youngs_modulus_Pa"):
            stated = _widen(entry, key, every, weights)
            budget = ((block["budget"] or {}).get("moduli") or {}).get(name, {}).get(key)
            if stated is not None and budget is not None:
                _add_to_budget(budget, stated, [one.name for one in family])
    for pair, entry in block["pairs"].items():
        of_pair = [one.result.pairs().get(pair, {}) for one in family]
        _widen(entry, "reduced_modulus_Pa", of_pair, weights)
    for name in family[0].result.problem.names:
        if name.is_modulus and name in block["parameters"]:
            _widen(block["parameters"], name, [one.result.parameters() for one in family], weights)


def _widen(
    block: Json, key: str, of_members: Sequence[Json], weights: NDArray[np.float64]
) -> Json | None:
    """Put the members' mean, with an interval that holds all of theirs, into a block; return it."""
    each = [one[key] for one in of_members if one.get(key)]
    if len(each) < len(of_members):
        return None
    values = np.array([one["value"] for one in each])
    relative_u = np.array([one["u"] for one in each]) / values
    centre = float(weights @ np.log(values))
    reach = float(np.max(np.abs(np.log(values) - centre) + K_95 * relative_u))
    value = math.exp(centre)
    block[key] = measurand(value, value * reach / K_95, each[0]["unit"])
    stated: Json | None = block[key]
    return stated


def widen_over_forms(numbers: Json, forms: Sequence[Refit]) -> None:
    """Widen an effect's numbers so that their intervals hold whichever form of its law is true."""
    for other in forms:
        every = effect_parameters_json(other.problem, other.fitted)
        own = {name.short: one for name, one in every.items() if name.is_of(other.effect.id)}
        for name, stated in numbers.items():
            beside = own.get(name)
            if not (stated and beside):
                continue
            lows, highs = zip(stated["interval95"], beside["interval95"], strict=True)
            low = -math.inf if None in lows else min(lows)
            high = math.inf if None in highs else max(highs)
            reach = max(stated["value"] - low, high - stated["value"])
            u = reach / K_95 if math.isfinite(reach) else stated["u"]
            numbers[name] = measurand(stated["value"], u, stated["unit"], interval=(low, high))


def _add_to_budget(budget: Json, stated: Json, names: Sequence[str]) -> None:
    """Add a row to a modulus' budget for not knowing which of the names is true."""
    relative_u, others = stated["u"] / stated["value"], budget["relative_u"]
    more = math.sqrt(max(relative_u**2 - others**2, 0.0))
    which = f"which of {names[0]}, {', '.join(sorted(set(names[1:])))} acts"
    row = {
        "input": "names",
        "label": which,
        "value": None,
        "u": more,
        "unit": "1",
        "distribution": "normal",
        "sensitivity": None,
        "sensitivity_to": "logarithm",
        "contribution": more,
        "share": 0.0,
        "degrees_of_freedom": None,
        "traceable_to": None,
        "common": True,
    }
    rows = sorted([*budget["rows"], row], key=lambda r: -r["contribution"])
    for one in rows:
        one["share"] = one["contribution"] ** 2 / relative_u**2
    freedom = budget["effective_degrees_of_freedom"]
    budget.update(
        rows=rows,
        value=stated["value"],
        u=stated["u"],
        relative_u=relative_u,
        relative_u_common=math.hypot(budget["relative_u_common"], more),
        effective_degrees_of_freedom=freedom and freedom * (relative_u / others) ** 4,
    )
    if rows[0] is row:
        budget["improve"] = (
            f"Not knowing {which} contributes most: make the drop that distinguishes them."
        )
