"""What a joint fit says, as JSON: moduli by material, pairs, parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from analysis.aliases import Json
from analysis.campaign import Sphere, Surface
from analysis.effects.effect import EffectParameter
from analysis.fit.conflicts import STABLE_BELOW
from analysis.fit.estimates import (
    HSD_FIELDS,
    calibration_part,
    input_parts,
    log_of,
    pair_modulus,
    sensor_logs,
    through_calibration,
)
from analysis.fit.joint import Fitted
from analysis.fit.measurand import measurand, young_from_plane_strain
from analysis.fit.priors import SEEN, SENSOR_FIELDS, UNKNOWN_LOG_U, modulus_prior
from analysis.fit.problem import JointProblem
from analysis.parameters import DAMPING, FREQUENCY, GAIN, ParameterName, key_in_moduli
from analysis.written_numbers import K_95

WITHHOLD_ABOVE = 0.25
"""A relative standard uncertainty beyond which a modulus is withheld."""

CONTRADICTED_ABOVE = 3.0
"""A reference that the fit moved by more of its stated uncertainties speaks against the model."""

_CELL_FORMS = {
    GAIN: ("gain_N_per_V", 1.0, "N/V"),
    FREQUENCY: ("natural_frequency_Hz", 1 / (2 * math.pi), "Hz"),
    DAMPING: ("damping_ratio", 1.0, "1"),
}
_CELL_UNITS = ("kg", "N/m", "N s/m", "m/V")


def moduli_json(problem: JointProblem, fitted: Fitted) -> Json:
    """Return ``moduli`` of ``impactd-diagnosis/1``: by material, withheld where not known.

    A name that is both a sphere's and a surface's is preceded by which it is.
    """
    found: Json = {}
    for name in problem.names:
        if not name.is_modulus:
            continue
        side, campaign = name.kind, problem.campaign
        material = (campaign.spheres if side == "sphere" else campaign.surfaces)[name.owner]
        key = key_in_moduli(name, problem.names)
        found[key] = _modulus(*log_of(problem, fitted, name), side, material)
    return found


def withheld(side: str, reason: str) -> Json:
    """Return the entry of a material whose modulus is not stated, with the reason."""
    return {
        "youngs_modulus_Pa": None,
        "plane_strain_modulus_Pa": None,
        "side": side,
        "status": "withheld",
        "reason": reason,
    }


def withhold_fitted(moduli: Json, reason: str) -> None:
    """Withhold every modulus that was to be found, in place; those of references stay."""
    for name, entry in moduli.items():
        if entry["status"] == "fitted":
            moduli[name] = withheld(entry["side"], reason)


def _modulus(log: float, u: float, side: str, material: Sphere | Surface) -> Json:
    """Return one material's entry from ln E' and its standard uncertainty."""
    if not u <= WITHHOLD_ABOVE:
        factor = math.exp(min(u, 2 * UNKNOWN_LOG_U))
        return withheld(
            side,
            f"these data leave a factor {factor:.2g} open; drop a reference sphere on it, or this "
            "sphere on a reference surface",
        )
    plane = math.exp(log)
    young = None
    if material.poissons_ratio is not None:
        e, u_e = young_from_plane_strain(
            log, u, material.youngs_modulus_pa, material.poissons_ratio
        )
        young = measurand(e, e * u_e, "Pa")
    entry: Json = {
        "youngs_modulus_Pa": young,
        "plane_strain_modulus_Pa": measurand(plane, plane * u, "Pa"),
        "side": side,
        "status": "fitted",
    }
    known = material.youngs_modulus_pa
    stated = modulus_prior(known, material.poissons_ratio)
    if known is not None and stated is not None:
        entry["status"] = "reference"
        entry["stated_youngs_modulus_Pa"] = measurand(known.value, known.u, "Pa")
        entry["shift_from_stated_in_u"] = (log - stated.mean) / stated.u
    return entry


def add_without_conflicts(moduli: Json, without: Json) -> None:
    """Add to every modulus what it is without the statements that contradict the shots.

    ``without`` is the `moduli_json` of the fit without them.
    """
    for name, entry in moduli.items():
        ours, theirs = (x[name]["plane_strain_modulus_Pa"] for x in (moduli, without))
        moved = None
        if ours and theirs:
            moved = math.log(theirs["value"] / ours["value"]) / (theirs["u"] / theirs["value"])
        entry["without_conflicts"] = {
            "youngs_modulus_Pa": without[name]["youngs_modulus_Pa"],
            "plane_strain_modulus_Pa": theirs,
            "moved_by_u": moved,
            "stable": moved is not None and abs(moved) < STABLE_BELOW,
        }


def withhold_resting(moduli: Json, paths: Sequence[str]) -> None:
    """Withhold every modulus that was to be found and rests on contradicted statements, in place.

    To be called after `add_without_conflicts`.
    """
    reason = (
        f"it rests on what the shots contradict ({', '.join(paths)}): check that, and fit again"
    )
    for name, entry in moduli.items():
        without = entry["without_conflicts"]
        if entry["status"] == "fitted" and not without["stable"]:
            moduli[name] = withheld(entry["side"], reason) | {"without_conflicts": without}


def rests(moduli: Json) -> list[str]:
    """Return a sentence: which moduli stay without contradicted statements, and which rest on them.

    None where no modulus was to be found, or none could be. To be called after
    `add_without_conflicts`.
    """
    known = {n: one["without_conflicts"] for n, one in moduli.items() if "without_conflicts" in one}
    sought = [
        n for n, w in known.items()
        if moduli[n]["status"] != "reference" and w["moved_by_u"] is not None
    ]  # fmt: skip
    still = [n for n in sought if known[n]["stable"]]
    moved = [n for n in sought if n not in still]
    parts = [f"{', '.join(still)} hardly moves without it"] if still else []
    parts += [f"{', '.join(moved)} rests on it"] if moved else []
    return [f"Of the moduli that were to be found, {'; '.join(parts)}."] if parts else []


_STIFFNESS, _STIFFNESS_OVER_MASS = "N m^-1.5", "N m^-1.5 kg^-1"


def pairs_json(problem: JointProblem, fitted: Fitted) -> Json:
    """Return by ``sphere/surface`` the reduced modulus, or the stiffness in reduced units."""
    found: Json = {}
    for item in problem.shots:
        if item.pair in found:
            found[item.pair]["shots"] += 1
            continue
        entry: Json = {"sphere": item.shot.sphere, "surface": item.shot.surface, "shots": 1}
        modulus = pair_modulus(problem, fitted, item)
        if modulus is not None:
            value = math.exp(modulus[0])
            entry["reduced_modulus_Pa"] = measurand(value, value * modulus[1], "Pa")
            u_cell, sensitivity = calibration_part(problem, fitted, item)
            entry["u_calibration_Pa"] = value * u_cell
            fields = SENSOR_FIELDS if sensitivity.size > 1 else HSD_FIELDS
            entry["d_ln_reduced_modulus_d_ln_sensor"] = dict(
                zip(fields, sensitivity.tolist(), strict=True)
            )
            through = through_calibration(problem, fitted, item)
            entry["inputs"] = {
                name: {
                    "d_ln_reduced_modulus_d_input": float(follows[0]),
                    "through_calibration": through[name],
                    "u": u,
                }
                for name, (follows, u) in input_parts(problem, fitted, modulus[2][None]).items()
            }
        else:
            values, chain = problem.shared_local(item, fitted.theta)
            k = math.exp(values[0])
            u = math.sqrt(float(chain[0] @ fitted.covariance @ chain[0]))
            if item.in_si and item.mass_is_stated:
                entry["stiffness"] = measurand(k, k * u, _STIFFNESS)
            else:
                k /= item.frame.mass_kg
                entry["stiffness_over_mass"] = measurand(k, k * u, _STIFFNESS_OVER_MASS)
        found[item.pair] = entry
    return found


def cell_json(problem: JointProblem, fitted: Fitted) -> Json:
    """Return what was fitted of the cell, identifiable combinations first, with units."""
    found: Json = {}
    for name, (label, factor, unit) in _CELL_FORMS.items():
        if name in problem.names:
            log, u = log_of(problem, fitted, name)
            value = factor * math.exp(log)
            found[label] = measurand(value, value * u, unit)
    cell = sensor_logs(problem, fitted)
    if cell is not None:
        for field, log, u, unit in zip(
            SENSOR_FIELDS, cell[0], np.sqrt(np.diag(cell[1])), _CELL_UNITS, strict=True
        ):
            value = math.exp(log)
            found[field] = measurand(value, value * u, unit)
    return found


def parameters_json(problem: JointProblem, fitted: Fitted) -> Json:
    """Return what was fitted, identifiable combinations first, with units."""
    cell = cell_json(problem, fitted)
    found: Json = {f"sensor.{label}": value for label, value in cell.items()}
    for name in problem.names:
        if name.is_modulus or name.kind == "pair":
            log, u = log_of(problem, fitted, name)
            value = math.exp(log)
            unit = "Pa"
            if name.kind == "pair":
                own = next(s for s in problem.shots if s.pair == name.owner)
                unit = _STIFFNESS if own.mass_is_stated else _STIFFNESS_OVER_MASS
            found[name] = measurand(value, value * u, unit)
        elif name == SEEN:
            value, u = log_of(problem, fitted, name)
            found["rebound.seen_after_lift_off_s"] = measurand(
                value * 1e-3, u * 1e-3, "s", log=False
            )
    of_effects = effect_parameters_json(problem, fitted)
    return found | {name.key: value for name, value in of_effects.items()}


def effect_parameters_json(
    problem: JointProblem, fitted: Fitted
) -> dict[ParameterName, Json | None]:
    """Return the effects' numbers in their own units."""
    found: dict[ParameterName, Json | None] = {}
    for effect in problem.model.effects:
        for parameter in effect.parameters:
            for name in problem.names:
                if name.is_of(effect.id, parameter.name):
                    at, u = log_of(problem, fitted, name)
                    found[name] = measurand(
                        _value(parameter, at),
                        abs(parameter.slope(at)) * u,
                        parameter.unit,
                        interval=parameter.interval(at, K_95 * u),
                    )
    return found


def _value(parameter: EffectParameter, coordinate: float) -> float:
    """Return the value; infinite where the best estimate of its inverse has the wrong sign."""
    if parameter.form == "inverse" and parameter.low >= 0.0 and coordinate < 0.0:
        return math.inf
    return parameter.value(coordinate)
