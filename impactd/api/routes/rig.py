"""The rig: what may be asked of it."""

from __future__ import annotations

import shutil
from dataclasses import asdict

from fastapi import APIRouter

from impactd.api.security import TheDaemon
from impactd.wire.health_answers import Device, Disk, NoiseTrend, RigCheck, RigHealth
from impactd.wire.model_answers import RigAnswer

router = APIRouter(prefix="/v1/rig", tags=["rig"])


@router.get("")
def rig(daemon: TheDaemon) -> RigAnswer:
    """Say which spheres, surfaces and heights a drop may name, and what a calibration drops."""
    settings, materials = daemon.settings, daemon.materials
    found = {
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
    return RigAnswer.model_validate(found)


_TREND_SHOTS = 200
"""Shots of the noise's trend: some days of work."""


@router.get("/health")
def health(daemon: TheDaemon) -> RigHealth:
    """Show what the rig was found like: its checks, gauge, devices, disk, noise and calibration.

    The gain's trend is the `series` of `GET /v1/calibrations`.
    """
    settings, status = daemon.settings, daemon.service.status()
    free = daemon.archive.free_bytes()
    each = 2 * round(settings.trigger.record_s * settings.digitizer.sample_rate_hz)
    noise = daemon.archive.fits.noise_of_newest(_TREND_SHOTS)
    return RigHealth(
        sentence=status.sentence,
        attention=status.attention,
        checks=[RigCheck(**asdict(check)) for check in status.checks],
        devices=[
            Device(name=check.name, sentence=check.sentence, answers=check.ok)
            for check in status.checks
            if check.name in {"digitizer", "valve"}
        ],
        disk=Disk(
            free_bytes=free + daemon.archive.reserve_bytes,
            reserve_bytes=daemon.archive.reserve_bytes,
            total_bytes=shutil.disk_usage(daemon.archive.directory).total,
            shots_left=max(0, free) // each,
        ),
        noise=NoiseTrend(
            numbers=[number for number, _, _ in noise],
            started_utc=[started for _, started, _ in noise],
            noise_rms_V=[value for _, _, value in noise],
            highest_allowed_V=settings.preflight.noise_max_v,
        ),
        calibration=asdict(status.calibration),
        valve_has_gauge=settings.valve.adc_channel is not None,
    )
