"""Which moduli a diagnosis states, and how far their intervals reach.

A modulus is stated where the model that stands leaves only noise, and withheld everywhere else:
nobody knows how far what the model lacks moves it. Where several names leave noise alike, the
interval reaches to the ends of every one of theirs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.held_out import quality
from analysis.diagnosis.procedure import Diagnosis
from analysis.fit.freed_inputs import inputs_freed
from analysis.fit.measurand import NORMAL95, Json, measurand
from analysis.fit.result import FitResult
from analysis.fit.statements import withheld

STRUCTURE = "more than noise is left in these shots, and nobody knows how far that moves this"
MODULI = ("plane_strain_modulus_Pa", "youngs_modulus_Pa")
OF_MODULI = ("sphere.", "surface.")
"""Beginnings of the parameters that are moduli."""
OF_PAIR = ("sphere", "surface", "shots", "stiffness_over_mass")
"""What is known of a pair whatever its reduced modulus is."""


@dataclass(frozen=True)
class Member:
    """One of the models that the data cannot tell apart.

    Attributes
    ----------
    name : str
        Id of the effect in which it differs.
    result : FitResult
        Its fit.
    squares : float
        Whitened squares that it leaves, its numbers paid for, as far as models differ in them.
    """

    name: str
    result: FitResult
    squares: float


def withhold_sought(block: Json, result: FitResult) -> None:
    """Withhold in a block every modulus that was sought, and whatever would give it away.

    Parameters
    ----------
    block : dict
        Of a document, changed in place.
    result : FitResult
        Whose figures it has.

    Notes
    -----
    One stays that hardly moves without a statement that the shots contradict, where only noise is
    left without that. Those of references are as they were stated, not as a misfit bends them.
    """
    explained = result.explained_by_a_statement
    open_anyway = {one.key for one in result.undetermined}
    block["moduli"] = {
        name: _as_stated(result, name, entry)
        if entry["status"] == "reference"
        else entry
        if name in open_anyway or (explained and entry["without_conflicts"]["stable"])
        else withheld(entry["side"], STRUCTURE)
        for name, entry in block["moduli"].items()
    }
    if not result.shots:
        return
    block["budget"] = None
    block["pairs"] = {
        pair: {key: value for key, value in entry.items() if key in OF_PAIR}
        for pair, entry in block["pairs"].items()
    }
    block["parameters"] = {
        name: value for name, value in block["parameters"].items() if not name.startswith(OF_MODULI)
    }


def _as_stated(result: FitResult, name: str, entry: Json) -> Json:
    """Return a reference's modulus as the campaign states it."""
    campaign = result.problem.campaign
    short = name.partition(":")[2] or name
    material = (campaign.spheres if entry["side"] == "sphere" else campaign.surfaces)[short]
    known = material.youngs_modulus_pa
    assert known is not None
    return {
        "youngs_modulus_Pa": measurand(known.value, known.u, "Pa"),
        "plane_strain_modulus_Pa": None,
        "side": entry["side"],
        "status": "reference",
    }


def members(diagnosis: Diagnosis, after: FitResult) -> list[Member]:
    """Return the models that a family consists of, the one that stands first.

    Parameters
    ----------
    diagnosis : Diagnosis
        With the rivals of each name.
    after : FitResult
        The model that stands, masses and the like as uncertain as they are.

    Returns
    -------
    list of Member
        Each of the others has one of the names replaced.
    """
    last = diagnosis.steps[-1].fitted.cost
    found: list[Member] = []
    for taken in diagnosis.chosen:
        rivals = diagnosis.rivals.get(taken.effect_id, [])
        if rivals and not found:
            found.append(Member(taken.effect_id, after, last))
        for rival in rivals:
            own = inputs_freed(quality(rival.problem, rival.fitted, heldout=False))
            squares = rival.fitted.cost + _paid(rival) - _paid(taken)
            found.append(Member(rival.effect_id, own, squares))
    return found


def _paid(refit: Refit) -> float:
    return refit.gain - refit.score()


