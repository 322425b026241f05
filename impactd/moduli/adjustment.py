"""The adjustment of an archive's moduli, with what is known of its calibrations."""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactd.moduli.observations import CERTIFICATE, ShotUse
from impactd.settings.materials import Materials
from impactd.storage.archive import Archive

if TYPE_CHECKING:
    from analysis import PairObservation
    from analysis.moduli import Adjustment

RIGID_CELL_MODEL = "hsd"


def adjusted(
    archive: Archive, materials: Materials, observations: list[PairObservation], model: str
) -> Adjustment:
    """Return the network of an archive's observations (at least one), adjusted."""
    from analysis.moduli import adjust_network

    covariances: dict[str, NDArray[np.float64]] = {}
    calibrated_by: dict[str, dict[str, NDArray[np.float64]]] = {}
    for name in {one.calibration for one in observations}:
        covariance = _cell_covariance(archive, name, model)
        if covariance is not None:
            covariances[name] = covariance
            calibrated_by[name] = _calibration_inputs(archive, name, model)
    return adjust_network(
        observations, materials.spheres, materials.surfaces, covariances, calibrated_by
    )


def at_temperature(
    materials: Materials, uses: Iterable[ShotUse]
) -> tuple[Materials, tuple[str, ...]]:
    """Return materials with their stated moduli at the temperature of the shots that take part.

    They are the same object where no coefficient is stated. The sentences say what had to be
    assumed.
    """
    from analysis.temperature import Landing, spheres_at, surfaces_at

    landings = [
        Landing(one.observation.sphere, one.observation.surface, one.temperature_c)
        for one in uses
        if one.observation is not None
    ]
    spheres, of_spheres = spheres_at(materials.spheres, landings)
    surfaces, of_surfaces = surfaces_at(materials.surfaces, landings)
    if spheres is materials.spheres and surfaces is materials.surfaces:
        return materials, ()
    moved = replace(materials, spheres=dict(spheres), surfaces=dict(surfaces))
    return moved, (*of_spheres, *of_surfaces)


def calibrations_of_other_bases(
    archive: Archive, observations: Iterable[PairObservation], model: str
) -> list[str]:
    """Return a warning for each calibration whose cell belongs to another base model.

    ``kv`` counts the coupons of the calibration among the crystal's mass, ``kv2`` does not.
    """
    base = model.partition("+")[0]
    if base == RIGID_CELL_MODEL:  # every calibration finds its constant too
        return []
    found = []
    for name in sorted({one.calibration for one in observations} - {CERTIFICATE}, key=int):
        of = str((archive.calibrations.get(int(name)).result or {}).get("model", base))
        if of.partition("+")[0] != base:
            found.append(
                f"Calibration {name} was made with {of}; its load cell is not valid for fits with "
                f"{model}. Calibrate again with {model} active, then run: impactd refit."
            )
    return found


def _cell_covariance(archive: Archive, name: str, model: str) -> NDArray[np.float64] | None:
    """Return the covariance that the fits' sensitivities refer to, ``None`` to use their own u."""
    if name == CERTIFICATE:
        return None
    calibration = archive.calibrations.get(int(name))
    if calibration.result is None:
        return None
    from analysis import sensor_from_json

    sensor = sensor_from_json(calibration.result)
    if model.partition("+")[0] != RIGID_CELL_MODEL:
        return sensor.covariance
    gain = sensor.hsd_n_per_v
    return None if gain is None else np.array([[(gain.u / gain.value) ** 2]])


def _calibration_inputs(archive: Archive, name: str, model: str) -> dict[str, NDArray[np.float64]]:
    """Return how a calibration depends on the masses, radii and heights that it was made with."""
    result = archive.calibrations.get(int(name)).result or {}
    if model.partition("+")[0] == RIGID_CELL_MODEL:
        result = result.get("hsd") or {}
    # calibrations of earlier versions took every stated number as exact
    return {key: np.array(one) for key, one in (result.get("inputs") or {}).items()}
