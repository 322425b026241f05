"""One simulated impact: from bodies and speed to the crystal's trace."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulated import impact_kernel as kernel

TOLERANCE = 1e-10


@dataclass(frozen=True)
class ContactTerm:
    """An additional force law, by its code in the kernel and its numbers."""

    code: int
    values: tuple[float, ...]
    """In the kernel's order. [SI]"""


@dataclass
class Mechanics:
    """Everything mechanical about one impact; effects change it before it is integrated."""

    sphere_mass_kg: float
    """m."""
    sphere_radius_m: float
    """R."""
    reduced_modulus_pa: float
    """E*, 1/E* being the sum of (1 - nu^2)/E over both bodies."""
    restitution: float
    """eps of Eq. 6, in (0, 1]."""
    gravity_m_per_s2: float
    cell_mass_kg: float
    """M of Eq. 8-10."""
    cell_stiffness_n_per_m: float
    """k."""
    cell_damping_n_s_per_m: float
    """mu."""
    rigid: bool = False
    """The cell does not move (HSD); the force is read directly."""
    dashpot_share: float = 0.0
    """Part of the dissipative force that loads the crystal where ``third_law`` is off. [1]"""
    third_law: bool = False
    """The whole force of contact loads the crystal, or is what a rigid cell reads."""
    coupon_rides: bool = False
    """The part of the coupon that does not move on its tape adds its mass to the crystal's."""
    lift_off_rule: int = kernel.AT_INDENTATION
    """Where contact ends, by the kernel's names."""
    loss_law: int = kernel.TSUJI
    """The base law of the loss, by the kernel's names."""
    loss_constant: float | None = None
    """Constant of another base law of loss than Tsuji's, whose alpha follows from ``restitution``:
    A of Kuwabara and Kono [s], chi of Hunt and Crossley [s/m]."""
    coupon_label_mass_kg: float = 0.0
    """Mass of the coupon that lies there, whether it moves on its tape or not."""
    coupon_plane_strain_modulus_pa: float = math.inf
    """E/(1 - nu^2) of the coupon, for laws that concern it alone."""
    coupon_poissons_ratio: float = 0.35
    """nu of the coupon, for the same laws."""
    coupon_mass_kg: float = 0.0
    """A coupon on its adhesive; 0 means glued rigidly."""
    layer_stiffness_n_per_m: float = 0.0
    layer_damping_n_s_per_m: float = 0.0
    base_mass_kg: float = 0.0
    """The stand below the cell; 0 means it does not move."""
    base_stiffness_n_per_m: float = 0.0
    base_damping_n_s_per_m: float = 0.0
    mode_mass_kg: float = 0.0
    """An oscillator on the crystal's top; 0 means none."""
    mode_angular_frequency_rad_per_s: float = 0.0
    mode_damping_ratio: float = 0.0
    mode_stretched_ratio: float = 1.0
    """Stiffness of its spring when stretched over that when pushed."""
    plate_impedance_n_s_per_m: float = 0.0
    """Z of the receding plate; 0 means it does not recede."""
    tension_stiffness_ratio: float = 1.0
    """Stiffness of the cell's seat in tension over that in compression."""
    cell_hardening_per_m: float = 0.0
    """Relative growth of the cell's stiffness with its compression."""
    rubbing_n: float = 0.0
    """Dry friction on the crystal's top."""
    layer_hardening_per_m: float = 0.0
    """Relative growth of the adhesive's stiffness with its compression."""
    inner_mass_share: float = 0.0
    """Part of the sphere's mass on a spring inside it; 0 means a solid sphere."""
    inner_angular_frequency_rad_per_s: float = 0.0
    inner_damping_ratio: float = 0.0
    damping_growth_per_m: float = 0.0
    """Relative growth of the cell's damping with the size of its compression."""
    base_friction_n: float = 0.0
    """Dry friction of the stand on what it stands on."""
    law: int = kernel.HERTZ
    """Base elastic law of the kernel."""
    law_value: float = 0.0
    """Its parameter. [SI]"""
    recontact_delay_s: float = 0.0
    """Of a second touch; 0 means none."""
    recontact_speed_m_per_s: float = 0.0
    terms: list[ContactTerm] = field(default_factory=list)
    """Additional force laws, at most ``impact_kernel.TERMS``."""

    @property
    def contact_stiffness(self) -> float:
        """Return K of Eq. 4. [N/m^1.5]"""
        return 4.0 / 3.0 * math.sqrt(self.sphere_radius_m) * self.reduced_modulus_pa

    @property
    def loss_coefficient(self) -> float:
        """Return alpha of Eq. 5 (Antypov & Elliott 2011), or the constant of another law."""
        if self.loss_constant is not None:
            return self.loss_constant
        log = math.log(self.restitution)
        return -math.sqrt(5.0) * log / math.hypot(log, math.pi)

    @property
    def loaded_cell_mass_kg(self) -> float:
        """Return the crystal's mass with what rides on it. [kg]"""
        if not self.coupon_rides:
            return self.cell_mass_kg
        return self.cell_mass_kg + max(self.coupon_label_mass_kg - self.coupon_mass_kg, 0.0)

    def vector(self) -> NDArray[np.float64]:
        """Return the constants in the kernel's order. [SI]"""
        p = np.zeros(kernel.PARAMETERS)
        p[: kernel.PARAMETERS] = (
            self.sphere_mass_kg,
            self.contact_stiffness,
            self.loss_coefficient,
            self.gravity_m_per_s2,
            self.loaded_cell_mass_kg,
            self.cell_stiffness_n_per_m,
            self.cell_damping_n_s_per_m,
            float(self.rigid),
            self.dashpot_share,
            self.coupon_mass_kg,
            self.layer_stiffness_n_per_m,
            self.layer_damping_n_s_per_m,
            self.base_mass_kg,
            self.base_stiffness_n_per_m,
            self.base_damping_n_s_per_m,
            self.mode_mass_kg,
            self.mode_angular_frequency_rad_per_s,
            self.mode_damping_ratio,
            self.plate_impedance_n_s_per_m,
            self.tension_stiffness_ratio,
            float(self.law),
            self.law_value,
            self.sphere_radius_m,
            self.reduced_modulus_pa,
            self.recontact_delay_s,
            self.recontact_speed_m_per_s,
            self.mode_stretched_ratio,
            self.cell_hardening_per_m,
            self.rubbing_n,
            self.layer_hardening_per_m,
            self.inner_mass_share,
            self.inner_angular_frequency_rad_per_s,
            self.inner_damping_ratio,
            self.damping_growth_per_m,
            self.base_friction_n,
            float(self.third_law),
            float(self.lift_off_rule),
            float(self.loss_law),
        )
        return p


