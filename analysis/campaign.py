"""A campaign: recordings of impacts and what is known about them, in memory.

Nothing here reads a file; ``impactd.storage.campaign_folder`` does and builds these values.
``None`` always means "unknown", never "zero".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

STATED_AT_C = 23.0
"""Temperature of data sheets of plastics: the standard atmosphere of ISO 291. [degC]"""


@dataclass(frozen=True)
class Quantity:
    """A value with its standard uncertainty, in the unit its owner's name states."""

    value: float
    u: float


UNKNOWN_POISSONS_RATIO = Quantity(0.35, 0.1)
"""What a Poisson's ratio counts as that nobody states."""


@dataclass(frozen=True)
class Uncertainty:
    """The uncertainty of a stated number; the number itself is a separate field."""

    u: float
    """Standard uncertainty, >= 0, in the unit of the number."""
    distribution: str = "normal"
    """``normal`` or ``rectangular``; a rectangle's half-width is sqrt(3) u."""
    degrees_of_freedom: float = math.inf
    """Of ``u``; infinite where it is not an estimate from repetitions."""
    traceable_to: str | None = None
    """A certificate, a standard, an instrument."""


@dataclass(frozen=True)
class Sensor:
    """What is known of the load cell before a fit (a certificate or a calibration).

    Attributes
    ----------
    compliance_m_per_v : Quantity or None
        Crystal compression per volt, c of Eq. 11. [m/V]
    crystal_mass_kg, crystal_stiffness_n_per_m, crystal_damping_n_s_per_m : Quantity or None
        M, k and mu of Eq. 8-10.
    hsd_n_per_v : Quantity or None
        S of Eq. 7 for the rigid-cell model. [N/V]
    covariance : ndarray or None, shape (4, 4)
        Covariance of the logarithms of (M, k, mu, c) when a calibration fixed them together;
        replaces the four ``u``. [1]
    inputs : mapping of str to tuple of float
        Change of the logarithms of (M, k, mu, c) by one u of each mass, radius and the like that
        the calibration rests on, by the input's name as in ``analysis.fit.inputs``. A shot of the
        same sphere shares that error, which is part of ``covariance``.
    hsd_inputs : mapping of str to float
        The same of the logarithm of S.
    """

    compliance_m_per_v: Quantity | None = None
    crystal_mass_kg: Quantity | None = None
    crystal_stiffness_n_per_m: Quantity | None = None
    crystal_damping_n_s_per_m: Quantity | None = None
    hsd_n_per_v: Quantity | None = None
    covariance: NDArray[np.float64] | None = None
    inputs: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    hsd_inputs: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Sphere:
    """A sphere. All SI; a ``None`` modulus is to be found, one with a value is a prior.

    A number without its ``u_`` counts as exact. ``modulus_coefficient_per_k`` is the relative
    change of the stated modulus by a kelvin, from ``modulus_temperature_c`` on. [1/K], [degC]
    """

    name: str
    radius_m: float | None = None
    mass_kg: float | None = None
    youngs_modulus_pa: Quantity | None = None
    poissons_ratio: Quantity | None = None
    u_radius_m: Uncertainty | None = None
    u_mass_kg: Uncertainty | None = None
    modulus_coefficient_per_k: Quantity | None = None
    modulus_temperature_c: float = STATED_AT_C


@dataclass(frozen=True)
class Surface:
    """A coupon. All SI; a ``None`` modulus is to be found, one with a value is a prior.

    A number without its ``u_`` counts as exact; the modulus' coefficient is as a sphere's.
    """

    name: str
    youngs_modulus_pa: Quantity | None = None
    poissons_ratio: Quantity | None = None
    coupon_mass_kg: float | None = None
    coupon_thickness_m: float | None = None
    u_coupon_mass_kg: Uncertainty | None = None
    u_coupon_thickness_m: Uncertainty | None = None
    modulus_coefficient_per_k: Quantity | None = None
    modulus_temperature_c: float = STATED_AT_C


