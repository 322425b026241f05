"""The spread of true values around what labels and settings state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from drivers.simulated.specimens import SphereSpec, SurfaceSpec

ROOM_K = 296.15
"""23 C, the standard atmosphere of ISO 291 in which polymers are tested."""


@dataclass(frozen=True)
class LabelSpread:
    """Standard uncertainties of what is stated; at zero the label is the truth."""

    radius_relative: float = 0.0
    """Of a sphere's radius: balls of one batch and one calliper, drawn once a sphere."""
    mass_relative: float = 0.0
    """Of a sphere's mass, drawn once each."""
    coupon_mass_relative: float = 0.0
    """Of a coupon's mass, drawn once each."""
    height_offset_m: float = 0.0
    """Of an offset that all drop heights share: the zero of the scale."""
    height_scatter_m: float = 0.0
    """Of each drop's height by itself: reading the scale, hanging the sphere."""
    sample_rate_relative: float = 0.0
    """Of the time base that all records share."""
    gravity_m_per_s2: float = 0.0
    temperature_k: float = 0.0
    """Of air and specimens."""


EXACT = LabelSpread()
TYPICAL = LabelSpread(
    # Calliper of 0.02 mm resolution and error limit 0.03 mm (DIN 862) on 9.52 mm: 0.03/sqrt(3) mm.
    # Balls of plastics are sold to +-0.025 to 0.05 mm; steel balls of ISO 3290-1, grade 100 or
    # better, vary by 5 um in a lot and are measured by that grade, not by a calliper.
    radius_relative=2e-3,
    # Balance of 0.1 mg: repeatability 0.1 mg, linearity 0.2 mg/sqrt(3), of 0.2 g to 1 g: 0.15 mg.
    mass_relative=5e-4,
    # Balance of 1 mg (kitchen of the laboratory) of 4 g to 8 g, and tape that comes off with it.
    coupon_mass_relative=1e-3,
    # Zero of a scale set by eye on a coupon: 0.5 mm/sqrt(3); depth gauge: ten times better.
    height_offset_m=3e-4,
    # Reading a scale of 0.5 mm divisions to a fifth, rectangular: 0.1 mm/sqrt(3), hanging alike.
    height_scatter_m=1e-4,
    # Crystal oscillator, +-50 ppm over temperature and age, rectangular: 29 ppm.
    sample_rate_relative=25e-6,
    # Gravity by latitude and height above the sea, no map of anomalies: 20 to 50 mgal.
    gravity_m_per_s2=3e-4,
    # Thermometer of 0.5 K and a room that is held to 1 K, rectangular.
    temperature_k=0.6,
)
"""What a careful laboratory without a metrology department has; coverage 1, all normal."""

SPREADS = {"exact": EXACT, "typical": TYPICAL}


@dataclass(frozen=True)
class TrueInputs:
    """What is true of all drops of a rig."""

    height_offset_m: float = 0.0
    """True less stated height."""
    height_scatter_m: float = 0.0
    """Standard deviation of each drop's own height."""
    sample_rate_factor: float = 1.0
    """True over stated sample rate."""
    temperature_k: float = ROOM_K

    def to_json(self) -> dict[str, float]:
        """Return them as the sealed truth states them."""
        return asdict(self)


EXACT_INPUTS = TrueInputs()


@dataclass(frozen=True)
class TrueLabels:
    """Labels with the true radii, masses and gravity."""

    spheres: Mapping[str, SphereSpec]
    surfaces: Mapping[str, SurfaceSpec]
    gravity_m_per_s2: float
    inputs: TrueInputs


def draw_true_labels(
    spread: LabelSpread,
    seed: int,
    spheres: Mapping[str, SphereSpec],
    surfaces: Mapping[str, SurfaceSpec],
    gravity_m_per_s2: float,
) -> TrueLabels:
    """Draw true values around the stated ones; with ``EXACT`` they are the labels themselves.

    The rig's seed gives the same deviations, in standard uncertainties, for every spread.
    """
    rng = np.random.default_rng([seed, 6])
    true_spheres = {}
    for name, sphere in spheres.items():
        z = rng.standard_normal(2)
        true_spheres[name] = replace(
            sphere,
            radius_m=sphere.radius_m * (1.0 + spread.radius_relative * float(z[0])),
            mass_kg=sphere.mass_kg * (1.0 + spread.mass_relative * float(z[1])),
        )
    true_surfaces = {}
    for name, surface in surfaces.items():
        factor = 1.0 + spread.coupon_mass_relative * float(rng.standard_normal())
        true_surfaces[name] = replace(surface, coupon_mass_kg=surface.coupon_mass_kg * factor)
    z = rng.standard_normal(4)
    return TrueLabels(
        spheres=true_spheres,
        surfaces=true_surfaces,
        gravity_m_per_s2=gravity_m_per_s2 + spread.gravity_m_per_s2 * float(z[0]),
        inputs=TrueInputs(
            height_offset_m=spread.height_offset_m * float(z[1]),
            height_scatter_m=spread.height_scatter_m,
            sample_rate_factor=1.0 + spread.sample_rate_relative * float(z[2]),
            temperature_k=ROOM_K + spread.temperature_k * float(z[3]),
        ),
    )
