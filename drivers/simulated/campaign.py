"""Whole campaigns as arrays, without transports, for coverage and blind trials.

The same rig, effects and integrator as `World`, in the shape of the exchange format
``impactd-campaign/1``: a dictionary, one array of codes per shot, and the truth apart from both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.campaign_format import describe_campaign, describe_shot
from drivers.simulated.campaign_settings import CampaignSettings
from drivers.simulated.converter import CODES, Board, coarser, quantise
from drivers.simulated.draw import draw_rig
from drivers.simulated.drawn_rig import DrawnRig
from drivers.simulated.drops import Drops, draw_drops
from drivers.simulated.effects import Shot
from drivers.simulated.flight import Flight, begin_flight, render_flight
from drivers.simulated.impact import simulate_impact
from drivers.simulated.noise import NoiseSettings, noise_record, noise_table
from drivers.simulated.specimens import SPECIMEN, CellSpec, SurfaceSpec

__all__ = [
    "CampaignSettings",
    "draw_certificate",
    "simulate_campaign",
    "simulate_drops",
    "write_campaign_folder",
]


def simulate_campaign(settings: CampaignSettings, seed: int) -> dict[str, Any]:
    """Simulate a campaign; same settings and seed, same campaign to the last code.

    ``campaign`` is the ``impactd-campaign/1`` dictionary, ready for JSON; ``codes`` a list of int16
    arrays of shape (samples,), one per shot in the campaign's order; ``truth`` what the rig truly
    was, ready for JSON. A ValueError says that an effect and the cell's model do not go together.
    """
    drops = draw_drops(settings, seed)
    return simulate_drops(settings, drops, draw_certificate(settings, drops, seed), seed)


def draw_certificate(settings: CampaignSettings, drops: Drops, seed: int) -> CellSpec:
    """Return the cell's certificate, its compliance chosen where ``settings.fill`` asks for it.

    It is ``settings.cell`` itself without ``fill``.
    """
    if settings.fill is None:
        return settings.cell
    rig = _draw(settings, drops.surfaces, settings.cell, seed)
    return _fitting_cell(settings, rig, max(height for _, _, height in drops.in_order))


def simulate_drops(
    settings: CampaignSettings, drops: Drops, cell: CellSpec, seed: int
) -> dict[str, Any]:
    """Simulate drops that are already drawn, as `simulate_campaign` returns them."""
    rig = _draw(settings, drops.surfaces, cell, seed)
    shots, codes, flights = [], [], []
    for number, drop in enumerate(drops.in_order):
        flight, volts = _record(settings, rig, drop, number, seed)
        flights.append(flight)
        row = _convert(volts, settings, rig)
        codes.append(row)
        shots.append(describe_shot(settings, flight, drop, row, (seed, number)))
    return {
        "campaign": describe_campaign(settings, drops.surfaces, cell, shots),
        "codes": codes,
        "truth": _truth(settings, rig, flights),
    }


def write_campaign_folder(folder: Path, simulated: Mapping[str, Any]) -> Path:
    """Write a simulated campaign as a folder of the exchange format; return its ``campaign.json``.

    The folder is created if need be; the truth goes into its ``truth.json``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for shot, codes in zip(simulated["campaign"]["shots"], simulated["codes"], strict=True):
        np.save(folder / shot["file"], codes)
    (folder / "truth.json").write_text(json.dumps(simulated["truth"], indent=1, allow_nan=False))
    path = folder / "campaign.json"
    path.write_text(json.dumps(simulated["campaign"], indent=1, allow_nan=False))
    return path


def _draw(
    settings: CampaignSettings, surfaces: Mapping[str, SurfaceSpec], cell: CellSpec, seed: int
) -> DrawnRig:
    return draw_rig(
        seed,
        settings.spheres,
        surfaces,
        cell,
        settings.effects,
        restitution_scatter=settings.restitution_scatter,
        gravity_m_per_s2=settings.gravity_m_per_s2,
        rigid_cell=settings.cell_model == "hsd",
        exact=settings.exact,
        rig=settings.rig,
        spread=settings.spread,
    )


