"""The limits between which a number of a campaign can lie, each with its reason.

The limits are far outside what any rig measures. They keep out what arithmetic cannot carry: a
squared 1e308 is infinite, and the inverse of a subnormal number, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

RELATIVE_RESOLUTION = 1e-12
"""Smallest uncertainty beside its value. Doubles carry 16 digits; what a computation leaves of them
is 12, so a smaller uncertainty cannot be told from none, and its inverse square overflows. [1]"""


@dataclass(frozen=True)
class Range:
    """Closed limits of a number."""

    low: float
    high: float
    unit: str = "1"
    """Of both limits, as messages write it."""

    def __str__(self) -> str:
        return f"between {self.low:g} and {with_unit(self.high, self.unit)}"


def with_unit(number: float, unit: str) -> str:
    """Return a number with its unit, as messages write it; a pure number has none."""
    return f"{number:g}" if unit == "1" else f"{number:g} {unit}"


# Slower than 1 Hz no impact is seen; no converter of such resolution is faster than 1 GHz.
SAMPLE_RATE_HZ = Range(1.0, 1e9, "Hz")
SAMPLE_RATE_U_HZ = Range(0.0, 1e9, "Hz")
# A number known worse than to itself is not known.
RELATIVE_U = Range(0.0, 1.0)
# One reading too many tells of scatter; nobody takes more than 1e12.
DEGREES_OF_FREEDOM = Range(1.0, 1e12)
# A step below 1e-15 V is under the thermal noise of one ohm in one hertz (1.3e-10 V); newtons and
# m/s^2 share the key. A step above the limit would leave SIGNAL with the code 1.
PER_CODE = Range(1e-15, 1e9, "of its unit")
# 1e9 V exceed any conditioner, 1e9 N any load cell, 1e9 m/s^2 what leaves a sphere whole.
SIGNAL = Range(-1e9, 1e9, "of its unit")
# From an asteroid to a centrifuge.
GRAVITY_M_PER_S2 = Range(1e-4, 1e4, "m/s^2")
REPEATABILITY = Range(0.0, 1.0)
# Lower than a micrometre a fall is shorter than the sphere's deformation; 100 m is a drop tower.
DROP_HEIGHT_M = Range(1e-6, 100.0, "m")
HEIGHT_OFFSET_U_M = Range(0.0, 100.0, "m")
# Of an impact that comes back at all, and none comes back faster than it went.
RESTITUTION = Range(1e-6, 1.0)
# From a grain of dust to a wrecking ball; the masses are those of such spheres.
RADIUS_M = Range(1e-6, 10.0, "m")
MASS_KG = Range(1e-15, 1e6, "kg")
# The lightest balloon has 0.2 kg/m^3, osmium has 22600.
DENSITY_KG_PER_M3 = Range(0.1, 3e4, "kg/m^3")
THICKNESS_M = Range(1e-9, 10.0, "m")
# The softest gels have 1 Pa, diamond has 1.2e12 Pa.
YOUNGS_MODULUS_PA = Range(1e-1, 1e14, "Pa")
# Thermodynamics allows -1 to 0.5. At -1 itself the shear modulus would be infinite.
POISSONS_RATIO = Range(-0.999, 0.5)
# Piezoelectric cells have 1e-10 to 1e-7 m/V, 1e-3 to 1 kg, 1e7 to 1e10 N/m, 1 to 1e4 N.s/m and
# 1e-1 to 1e4 N/V. Six orders of magnitude on either side let other cells and toy units through.
COMPLIANCE_M_PER_V = Range(1e-16, 1e-1, "m/V")
CRYSTAL_MASS_KG = Range(1e-9, 1e6, "kg")
CRYSTAL_STIFFNESS_N_PER_M = Range(1e1, 1e16, "N/m")
CRYSTAL_DAMPING_N_S_PER_M = Range(1e-6, 1e10, "N s/m")
HSD_N_PER_V = Range(1e-7, 1e10, "N/V")
# Variances of logarithms: 1e6 is a factor of e^1000, beyond what a double holds.
LOG_COVARIANCE = Range(-1e6, 1e6)
# A change of a logarithm by one u; its square is a part of a variance within LOG_COVARIANCE.
CALIBRATION_INPUT = Range(-1e3, 1e3)
# From absolute zero to where no coupon is solid.
TEMPERATURE_C = Range(-273.15, 5e3, "degC")
# A modulus that changes by its own size in ten kelvins is in a transition, and has no coefficient.
MODULUS_COEFFICIENT_PER_K = Range(-0.1, 0.1, "1/K")
RELATIVE_HUMIDITY = Range(0.0, 1.0)


def impossible_density(radius_m: float | None, mass_kg: float | None) -> str | None:
    """Return what is wrong with a sphere whose density no material has, ``None`` otherwise.

    Both values are within their own ranges; one in millimetres or grams is found only beside the
    other. The text fits into the middle of a sentence.
    """
    if radius_m is None or mass_kg is None:
        return None
    density = mass_kg / (4.0 / 3.0 * math.pi * radius_m**3)
    if DENSITY_KG_PER_M3.low <= density <= DENSITY_KG_PER_M3.high:
        return None
    return (
        f"is {mass_kg:g} kg beside a radius of {radius_m:g} m: that is {density:.3g} kg/m^3, and a "
        f"sphere has {DENSITY_KG_PER_M3}. Give the radius in metres and the mass in kilograms."
    )