def hold_for_all(block: Json, family: Sequence[Member]) -> None:
    """Widen in a block every modulus so that it holds whichever of some models is true.

    Parameters
    ----------
    block : dict
        Of the first of them, changed in place.
    family : sequence of Member
        Two or more; the value is their mean by linearisation, the 95 % interval the least that is
        symmetric in the logarithm and holds those of all.
    """
    weights = _weights(family)
    moduli = [one.result.moduli() for one in family]
    for name, entry in block["moduli"].items():
        open_in = next((i for i, one in enumerate(moduli) if not _known(one.get(name))), None)
        if not _known(entry):
            continue
        if open_in is not None:
            block["moduli"][name] = withheld(entry["side"], _open_under(family, open_in))
            _drop(block, name)
            continue
        for key in MODULI:
            both = [one[name][key] for one in moduli]
            if all(both):
                entry[key] = _reaching(both, weights)
                _account(block, (name, key), entry[key], family)
    for pair, entry in block["pairs"].items():
        _widen(
            entry, "reduced_modulus_Pa", [o.result.pairs().get(pair, {}) for o in family], weights
        )
    for name in block["parameters"]:
        if name.startswith(OF_MODULI):
            _widen(block["parameters"], name, [o.result.parameters() for o in family], weights)


def _weights(family: Sequence[Member]) -> list[float]:
    squares = np.array([one.squares for one in family])
    found = np.exp(-0.5 * (squares - squares.min()))
    return [float(w) for w in found / found.sum()]


def _known(entry: Json | None) -> bool:
    return bool(entry and entry["plane_strain_modulus_Pa"])


def _open_under(family: Sequence[Member], at: int) -> str:
    return (
        f"these data cannot tell {family[0].name} from {family[at].name}, and with that they leave "
        "it open"
    )


def _widen(found: Json, key: str, all_of_them: Sequence[Json], weights: Sequence[float]) -> None:
    every = [one.get(key) for one in all_of_them]
    if all(every):
        found[key] = _reaching([one for one in every if one], weights)


def _reaching(quantities: Sequence[Json], weights: Sequence[float]) -> Json | None:
    """Return the mean of some measurands, with an interval that holds the intervals of all."""
    logs = [math.log(one["value"]) for one in quantities]
    centre = sum(w * log for w, log in zip(weights, logs, strict=True))
    reach = max(
        abs(log - centre) + NORMAL95 * one["u"] / one["value"]
        for log, one in zip(logs, quantities, strict=True)
    )
    value = math.exp(centre)
    return measurand(value, value * reach / NORMAL95, quantities[0]["unit"])


def _drop(block: Json, name: str) -> None:
    if block["budget"] is not None:
        block["budget"]["moduli"].pop(name, None)


def _account(
    block: Json, whose: tuple[str, str], stated: Json | None, family: Sequence[Member]
) -> None:
    """Add a row to a modulus' budget for not knowing which of the names is true."""
    name, key = whose
    budget = ((block["budget"] or {}).get("moduli") or {}).get(name, {}).get(key)
    if budget is None or stated is None:
        return
    relative_u, others = stated["u"] / stated["value"], budget["relative_u"]
    more = math.sqrt(max(relative_u**2 - others**2, 0.0))
    rest = sorted({one.name for one in family[1:]})
    for row in budget["rows"]:
        row["share"] = row["contribution"] ** 2 / relative_u**2
    row = {
        "input": "names",
        "label": f"which of {family[0].name}, {', '.join(rest)} acts",
        "value": None,
        "u": more,
        "unit": "1",
        "distribution": "normal",
        "sensitivity": None,
        "sensitivity_to": "logarithm",
        "contribution": more,
        "share": more**2 / relative_u**2,
        "degrees_of_freedom": None,
        "traceable_to": None,
        "common": True,
    }
    budget["rows"] = sorted([*budget["rows"], row], key=lambda r: -r["contribution"])
    freedom = budget["effective_degrees_of_freedom"]
    budget.update(
        value=stated["value"],
        u=stated["u"],
        relative_u=relative_u,
        relative_u_common=math.hypot(budget["relative_u_common"], more),
        effective_degrees_of_freedom=freedom and freedom * (relative_u / others) ** 4,
    )
    if budget["rows"][0] is row:
        budget["improve"] = (
            f"Not knowing which of {family[0].name}, {', '.join(rest)} acts weighs most: make the "
            "drop that tells them apart."
        )
