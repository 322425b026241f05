"""Sought moduli that a campaign cannot determine, however low the noise of its records.

A shot tells its pair's reduced modulus, :math:`1/E^* = 1/E'_{sphere} + 1/E'_{surface}`, and nothing
of how the sum is divided; in reduced units it does not even tell that. So the question is one of
what the campaign states, not of what was recorded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.campaign import Campaign, Sphere, Surface
from analysis.fit.fit_shot import FitShot, gain_is_observable
from analysis.fit.joint import Fitted
from analysis.fit.priors import modulus_prior
from analysis.fit.problem import JointProblem
from analysis.fit.statements import WITHHOLD_ABOVE
from analysis.model import solver
from analysis.parameters import ParameterName, Side, key_in_moduli, of_material

EXACT_U = 1e-3
"""Of ln E*, with no noise: hundreds of times less than what a modulus is withheld for. Any u as
small does, and doubles hold it beside the next one."""
NOTHING_U = 1e4
"""Of ln E', where nothing is stated: a share of 1e-4 in a pair's compliance leaves it open."""


@dataclass(frozen=True)
class Undetermined:
    """A modulus that was sought and that no quieter record would tell."""

    key: str
    """As under ``moduli`` of a result."""
    side: Side
    material: str
    missing: str
    """``reference`` (a stated modulus), ``gain`` (newtons per volt) or ``sphere`` (radius,
    mass)."""
    sentence: str
    """What is missing, and what to add."""

    def to_json(self) -> dict[str, str]:
        """Return it as part of ``impactd-diagnosis/1``."""
        return {
            "material": self.material,
            "side": self.side,
            "missing": self.missing,
            "sentence": self.sentence,
        }


def undetermined(problem: JointProblem, fitted: Fitted) -> list[Undetermined]:
    """Return the moduli that were sought and that quieter records would not tell either.

    None where no modulus was sought, and for single pairs. How a pair's compliance is divided is
    taken from the fit, nothing else.
    """
    if problem.by_pair:
        return []
    found = [] if fitted.failed else _without_reference(problem, fitted)
    return [*found, *_in_reduced_units(problem)]


def tells_no_modulus(problem: JointProblem, fitted: Fitted) -> bool:
    """Tell whether moduli were sought, and not one of them can be told."""
    found = undetermined(problem, fitted)
    names = [n for n in problem.names if n.is_modulus]
    sought = {n for n in names if _material(problem.campaign, n).youngs_modulus_pa is None}
    return bool(found) and sought <= {of_material(one.side, one.material) for one in found}


def _material(campaign: Campaign, name: ParameterName) -> Sphere | Surface:
    return (campaign.spheres if name.kind == "sphere" else campaign.surfaces)[name.owner]


def _without_reference(problem: JointProblem, fitted: Fitted) -> list[Undetermined]:
    """Return the moduli that stay open with every pair's reduced modulus known exactly.

    They rest on the stated moduli alone then, and a modulus that is not stated is known to nothing.
    """
    names = [n for n in problem.names if n.is_modulus]
    at = [problem.names.index(n) for n in names]
    pairs: dict[str, tuple[ParameterName, ParameterName]] = {}
    slopes = []
    for item in problem.shots:
        keys = problem.material_keys(item)
        if keys is not None and item.pair not in pairs:
            pairs[item.pair] = keys
            slopes.append(problem.shared_local(item, fitted.theta)[1][0, at])
    if not names or not slopes:
        return []
    exact = np.array(slopes) / EXACT_U
    stated = [_stated_precision(problem.campaign, name) for name in names]
    u = np.sqrt(np.diag(np.linalg.inv(np.diag(stated) + exact.T @ exact)))
    open_names = [
        name
        for name, width in zip(names, u, strict=True)
        if not width <= WITHHOLD_ABOVE
        and _material(problem.campaign, name).youngs_modulus_pa is None
    ]
    return [_open(problem, name, pairs) for name in open_names]


def _stated_precision(campaign: Campaign, name: ParameterName) -> float:
    """Return what a campaign states of ln E', as an inverse variance."""
    material = _material(campaign, name)
    known = modulus_prior(material.youngs_modulus_pa, material.poissons_ratio)
    return NOTHING_U**-2 if known is None else max(known.u, EXACT_U) ** -2


