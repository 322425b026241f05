"""The nomenclature of the analysis: meaning, unit, name in the code and source of every symbol.

Equation numbers are those of Maranzano & Hancock 2016 (see ``analysis/README.md``). Positive means
compression for indentation, crystal and force, and downwards for speeds of the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Term:
    """One quantity."""

    symbol: str
    name: str
    """As the code calls it where it crosses a function boundary."""
    unit: str
    """SI; ``1`` for a ratio."""
    meaning: str
    source: str
    """Equation of the paper, or another origin."""


GLOSSARY: tuple[Term, ...] = (
    # -- materials and sphere
    Term("E", "youngs_modulus_pa", "Pa", "Young's modulus of a material", "Eq. 4"),
    Term("nu", "poissons_ratio", "1", "Poisson's ratio; no normal impact can tell it", "Eq. 4"),
    Term("E'", "plane_strain_modulus", "Pa", "plane-strain modulus, E / (1 - nu^2)", "Eq. 4"),
    Term("E*", "reduced_modulus_pa", "Pa", "modulus of a pair, 1/E* = 1/E'_1 + 1/E'_2", "Eq. 4"),
    Term("R", "radius_m", "m", "radius of the sphere", "Table 1"),
    Term("m", "mass_kg", "kg", "mass of the sphere", "Table 1"),
    # -- release
    Term("h", "drop_height_m", "m", "sphere above coupon before release", "section 2"),
    Term("g", "gravity_m_per_s2", "m/s^2", "local gravity", "setting"),
    Term("v0", "impact_speed_m_per_s", "m/s", "speed at touch-down, sqrt(2 g h)", "section 2"),
    Term("t0", "t0_us", "us", "touch-down after the fit window's first sample", "fitted"),
    # -- contact
    Term("delta", "indentation_m", "m", "approach of sphere and coupon since touch-down", "Eq. 1"),
    Term("K", "stiffness", "N m^-1.5", "Hertz's stiffness, 4/3 sqrt(R) E*", "Eq. 4"),
    Term("F_el", "elastic force", "N", "K delta^1.5", "Eq. 2"),
    Term("F_dis", "dissipative force", "N", "alpha sqrt(m K) delta^0.25 delta'", "Eq. 3"),
    Term("alpha", "alpha", "1", "dashpot coefficient of a restitution", "Eq. 5"),
    Term("eps", "ln_e", "1", "rebound over impact rate of indentation, rigid cell", "Eq. 6"),
    Term(
        "eps_r", "restitution", "1", "sphere's rebound over impact speed, as one sees it", "bounce"
    ),
    Term("t_c", "contact_time_s", "s", "from touch-down to lift-off", "Johnson, Eq. 11.24"),
    Term("T", "flight time", "s", "from lift-off to the next touch-down, 2 v_r / g", "bounce"),
    Term("y, s", "y, s", "m^0.25, s m^-0.75", "delta^0.25 and dt = y^3 ds", "solver's change"),
    # -- cell
    Term("Delta", "crystal compression", "m", "compression of the crystal", "Eq. 8"),
    Term("M", "crystal_mass_kg", "kg", "mass of the crystal", "Eq. 8"),
    Term("k", "crystal_stiffness_n_per_m", "N/m", "stiffness of the crystal", "Eq. 9"),
    Term("mu", "crystal_damping_n_s_per_m", "N s/m", "damping of the crystal", "Eq. 10"),
    Term("c", "compliance_m_per_v", "m/V", "crystal compression per volt", "Eq. 11"),
    Term("S", "ln_S", "N/V", "gain: k c for KV, Eq. 7's factor for HSD", "Eq. 7"),
    Term("omega0", "omega0_rad_per_s", "rad/s", "crystal's frequency, sqrt(k/M)", "from Eq. 8-10"),
    Term("zeta", "ln_z", "1", "damping ratio, mu / (2 sqrt(k M))", "from Eq. 8-10"),
    # -- fit
    Term("theta", "theta", "1", "logarithms shared by all shots of a campaign", "fit"),
    Term("u", "u", "as its value", "standard uncertainty", "GUM"),
    Term("U", "expanded", "as its value", "expanded uncertainty, 1.96 u, coverage 95 %", "GUM"),
    Term("chi2", "chi2", "1", "sum of squares of whitened residuals", "fit"),
    Term("a_j", "coefficients", "1", "autoregressive coefficients of the noise", "noise"),
)


def term(symbol: str) -> Term:
    """Return the entry of a symbol of `GLOSSARY`."""
    for entry in GLOSSARY:
        if entry.symbol == symbol:
            return entry
    raise KeyError(symbol)