@dataclass(frozen=True)
class Environment:
    """What it was like around the rig; the temperature moves stated moduli with a coefficient."""

    temperature_c: Quantity | None = None
    relative_humidity: Quantity | None = None

    def completed_by(self, other: Environment | None) -> Environment:
        """Return the same, with the other's reading wherever this has none."""
        if other is None:
            return self
        return Environment(
            self.temperature_c or other.temperature_c,
            self.relative_humidity or other.relative_humidity,
        )


@dataclass(frozen=True)
class Shot:
    """One recorded impact.

    Attributes
    ----------
    name : str
        How messages call it (a file name or ``"shot 17"``).
    signal : ndarray, shape (n,)
        Volts, or newtons, or m/s^2 as ``quantity`` says.
    trigger_index : int
        Sample near the first touch; 0 <= trigger_index < n.
    quantity : str
        ``voltage``, ``force_N`` or ``acceleration_m_per_s2``.
    sphere, surface : str or None
        Keys into the campaign's materials.
    restitution : Quantity or None
        Rebound speed of the sphere over its impact speed. [1]
    quantum : float or None
        Step of the converter in the unit of ``signal``.
    impact_speed_m_per_s : Quantity or None
        As measured, e.g. from the flight before a bounce; counts instead of the drop height. [m/s]
    clipped : bool
        The record sits on a limit of converter or amplifier; kept, and flagged.
    code_zero : float
        What the converter's code 0 stands for, in the unit of ``signal``.
    u_drop_height_m : Uncertainty or None
        Of this height alone, independent of the other shots'. [m]
    u_sample_rate_hz : Uncertainty or None
        Of the time base, which all shots of a campaign share. [Hz]
    u_gain_relative : float
        Of the converter's volts per code, which all shots of a campaign share. [1]
    path : str
        Where a campaign file tells of it (``$.shots[3]``); empty for what stands in none.
    """

    name: str
    signal: NDArray[np.float64]
    sample_rate_hz: float
    trigger_index: int
    quantity: str = "voltage"
    sphere: str | None = None
    surface: str | None = None
    drop_height_m: float | None = None
    restitution: Quantity | None = None
    quantum: float | None = None
    clipped: bool = False
    impact_speed_m_per_s: Quantity | None = None
    code_zero: float = 0.0
    u_drop_height_m: Uncertainty | None = None
    u_sample_rate_hz: Uncertainty | None = None
    u_gain_relative: float = 0.0
    environment: Environment | None = None
    path: str = ""


def shot_words(place: int, name: str) -> str:
    """Return a shot's name within a sentence: ``shot 17 (a.npy)``, or its number in the archive.

    ``place`` counts from 0 in the campaign. The archive's names begin with ``shot``, and a place
    beside them would mislead.
    """
    return name if name.startswith("shot ") else f"shot {place} ({name})"


@dataclass(frozen=True)
class Rejected:
    """A recording that was refused, and why."""

    name: str
    path: str
    reason: str


@dataclass(frozen=True)
class Campaign:
    """Recordings that share a rig.

    Attributes
    ----------
    shots : tuple of Shot
        In order of time.
    sensor : Sensor
        Prior knowledge of the load cell.
    speed_repeatability : float or None
        Relative standard deviation of the impact speed from shot to shot. [1]
    u_height_offset_m : Uncertainty or None
        Of an offset that all drop heights share, of best estimate 0. [m]
    u_sample_rate_relative : Uncertainty or None
        Of a time base that all shots share; counts instead of the shots' own. [1]
    environment : Environment or None
        Of the whole campaign.
    assumptions : tuple of str
        What was taken to be so on the way in, in words; every result tells it.
    """

    shots: tuple[Shot, ...]
    spheres: dict[str, Sphere] = field(default_factory=dict)
    surfaces: dict[str, Surface] = field(default_factory=dict)
    sensor: Sensor = field(default_factory=Sensor)
    gravity_m_per_s2: float = 9.80665
    speed_repeatability: float | None = None
    rejected: tuple[Rejected, ...] = ()
    u_gravity_m_per_s2: Uncertainty | None = None
    u_height_offset_m: Uncertainty | None = None
    u_sample_rate_relative: Uncertainty | None = None
    environment: Environment | None = None
    assumptions: tuple[str, ...] = ()