def _fitting_cell(settings: CampaignSettings, rig: DrawnRig, height_m: float) -> CellSpec:
    """Return the certificate with the compliance that lets the tallest pulse fill the range."""
    bare = replace(rig, effects=())
    speed = math.sqrt(2.0 * settings.gravity_m_per_s2 * height_m)
    tallest = 0.0
    for sphere in settings.spheres:
        for surface in rig.surface_specs:
            rng = np.random.default_rng(0)
            shot = Shot(0, sphere, surface, height_m, rng)
            impact = simulate_impact(bare.mechanics(shot, speed, rng), speed, points=1)
            squeeze = impact.peak_force_n / rig.cell.crystal_stiffness_n_per_m
            tallest = max(tallest, impact.peak_compression_m, squeeze)
    compliance = tallest / ((settings.fill or 0.85) * settings.range_v)
    relative_u = settings.cell.compliance_u_m_per_v / settings.cell.compliance_m_per_v
    return replace(
        settings.cell, compliance_m_per_v=compliance, compliance_u_m_per_v=relative_u * compliance
    )


def _record(
    settings: CampaignSettings,
    rig: DrawnRig,
    drop: tuple[str, str, float],
    number: int,
    seed: int,
) -> tuple[Flight, NDArray[np.float64]]:
    """Return one flight and the voltage of its record, noise and hum included."""
    sphere, surface, height = drop
    chance = (seed, 110, number)
    rng = np.random.default_rng(chance)
    shot = Shot(number, sphere, surface, height, np.random.default_rng(0))
    flight = begin_flight(rig, shot, 0.0, settings.speed_repeatability, chance)
    rate_hz = settings.sample_rate_hz * rig.inputs.sample_rate_factor
    start_s = flight.landing_s - (settings.touch_at + rng.random()) / rate_hz
    stop_s = start_s + settings.samples / rate_hz
    volts = _noise(settings.noise, settings, rng)
    volts += settings.baseline_scatter_v * rng.standard_normal()
    for piece in render_flight(rig, flight, start_s, rate_hz, until_s=stop_s):
        a, b = max(piece.first, 0), min(piece.first + piece.volts.size, settings.samples)
        volts[a:b] += piece.volts[a - piece.first : b - piece.first]
    # Minutes pass between drops: the mains has any phase.
    t = rng.uniform(0.0, 1e3) + np.arange(settings.samples) / rate_hz
    for effect in rig.effects:
        hum = effect.ambient(t)
        if hum is not None:
            volts += hum
    return flight, volts


def _noise(
    noise: NoiseSettings, settings: CampaignSettings, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return a record's noise; one with a 1/f part is cut out of a far longer table."""
    if noise.pink_corner_hz == 0.0:
        return noise_record(noise, settings.samples, rng)
    longer = 16 * settings.samples
    table = noise_table(noise, longer, settings.sample_rate_hz, rng)
    return table[: settings.samples].astype(np.float64)


def _convert(
    volts: NDArray[np.float64], settings: CampaignSettings, rig: DrawnRig
) -> NDArray[np.int16]:
    """Return the record as its converter writes it: one code a step of its own resolution."""
    codes = quantise(volts, Board(settings.range_v))
    for effect in rig.effects:
        conversion = effect.conversion()
        if conversion is not None:
            codes = conversion[codes]
    signed = codes.astype(np.int32) - CODES // 2
    return coarser(signed, settings.bits).astype(np.int16)


def _truth(
    settings: CampaignSettings, rig: DrawnRig, flights: Sequence[Flight]
) -> dict[str, object]:
    truth = rig.truth()
    if SPECIMEN in rig.surface_solids:
        solid = rig.surface_solids[SPECIMEN]
        truth["specimen_youngs_modulus_Pa"] = solid.youngs_modulus_pa
    truth["bits"] = settings.bits
    truth["noise_ar1"] = settings.noise.ar1
    truth["noise_rms_V"] = settings.noise.rms_v
    truth["shots"] = [
        {
            "true_drop_height_m": flight.shot.drop_height_m,
            "reduced_modulus_Pa": rig.reduced_modulus_pa(flight.shot.sphere, flight.shot.surface),
            **asdict(flight.touches[0]),
        }
        for flight in flights
    ]
    return truth