def _open(
    problem: JointProblem,
    name: ParameterName,
    pairs: dict[str, tuple[ParameterName, ParameterName]],
) -> Undetermined:
    side, short = name.side, name.owner
    partners = {k[1] if name == k[0] else k[0] for k in pairs.values() if name in k}
    met = " and ".join(sorted(one.owner for one in partners))
    add = (
        f"a sphere of stated modulus on {short}, or {met} on a surface of stated modulus"
        if side == "surface"
        else f"{short} on a surface of stated modulus, or a sphere of stated modulus on {met}"
    )
    sentence = (
        f"The modulus of {short} cannot be told from these drops, however quiet they are: they "
        f"show what {short} and {met} yield together, and no stated modulus divides it. State the "
        f"modulus of {met}, or drop {add}."
    )
    return Undetermined(key_in_moduli(name, problem.names), side, short, "reference", sentence)


def _in_reduced_units(problem: JointProblem) -> list[Undetermined]:
    """Return the moduli of materials all of whose shots are in reduced units."""
    campaign = problem.campaign
    found: dict[str, Undetermined] = {}
    items = [item for item in problem.shots if problem.material_keys(item) is None]
    sides = {name for item in items for name in _materials_of(item)}
    for item in items:
        for name in _materials_of(item):
            short = name.owner
            if name in found or name in problem.names or not _is_sought(campaign, name):
                continue
            missing, why = _what_is_missing(problem, item)
            sentence = (
                f"The modulus of {short} cannot be told, however quiet the records are: {why}"
            )
            key = key_in_moduli(name, [*problem.names, *sides])
            found[name] = Undetermined(key, name.side, short, missing, sentence)
    return list(found.values())


def _materials_of(item: FitShot) -> tuple[ParameterName, ParameterName]:
    return of_material("sphere", item.shot.sphere), of_material("surface", item.shot.surface)


def _is_sought(campaign: Campaign, name: ParameterName) -> bool:
    """Tell whether somebody wants the modulus of a material without one.

    Poisson's ratio and references serve nothing else. Recordings that are in reduced units on
    purpose state neither.
    """
    listed: dict[str, Sphere] | dict[str, Surface]
    listed = campaign.spheres if name.kind == "sphere" else campaign.surfaces
    own = listed.get(name.owner)
    if own is None or own.youngs_modulus_pa is not None:
        return False
    references = [m.youngs_modulus_pa for m in campaign.spheres.values()]
    references += [m.youngs_modulus_pa for m in campaign.surfaces.values()]
    return own.poissons_ratio is not None or any(references)


def _what_is_missing(problem: JointProblem, item: FitShot) -> tuple[str, str]:
    """Return why a shot is in reduced units, and what to state."""
    campaign = problem.campaign
    ball = campaign.spheres.get(item.shot.sphere or "")
    what = {"radius": ball and ball.radius_m, "mass": ball and ball.mass_kg}
    unknown = [name for name, value in what.items() if not value]
    if unknown:
        which = " and ".join(unknown)
        return "sphere", (
            f"the {which} of {item.shot.sphere or 'the sphere'} {_are(unknown)} not stated, and "
            f"without {_them(unknown)} a contact has no modulus. State the {which}."
        )
    kv = problem.model.kind == solver.KV
    if item.shot.quantity == "voltage" and not gain_is_observable(campaign, kv=kv):
        cell = "compliance and stiffness" if kv else "gain"
        return "gain", (
            "nothing turns volts into newtons: neither the gain of the cell nor a drop height is "
            f"stated. State the cell's {cell}, or the drop heights."
        )
    return "surface", "the surface has no name. Name it in every shot."


def _are(names: list[str]) -> str:
    return "is" if len(names) == 1 else "are"


def _them(names: list[str]) -> str:
    return "it" if len(names) == 1 else "them"
