"""A simulated campaign in the exchange format ``impactd-campaign/1``."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.campaign_settings import CampaignSettings
from drivers.simulated.flight import Flight
from drivers.simulated.label_spread import ROOM_K
from drivers.simulated.specimens import CellSpec, SurfaceSpec


def describe_shot(
    settings: CampaignSettings,
    flight: Flight,
    drop: tuple[str, str, float],
    codes: NDArray[np.int16],
    chance: tuple[int, int],
) -> dict[str, object]:
    """Return a shot's entry: what the technician knows of it.

    ``drop`` is sphere, surface and stated height [m]; the error of the measured rebound comes from
    the seed ``chance``.
    """
    sphere, surface, height = drop
    touch = flight.touches[0]
    slowed = settings.gravity_m_per_s2 * settings.restitution_seen_after_s
    measured = (touch.rebound_speed_m_per_s - slowed) / touch.speed_m_per_s
    measured += settings.restitution_u * np.random.default_rng([*chance, 120]).normal()
    return {
        "sphere": sphere,
        "surface": surface,
        "drop_height_m": _stated(settings, height, settings.spread.height_scatter_m),
        "file": f"shot{flight.shot.number:03d}.npy",
        "sample_rate_Hz": settings.sample_rate_hz,
        "volts_per_code": _volts_per_code(settings),
        "trigger_index": trigger_index(settings, codes),
        "restitution": {"value": round(float(measured), 4), "u": settings.restitution_u},
    }


def trigger_index(settings: CampaignSettings, codes: NDArray[np.int16]) -> int:
    """Return the first sample of a record beyond the trigger's level, above the baseline.

    ``settings.touch_at`` if there is none.
    """
    baseline = float(np.median(codes[: settings.touch_at // 2]))
    above = np.flatnonzero((codes - baseline) * _volts_per_code(settings) > settings.trigger_v)
    above = above[above >= settings.touch_at - 5]
    return int(above[0]) if above.size else settings.touch_at


def _volts_per_code(settings: CampaignSettings) -> float:
    return 2.0 * settings.range_v / (1 << settings.bits)


def _quantity(value: float, u: float) -> dict[str, float]:
    return {"value": value, "u": u}


def _stated(settings: CampaignSettings, value: float, u: float) -> float | dict[str, float]:
    """Return a quantity where its uncertainty is known and stated, else the plain number."""
    return _quantity(value, u) if u > 0.0 and settings.states_u else value


def _shared_uncertainties(settings: CampaignSettings) -> dict[str, object]:
    """Return what is stated of the time base and the room."""
    spread = settings.spread
    found: dict[str, object] = {}
    if spread.sample_rate_relative > 0.0:
        found["sample_rate_u_relative"] = spread.sample_rate_relative
    if spread.temperature_k > 0.0:
        celsius = round(ROOM_K - 273.15, 2)
        found["environment"] = {"temperature_C": _quantity(celsius, spread.temperature_k)}
    return found if settings.states_u else {}


def describe_campaign(
    settings: CampaignSettings,
    surfaces: Mapping[str, SurfaceSpec],
    cell: CellSpec,
    shots: list[dict[str, object]],
) -> dict[str, object]:
    """Return the campaign in the exchange format.

    ``surfaces`` include the specimen's drawn labels; ``shots`` are from `describe_shot` in order of
    time.
    """
    sensor = {
        "compliance_m_per_V": _quantity(cell.compliance_m_per_v, cell.compliance_u_m_per_v),
        "crystal_mass_kg": _quantity(cell.crystal_mass_kg, cell.crystal_mass_u_kg),
        "crystal_stiffness_N_per_m": _quantity(
            cell.crystal_stiffness_n_per_m, cell.crystal_stiffness_u_n_per_m
        ),
        "crystal_damping_N_s_per_m": _quantity(
            cell.crystal_damping_n_s_per_m, cell.crystal_damping_u_n_s_per_m
        ),
    }
    if settings.cell_model == "hsd":
        value = cell.hsd_n_per_v or cell.crystal_stiffness_n_per_m * cell.compliance_m_per_v
        sensor = {"hsd_N_per_V": _quantity(value, 0.1 * value)}
    spread = settings.spread
    release = {"speed_repeatability": settings.speed_repeatability}
    if spread.height_offset_m > 0.0 and settings.states_u:
        release["height_offset_u_m"] = spread.height_offset_m
    return {
        "format": "impactd-campaign/1",
        "gravity_m_per_s2": _stated(settings, settings.gravity_m_per_s2, spread.gravity_m_per_s2),
        "release": release,
        **_shared_uncertainties(settings),
        "sensor": sensor,
        "spheres": {
            name: {
                "radius_m": _stated(
                    settings, spec.radius_m, spread.radius_relative * spec.radius_m
                ),
                "mass_kg": _stated(settings, spec.mass_kg, spread.mass_relative * spec.mass_kg),
                "youngs_modulus_Pa": _quantity(spec.youngs_modulus_pa, spec.youngs_modulus_u_pa),
                "poissons_ratio": _quantity(spec.poissons_ratio, spec.poissons_ratio_u),
            }
            for name, spec in settings.spheres.items()
        },
        "surfaces": {
            name: {
                "youngs_modulus_Pa": None
                if spec.youngs_modulus_pa is None
                else _quantity(spec.youngs_modulus_pa, spec.youngs_modulus_u_pa),
                "poissons_ratio": _quantity(spec.poissons_ratio, spec.poissons_ratio_u),
                "coupon_mass_kg": _stated(
                    settings, spec.coupon_mass_kg, spread.coupon_mass_relative * spec.coupon_mass_kg
                ),
            }
            for name, spec in surfaces.items()
        },
        "shots": shots,
    }
