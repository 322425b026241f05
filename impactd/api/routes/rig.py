"""The rig: what may be asked of it."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from impactd.api.security import TheDaemon

router = APIRouter(prefix="/v1/rig", tags=["rig"])


@router.get("")
def rig(daemon: TheDaemon) -> dict[str, Any]:
    """Say which spheres, surfaces and heights a drop may name, and what a calibration drops."""
    settings, materials = daemon.settings, daemon.materials
    return {
        "name": daemon.rig.name,
        "simulated": daemon.rig.simulated,
        "spheres": [
            {
                "name": name,
                "diameter_m": None if one.radius_m is None else 2 * one.radius_m,
                "mass_kg": one.mass_kg,
                "reference": name in materials.reference_spheres,
            }
            for name, one in materials.spheres.items()
        ],
        "surfaces": [
            {"name": name, "reference": name in materials.reference_surfaces}
            for name in materials.surfaces
        ],
        "min_drop_height_m": settings.rig.min_drop_height_m,
        "max_drop_height_m": settings.rig.max_drop_height_m,
        "record_s": settings.trigger.record_s,
        "loading_s": settings.timeouts.loading_s,
        "calibration_plan": [one.model_dump(mode="json") for one in settings.calibration.plan],
        "remind_days": settings.calibration.remind_days,
    }
