"""The simulated laboratory's spheres, surfaces and load cell, as their labels state."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SphereSpec:
    """A sphere as its label describes it; a ``_u`` is the standard deviation of the true value."""

    radius_m: float
    mass_kg: float
    youngs_modulus_pa: float
    youngs_modulus_u_pa: float
    poissons_ratio: float
    poissons_ratio_u: float = 0.01


@dataclass(frozen=True)
class SurfaceSpec:
    """A coupon as its label describes it; a ``_u`` is the standard deviation of the true value."""

    youngs_modulus_pa: float | None
    """``None``: unknown, drawn from 0.5 to 10 GPa."""
    youngs_modulus_u_pa: float
    poissons_ratio: float
    poissons_ratio_u: float = 0.01
    coupon_mass_kg: float = 0.004


@dataclass(frozen=True)
class CellSpec:
    """The load cell as its certificate describes it, values and standard deviations."""

    compliance_m_per_v: float = 1.2e-8
    """c of Eq. 11."""
    compliance_u_m_per_v: float = 3.6e-10
    crystal_mass_kg: float = 35.4e-3
    """M."""
    crystal_mass_u_kg: float = 3.1e-3
    crystal_stiffness_n_per_m: float = 0.416e9
    """k."""
    crystal_stiffness_u_n_per_m: float = 0.042e9
    crystal_damping_n_s_per_m: float = 560.0
    """mu."""
    crystal_damping_u_n_s_per_m: float = 60.0
    hsd_n_per_v: float | None = None
    """S of Eq. 7 for a rigid cell; ``None`` takes k c."""


def _sphere(radius_m: float, mass_kg: float, e_pa: float, nu: float) -> SphereSpec:
    return SphereSpec(radius_m, mass_kg, e_pa, 0.02 * e_pa, nu)


# Table 1 of the paper; where it gives a range of moduli, its middle. The small acetal sphere is
# the one of the example campaigns.
SPHERES: dict[str, SphereSpec] = {
    "steel": _sphere(2.99e-3, 0.8780e-3, 194e9, 0.33),
    "acetal": _sphere(4.76e-3, 0.6116e-3, 3.15e9, 0.35),
    "acetal_small": _sphere(3.175e-3, 0.1895e-3, 3.15e9, 0.35),
    "polypropylene": _sphere(4.76e-3, 0.4024e-3, 3.15e9, 0.38),
    "hdpe": _sphere(4.76e-3, 0.4232e-3, 1.08e9, 0.35),
    "ptfe": _sphere(4.76e-3, 0.9692e-3, 0.5e9, 0.46),
    "neoprene": _sphere(3.18e-3, 0.1981e-3, 0.082e9, 0.499),
}

SPECIMEN = "specimen"
"""Name of the surface whose modulus is sought."""

SURFACES: dict[str, SurfaceSpec] = {
    "aluminium": SurfaceSpec(69e9, 1e9, 0.33, coupon_mass_kg=8.1e-3),
    "polycarbonate": SurfaceSpec(2.2e9, 5e7, 0.37, coupon_mass_kg=3.6e-3),
    "pvc": SurfaceSpec(3.25e9, 6.5e7, 0.395, coupon_mass_kg=4.2e-3),
    "ptfe": SurfaceSpec(0.5e9, 1e7, 0.46, coupon_mass_kg=6.5e-3),
    SPECIMEN: SurfaceSpec(None, 0.0, 0.37, 0.02, coupon_mass_kg=3.8e-3),
}
