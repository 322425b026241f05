"""The uncertainty budgets of a network of moduli: ``impactd-budget/1`` over many shots' fits.

As for a joint fit, the covariance is the sum of what its sources contribute: stated moduli,
masses and radii, each calibration of the cell, and what every recording has for itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from analysis.aliases import Array, Json
from analysis.budget import Budget, budgets_of, by_material
from analysis.budget_sources import INPUT_LABELS, Source, of_moduli
from analysis.campaign import Sphere, Surface, Uncertainty
from analysis.fit.inputs import LINEAR
from analysis.fit.priors import UNKNOWN_LOG_U
from analysis.moduli import Adjustment
from analysis.moduli_network import linearise_rows
from analysis.parameters import ParameterName, input_in_document

CERTIFICATE = "certificate"
"""What a calibration is called that is none: the cell's certificate."""
_OF_SPHERE = {"mass": "mass_kg", "radius": "radius_m"}
_OF_SURFACE = {"coupon_mass": "coupon_mass_kg", "coupon_thickness": "coupon_thickness_m"}
_OF_RIG = {
    "height_offset": ("release.height_offset_u_m", "m", 1e-3),
    "time_base": ("sample_rate_u_relative", "1", 1.0),
    "gravity": ("gravity_m_per_s2", "1", 1.0),
    "air_resistance": ("air_resistance", "1", 1.0),
    "converter_gain": ("volts_per_code", "1", 1.0),
}
"""Where a campaign states it, unit of its uncertainty, and that unit over the coordinate's."""


def network_budgets(adjustment: Adjustment) -> list[Budget]:
    """Return the budgets of all moduli that a network states.

    In the order of the materials; withheld moduli have none. Source: JCGM 100 (GUM) 5.1.
    Validation: the contributions' squares against the covariance, one pair's rows against
    ``uncertainties``, and the whole against sampled networks in
    ``tests/analysis/test_moduli_budget.py``.
    """
    result = adjustment.result
    logs = dict(zip(result.names, result.log_plane_strain.tolist(), strict=True))
    made = budgets_of(
        logs, adjustment.covariance, _sources(adjustment), result.spheres, result.surfaces
    )
    return [b for b in made if result.why_withheld(b.name, result.plane_strain(b.name)[1]) is None]


def network_budgets_json(adjustment: Adjustment) -> Json:
    """Return the budgets as ``impactd-budget/1``, by material and modulus."""
    return by_material(network_budgets(adjustment), adjustment.result.names)


def _sources(adjustment: Adjustment) -> list[Source]:
    result, system, covariance = adjustment.result, adjustment.system, adjustment.covariance
    known = result.spheres, result.surfaces
    found = [s for _, s in of_moduli(system.names, system.precision, covariance, *known)]
    unknown = [j for j, prior in enumerate(system.priors) if prior is None]
    if unknown:
        column = covariance[:, unknown] / UNKNOWN_LOG_U
        label = "start values of what nothing is known about"
        said = Uncertainty(UNKNOWN_LOG_U)
        found.append(Source("unknown", label, None, said, "1", True, True, column))
    found.append(_of_calibrations(adjustment))
    first = covariance.shape[0] - len(system.inputs)
    for j, name in enumerate(system.inputs, start=first):
        # an input's error is counted in its own standard uncertainties
        column = covariance[:, [j]] * math.sqrt(float(system.precision[j, j]))
        told = adjustment.input_u.get(name)
        found.append(_of_input(input_in_document(name), told, column, *known))
    found.extend(_of_recordings(adjustment))
    return found