@dataclass(frozen=True)
class ImpactTrace:
    """The result of one impact."""

    compression_m: NDArray[np.float64]
    """Crystal compression on the grid; zero before touch-down and after the ring died."""
    elastic_force_n: NDArray[np.float64]
    """Force that a rigid cell reads, on the grid: the elastic one, or with the third law all of it;
    filled for a rigid cell only."""
    rebound_speed_m_per_s: float
    """Upwards at the first lift-off; 0 when the sphere never left."""
    contact_time_s: float
    """First lift-off after touch-down."""
    peak_force_n: float
    """The peaks are the largest values at the integrator's steps."""
    peak_indentation_m: float
    peak_compression_m: float
    ended_s: float
    """When the ring was below one millionth of its peak."""
    steps: int
    """Of the integrator."""
    lift_off_force_n: float
    """Of contact, at the first lift-off."""
    lift_off_indentation_m: float
    lift_off_place_m: float
    """How far below the place of touch-down the sphere is then."""


class IntegrationError(RuntimeError):
    """The settings of an impact are beyond what the simulator can integrate."""


def simulate_impact(
    mechanics: Mechanics,
    speed_m_per_s: float,
    *,
    first_s: float = 0.0,
    step_s: float = 1e-6,
    points: int = 4000,
    tolerance: float = TOLERANCE,
) -> ImpactTrace:
    """Integrate one impact from touch-down and sample it on a regular grid.

    The grid begins ``first_s`` after touch-down, which may be negative. The tolerance is the
    relative one of the step control; an IntegrationError says that this gives up. A speed that is
    not positive or too many contact effects at once are a ValueError.
    """
    if not speed_m_per_s > 0.0:
        raise ValueError(f"An impact needs a speed above zero, not {speed_m_per_s} m/s.")
    if len(mechanics.terms) > kernel.TERMS:
        raise ValueError(
            f"{len(mechanics.terms)} contact effects at once; the simulator follows at most "
            f"{kernel.TERMS}. Switch some of them off."
        )
    codes = np.zeros(kernel.TERMS, dtype=np.int64)
    values = np.zeros((kernel.TERMS, kernel.VALUES))
    for i, term in enumerate(mechanics.terms):
        codes[i] = term.code
        values[i, : len(term.values)] = term.values
    compression, force = np.zeros(points), np.zeros(points)
    summary: NDArray[Any] = kernel.integrate(
        float(speed_m_per_s),
        mechanics.vector(),
        codes,
        values,
        float(tolerance),
        float(first_s),
        float(step_s),
        compression,
        force,
    )
    if summary[kernel.STATUS] == kernel.TOO_MANY_STEPS:
        raise IntegrationError(
            f"The impact at {speed_m_per_s:.3g} m/s needed more than 400000 steps; an effect's "
            "parameter is far outside its usual size."
        )
    return ImpactTrace(
        compression_m=compression,
        elastic_force_n=force,
        rebound_speed_m_per_s=max(float(summary[kernel.REBOUND]), 0.0),
        contact_time_s=float(summary[kernel.LIFT_OFF]),
        peak_force_n=float(summary[kernel.FORCE_PEAK]),
        peak_indentation_m=float(summary[kernel.INDENTATION_PEAK]),
        peak_compression_m=float(summary[kernel.COMPRESSION_PEAK]),
        ended_s=float(summary[kernel.END]),
        steps=int(summary[kernel.STEPS]),
        lift_off_force_n=float(summary[kernel.LIFT_OFF_FORCE]),
        lift_off_indentation_m=float(summary[kernel.LIFT_OFF_DEPTH]),
        lift_off_place_m=float(summary[kernel.LIFT_OFF_PLACE]),
    )
