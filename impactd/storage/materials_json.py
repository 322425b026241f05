"""Spheres, surfaces and the load cell as JSON, in the keys of ``impactd-campaign/1``.

Campaign folders and shot files both use it, so what a shot file says of its sphere can be pasted
into a campaign.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from analysis.campaign import (
    STATED_AT_C,
    Environment,
    Quantity,
    Sensor,
    Sphere,
    Surface,
    Uncertainty,
)
from impactd.aliases import Json
from impactd.storage import ranges
from impactd.storage.json_fields import Fields

MODULUS_KEYS = (
    "youngs_modulus_Pa",
    "poissons_ratio",
    "modulus_coefficient_per_K",
    "modulus_temperature_C",
)
SPHERE_KEYS = ("radius_m", "mass_kg", *MODULUS_KEYS)
SURFACE_KEYS = (*MODULUS_KEYS, "coupon_mass_kg", "coupon_thickness_m")
SENSOR_KEYS = (
    "compliance_m_per_V",
    "crystal_mass_kg",
    "crystal_stiffness_N_per_m",
    "crystal_damping_N_s_per_m",
    "hsd_N_per_V",
    "log_covariance",
    "calibration_inputs",
    "hsd_calibration_inputs",
)
ENVIRONMENT_KEYS = ("temperature_C", "relative_humidity")
LOG_PARAMETERS = 4


def quantity_to_json(quantity: Quantity | None) -> dict[str, float] | None:
    """Return ``{"value", "u"}``, ``None`` for ``None``."""
    return None if quantity is None else {"value": quantity.value, "u": quantity.u}


def measured_to_json(value: float | None, known: Uncertainty | None) -> Json | float | None:
    """Return a number, or ``{"value", "u", ...}`` where its uncertainty is known."""
    if value is None or known is None:
        return value
    found: Json = {"value": value, "u": known.u}
    if known.distribution != "normal":
        found["distribution"] = known.distribution
    if math.isfinite(known.degrees_of_freedom):
        found["degrees_of_freedom"] = known.degrees_of_freedom
    if known.traceable_to is not None:
        found["traceable_to"] = known.traceable_to
    return found


def environment_from_json(fields: Fields) -> Environment | None:
    """Return the environment of the rig, ``None`` where nothing is said."""
    found = Environment(
        fields.quantity("temperature_C", ranges.TEMPERATURE_C),
        fields.quantity("relative_humidity", ranges.RELATIVE_HUMIDITY),
    )
    return None if found == Environment() else found


def environment_to_json(environment: Environment | None) -> Json | None:
    """Return an environment in the keys of the campaign format, ``None`` for ``None``."""
    if environment is None:
        return None
    found = {
        "temperature_C": quantity_to_json(environment.temperature_c),
        "relative_humidity": quantity_to_json(environment.relative_humidity),
    }
    return {key: value for key, value in found.items() if value is not None}


def environment_from_text(text: str | None) -> Environment | None:
    """Return the environment of a column of the index, ``None`` for ``None``."""
    if text is None:
        return None
    return environment_from_json(Fields(json.loads(text), file="index", known=ENVIRONMENT_KEYS))


def environment_to_text(environment: Environment | None) -> str | None:
    """Return an environment for a column of the index, ``None`` for ``None``."""
    found = environment_to_json(environment)
    return None if found is None else json.dumps(found, allow_nan=False)


def sphere_to_json(sphere: Sphere) -> dict[str, Any]:
    """Return a sphere in the keys of the campaign format; its name is the key it stands under."""
    return {
        "radius_m": measured_to_json(sphere.radius_m, sphere.u_radius_m),
        "mass_kg": measured_to_json(sphere.mass_kg, sphere.u_mass_kg),
        "youngs_modulus_Pa": quantity_to_json(sphere.youngs_modulus_pa),
        "poissons_ratio": quantity_to_json(sphere.poissons_ratio),
        **_coefficient_to_json(sphere),
    }


def _coefficient_to_json(material: Sphere | Surface) -> dict[str, Any]:
    """Return how a stated modulus follows the temperature; nothing where nobody said."""
    if material.modulus_coefficient_per_k is None:
        return {}
    return {
        "modulus_coefficient_per_K": quantity_to_json(material.modulus_coefficient_per_k),
        "modulus_temperature_C": material.modulus_temperature_c,
    }


def surface_to_json(surface: Surface) -> dict[str, Any]:
    """Return a surface in the keys of the campaign format; its name is the key it stands under."""
    return {
        "youngs_modulus_Pa": quantity_to_json(surface.youngs_modulus_pa),
        "poissons_ratio": quantity_to_json(surface.poissons_ratio),
        "coupon_mass_kg": measured_to_json(surface.coupon_mass_kg, surface.u_coupon_mass_kg),
        "coupon_thickness_m": measured_to_json(
            surface.coupon_thickness_m, surface.u_coupon_thickness_m
        ),
        **_coefficient_to_json(surface),
    }


def sensor_to_json(sensor: Sensor) -> dict[str, Any]:
    """Return what is known of the load cell, unknown keys left out."""
    known = {
        "compliance_m_per_V": quantity_to_json(sensor.compliance_m_per_v),
        "crystal_mass_kg": quantity_to_json(sensor.crystal_mass_kg),
        "crystal_stiffness_N_per_m": quantity_to_json(sensor.crystal_stiffness_n_per_m),
        "crystal_damping_N_s_per_m": quantity_to_json(sensor.crystal_damping_n_s_per_m),
        "hsd_N_per_V": quantity_to_json(sensor.hsd_n_per_v),
        "log_covariance": None if sensor.covariance is None else sensor.covariance.tolist(),
        "calibration_inputs": {key: list(one) for key, one in sensor.inputs.items()} or None,
        "hsd_calibration_inputs": dict(sensor.hsd_inputs) or None,
    }
    return {key: value for key, value in known.items() if value is not None}


def sphere_from_json(name: str, fields: Fields) -> Sphere:
    """Return a sphere; raise CampaignError at the first impossible value."""
    radius_m, u_radius_m = fields.measured("radius_m", ranges.RADIUS_M)
    mass_kg, u_mass_kg = fields.measured("mass_kg", ranges.MASS_KG)
    return Sphere(
        name=name,
        radius_m=radius_m,
        mass_kg=mass_kg,
        youngs_modulus_pa=fields.quantity("youngs_modulus_Pa", ranges.YOUNGS_MODULUS_PA),
        poissons_ratio=fields.quantity("poissons_ratio", ranges.POISSONS_RATIO),
        u_radius_m=u_radius_m,
        u_mass_kg=u_mass_kg,
        modulus_coefficient_per_k=_coefficient(fields),
        modulus_temperature_c=_stated_at(fields),
    )


def surface_from_json(name: str, fields: Fields) -> Surface:
    """Return a surface; raise CampaignError at the first impossible value."""
    mass_kg, u_mass_kg = fields.measured("coupon_mass_kg", ranges.MASS_KG)
    thickness_m, u_thickness_m = fields.measured("coupon_thickness_m", ranges.THICKNESS_M)
    return Surface(
        name=name,
        youngs_modulus_pa=fields.quantity("youngs_modulus_Pa", ranges.YOUNGS_MODULUS_PA),
        poissons_ratio=fields.quantity("poissons_ratio", ranges.POISSONS_RATIO),
        coupon_mass_kg=mass_kg,
        coupon_thickness_m=thickness_m,
        u_coupon_mass_kg=u_mass_kg,
        u_coupon_thickness_m=u_thickness_m,
        modulus_coefficient_per_k=_coefficient(fields),
        modulus_temperature_c=_stated_at(fields),
    )


def _coefficient(fields: Fields) -> Quantity | None:
    return fields.quantity("modulus_coefficient_per_K", ranges.MODULUS_COEFFICIENT_PER_K)


def _stated_at(fields: Fields) -> float:
    found = fields.number("modulus_temperature_C", ranges.TEMPERATURE_C)
    return STATED_AT_C if found is None else found


def sensor_from_json(fields: Fields) -> Sensor:
    """Return what is known of the load cell; raise CampaignError at the first impossible value.

    ``log_covariance`` (4 x 4, of the logarithms of M, k, mu, c) is this program's addition to the
    campaign format: a calibration fixes the four together. So are ``calibration_inputs`` (by input,
    their change by one u of a mass, radius or the like) and ``hsd_calibration_inputs``.
    """
    covariance = None
    if fields.has("log_covariance"):
        try:
            covariance = np.asarray(fields.array("log_covariance"), dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            fields.refuse("log_covariance", "must hold numbers only, in rows of equal length.")
        if covariance.shape != (LOG_PARAMETERS, LOG_PARAMETERS):
            fields.refuse("log_covariance", f"has shape {covariance.shape}; it must be (4, 4).")
        if not np.all(np.isfinite(covariance)):
            fields.refuse("log_covariance", "must hold finite numbers only.")
        if np.any(np.abs(covariance) > ranges.LOG_COVARIANCE.high):
            limits = f"each must be {ranges.LOG_COVARIANCE}"
            fields.refuse("log_covariance", f"holds {np.abs(covariance).max():g}; {limits}.")
    return Sensor(
        compliance_m_per_v=fields.quantity("compliance_m_per_V", ranges.COMPLIANCE_M_PER_V),
        crystal_mass_kg=fields.quantity("crystal_mass_kg", ranges.CRYSTAL_MASS_KG),
        crystal_stiffness_n_per_m=fields.quantity(
            "crystal_stiffness_N_per_m", ranges.CRYSTAL_STIFFNESS_N_PER_M
        ),
        crystal_damping_n_s_per_m=fields.quantity(
            "crystal_damping_N_s_per_m", ranges.CRYSTAL_DAMPING_N_S_PER_M
        ),
        hsd_n_per_v=fields.quantity("hsd_N_per_V", ranges.HSD_N_PER_V),
        covariance=covariance,
        inputs=_calibration_inputs(fields) if covariance is not None else {},
        hsd_inputs=_gain_inputs(fields.child("hsd_calibration_inputs")),
    )


def _gain_inputs(group: Fields) -> dict[str, float]:
    known = {key: group.number(key, ranges.CALIBRATION_INPUT) for key in group.names()}
    return {key: value for key, value in known.items() if value is not None}


def _calibration_inputs(fields: Fields) -> dict[str, tuple[float, ...]]:
    """Return how the four logarithms of a calibration follow each input that it rests on."""
    group, found = fields.child("calibration_inputs"), {}
    for key in group.names():
        values = group.array(key)
        if len(values) != LOG_PARAMETERS or not all(_is_change(one) for one in values):
            limits = f"four numbers {ranges.CALIBRATION_INPUT}"
            group.refuse(key, f"must be {limits}: the changes of ln M, k, mu and c.")
        found[key] = tuple(float(one) for one in values)
    return found


def _is_change(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return ranges.CALIBRATION_INPUT.low <= value <= ranges.CALIBRATION_INPUT.high