def _of_calibrations(adjustment: Adjustment) -> Source:
    """Return all calibrations as one source: each has errors of its own, which it keeps."""
    system, covariance = adjustment.system, adjustment.covariance
    spread = []
    for block in system.blocks:
        own = block.columns[: block.columns.size - len(system.inputs)]
        # a block's columns count among the errors, which follow the materials
        own = own + len(system.names)
        spread.append(covariance[:, own] @ np.linalg.cholesky(system.precision[np.ix_(own, own)]))
    made = [f"calibration {one}" for one in system.calibrations if one not in ("", CERTIFICATE)]
    remedy, told = "Calibrate the load cell", "certificate"
    if made:
        remedy += " with more drops, or with better known references"
        told = made[0] if len(made) == 1 else f"{len(made)} calibrations"
    label = f"load cell, by its {told}" if not made else f"load cell, {told}"
    said = Uncertainty(1.0, traceable_to=told)
    return Source("sensor", label, None, said, "1", True, True, np.hstack(spread), remedy=remedy)


def _of_input(
    name: ParameterName,
    u: float | None,
    column: Array,
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
) -> Source:
    """Return a stated input as a source; ``u`` is of the coordinate that the fits took."""
    kind, owner = name.quantity, name.owner
    label = INPUT_LABELS.get(kind, kind).format(owner)
    path, unit, scale = _OF_RIG.get(kind, (name, "1", 1.0))
    value: float | None = 1.0 if kind in ("time_base", "converter_gain", "air_resistance") else None
    said = Uncertainty(math.nan if u is None else u * scale)
    material: Sphere | Surface | None = None
    stated: ParameterName | None = None
    if kind in _OF_SPHERE:
        material, key, side = spheres.get(owner), _OF_SPHERE[kind], "spheres"
    elif kind in _OF_SURFACE:
        material, key, side = surfaces.get(owner), _OF_SURFACE[kind], "surfaces"
    if material is not None:
        path, unit, stated = f"{side}.{owner}.{key}", key.rpartition("_")[2], name
        value, said = getattr(material, key), _as_stated(material, key, u)
    relative = kind not in LINEAR
    return Source(path, label, value, said, unit, relative, True, column, stated=stated)


def _as_stated(material: Sphere | Surface, key: str, u: float | None) -> Uncertainty:
    """Return an input's uncertainty; distribution and source only where today's is what fits took.

    Materials are those of today, fits may be older.
    """
    value = getattr(material, key)
    today: Uncertainty | None = getattr(material, f"u_{key}")
    if not value:
        return Uncertainty(math.nan)
    if u is None:
        return today or Uncertainty(math.nan)
    if today is not None and math.isclose(today.u, u * value, rel_tol=1e-6):
        return today
    return Uncertainty(u * value)


def _of_recordings(adjustment: Adjustment) -> Iterator[Source]:
    """Yield the random part of each recording, as its fit stated it and as it was increased."""
    system, covariance, n = adjustment.system, adjustment.covariance, len(adjustment.result.names)
    own, dark = np.zeros((2, n, n))
    at = np.concatenate([adjustment.result.log_plane_strain, np.zeros(covariance.shape[0] - n)])
    for block, design in linearise_rows(system, at):
        weight = system.weight[block.rows]
        reach = design @ covariance[:, :n]
        stated = weight * adjustment.random_share[block.rows]
        own += reach.T @ (stated[:, None] * reach)
        dark += reach.T @ ((weight - stated)[:, None] * reach)
    shots = len(adjustment.result.shots)
    u = math.sqrt(float(np.median(adjustment.random_share / system.weight)))
    label = f"noise and scatter of the single shots ({shots})"
    yield _repeated("noise", label, Uncertainty(u), own)
    if adjustment.result.dark_u > 0:
        freedom = float(max(adjustment.result.network.degrees_of_freedom, 1))
        said = Uncertainty(adjustment.result.dark_u, degrees_of_freedom=freedom)
        added = _repeated("disagreement", "disagreement between recordings, added", said, dark)
        yield replace(added, remedy="Find out why the recordings do not fit together, by diagnosis")


def _repeated(name: str, label: str, said: Uncertainty, square: Array) -> Source:
    """Return a source of recordings from what it adds to the materials' covariance."""
    values, vectors = np.linalg.eigh(square)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return Source(name, label, None, said, "1", True, False, root)
