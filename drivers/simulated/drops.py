"""The list of drops: sphere, surface and height, in order of time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drivers.simulated.campaign_settings import CampaignSettings
from drivers.simulated.specimens import SPECIMEN, SurfaceSpec


@dataclass(frozen=True)
class Drops:
    """What will fall on what, before any rig is drawn."""

    surfaces: Mapping[str, SurfaceSpec]
    """Labels by name, the specimen's drawn ones included."""
    in_order: tuple[tuple[str, str, float], ...]
    """Sphere, surface and stated height [m] of each drop, in order of time."""


def draw_drops(settings: CampaignSettings, seed: int) -> Drops:
    """Draw the specimen's labels, the heights and the order of the drops.

    Each sphere falls on each surface from each height, ``repeats`` times.
    """
    rng = np.random.default_rng([seed, 100])
    surfaces = {
        name: _random_specimen(spec, rng) if name == SPECIMEN and not settings.exact else spec
        for name, spec in settings.surfaces.items()
    }
    heights = [h * math.exp(rng.uniform(-0.06, 0.06)) for h in settings.drop_heights_m]
    plan = [(s, c, h) for s in settings.spheres for c in surfaces for h in heights]
    plan *= settings.repeats
    return Drops(surfaces, tuple(plan[place] for place in rng.permutation(len(plan))))


def _random_specimen(spec: SurfaceSpec, rng: np.random.Generator) -> SurfaceSpec:
    ratio = round(float(rng.uniform(0.33, 0.42)), 2)
    return replace(spec, poissons_ratio=ratio, coupon_mass_kg=float(rng.uniform(2.5e-3, 5e-3)))
