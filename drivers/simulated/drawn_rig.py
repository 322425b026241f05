"""The rig as it truly is: everything the labels do not say, drawn once from a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.simulated.effects import EFFECTS, INVENTED, LIBRARY, Effect, Scope, Shot, make_effect
from drivers.simulated.impact import Mechanics
from drivers.simulated.specimens import CellSpec, SphereSpec, SurfaceSpec

OUTSIDE_LIBRARY_SHARE = 0.25


@dataclass(frozen=True)
class Solid:
    """True elastic constants of one body.

    Attributes
    ----------
    youngs_modulus_pa, poissons_ratio : float
        E [Pa] and nu [1].
    """

    youngs_modulus_pa: float
    poissons_ratio: float

    @property
    def plane_strain_modulus_pa(self) -> float:
        """Return E / (1 - nu^2). [Pa]"""
        return self.youngs_modulus_pa / (1.0 - self.poissons_ratio**2)


@dataclass(frozen=True)
class TrueCell:
    """The load cell as it truly is.

    Attributes
    ----------
    compliance_m_per_v, crystal_mass_kg : float
        c [m/V] and M [kg].
    crystal_stiffness_n_per_m, crystal_damping_n_s_per_m : float
        k [N/m] and mu [N s/m].
    hsd_n_per_v : float
        S of Eq. 7, used when the cell is rigid. [N/V]
    rigid : bool
        The cell does not move (HSD).
    """

    compliance_m_per_v: float
    crystal_mass_kg: float
    crystal_stiffness_n_per_m: float
    crystal_damping_n_s_per_m: float
    hsd_n_per_v: float
    rigid: bool = False


def draw_effect(
    rng: np.random.Generator,
    spheres: Sequence[str] = (),
    surfaces: Sequence[str] = (),
    *,
    rigid_cell: bool = False,
) -> Effect:
    """Return one effect of random kind, size and scope; one in four from outside the library.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance.
    spheres, surfaces : sequence of str
        Materials an effect may be restricted to; none means it acts everywhere.
    rigid_cell : bool
        Whether the base cell is rigid; only then ``crystal_dynamics`` is a candidate.

    Returns
    -------
    Effect
        The draw.
    """
    outside = rng.random() < OUTSIDE_LIBRARY_SHARE
    pool = dict(INVENTED if outside else LIBRARY)
    if not rigid_cell:
        pool.pop("crystal_dynamics", None)
    kind = EFFECTS[str(rng.choice(sorted(pool)))]
    scope = Scope()
    if kind.per_material and rng.random() < 0.4:
        side = rng.integers(2)
        if side == 0 and spheres:
            scope = Scope(sphere=str(rng.choice(list(spheres))))
        elif surfaces:
            scope = Scope(surface=str(rng.choice(list(surfaces))))
    return kind(kind.draw(rng), scope)


def draw_solid(
    spec: SphereSpec | SurfaceSpec, rng: np.random.Generator, *, exact: bool = False
) -> Solid:
    """Return a body's true constants: around its label, or anywhere when the label is blank.

    Parameters
    ----------
    spec : SphereSpec or SurfaceSpec
        The label.
    rng : numpy.random.Generator
        Source of chance.
    exact : bool
        Take the label at its word.

    Returns
    -------
    Solid
        The truth.
    """
    z_modulus, z_ratio, log_e = rng.standard_normal(), rng.standard_normal(), rng.uniform()
    if spec.youngs_modulus_pa is None:
        modulus = math.exp(math.log(0.5e9) + log_e * math.log(20.0))
    else:
        modulus = spec.youngs_modulus_pa + (0.0 if exact else z_modulus * spec.youngs_modulus_u_pa)
    ratio = spec.poissons_ratio + (0.0 if exact else z_ratio * spec.poissons_ratio_u)
    return Solid(modulus, min(ratio, 0.4999))


def draw_cell(
    spec: CellSpec, rng: np.random.Generator, *, exact: bool = False, rigid: bool = False
) -> TrueCell:
    """Return the true load cell, drawn around its certificate.

    Parameters
    ----------
    spec : CellSpec
        The certificate.
    rng : numpy.random.Generator
        Source of chance.
    exact : bool
        Take the certificate at its word.
    rigid : bool
        Whether the cell is rigid (HSD).

    Returns
    -------
    TrueCell
        The truth.
    """
    pairs = (
        (spec.compliance_m_per_v, spec.compliance_u_m_per_v),
        (spec.crystal_mass_kg, spec.crystal_mass_u_kg),
        (spec.crystal_stiffness_n_per_m, spec.crystal_stiffness_u_n_per_m),
        (spec.crystal_damping_n_s_per_m, spec.crystal_damping_u_n_s_per_m),
    )
    # No certificate is three standard uncertainties off: such a cell goes back to its maker.
    z = np.clip(rng.standard_normal(4), -3.0, 3.0) * (0.0 if exact else 1.0)
    c, M, k, mu = (value + float(z[i]) * u for i, (value, u) in enumerate(pairs))
    return TrueCell(c, M, k, mu, k * c if spec.hsd_n_per_v is None else spec.hsd_n_per_v, rigid)


@dataclass(frozen=True)
class DrawnRig:
    """Truth of one rig.

    Attributes
    ----------
    sphere_specs, surface_specs : Mapping
        The labels by name.
    sphere_solids, surface_solids : Mapping
        The true constants by name.
    cell : TrueCell
        The true cell.
    restitution : Mapping
        eps of Eq. 6 at 0.77 m/s by (sphere, surface). [1]
    restitution_slope : float
        ``eps ~ speed^slope``. [1]
    restitution_scatter : float
        Standard deviation of eps from impact to impact. [1]
    effects : tuple of Effect
        What acts.
    gravity_m_per_s2 : float
        [m/s^2]
    """

    sphere_specs: Mapping[str, SphereSpec]
    surface_specs: Mapping[str, SurfaceSpec]
    sphere_solids: Mapping[str, Solid]
    surface_solids: Mapping[str, Solid]
    cell: TrueCell
    restitution: Mapping[tuple[str, str], float]
    restitution_slope: float
    restitution_scatter: float
    effects: tuple[Effect, ...]
    gravity_m_per_s2: float

    def acting(self, sphere: str, surface: str) -> list[Effect]:
        """Return the effects that concern a pair, in the order of the chain.

        Parameters
        ----------
        sphere, surface : str
            The pair.

        Returns
        -------
        list of Effect
            Those whose scope includes it.
        """
        here = [e for e in self.effects if e.scope.includes(sphere, surface)]
        return sorted(here, key=lambda e: e.order)

    def reduced_modulus_pa(self, sphere: str, surface: str) -> float:
        """Return E*, 1/E* = sum of (1 - nu^2)/E. [Pa]

        Parameters
        ----------
        sphere, surface : str
            The pair.

        Returns
        -------
        float
            E*. [Pa]
        """
        a = self.sphere_solids[sphere].plane_strain_modulus_pa
        b = self.surface_solids[surface].plane_strain_modulus_pa
        return a * b / (a + b)

    def restitution_at(
        self, sphere: str, surface: str, speed_m_per_s: float, rng: np.random.Generator
    ) -> float:
        """Return eps of one impact.

        Parameters
        ----------
        sphere, surface : str
            The pair.
        speed_m_per_s : float
            Impact speed. [m/s]
        rng : numpy.random.Generator
            Source of this impact's scatter.

        Returns
        -------
        float
            eps of Eq. 6, at most 0.99 unless declared as 1. [1]
        """
        eps = self.restitution[sphere, surface] * (speed_m_per_s / 0.77) ** self.restitution_slope
        eps += self.restitution_scatter * rng.standard_normal()
        lossless = self.restitution[sphere, surface] == 1.0
        return float(min(max(eps, 0.05), 1.0 if lossless else 0.99))

    def mechanics(self, shot: Shot, speed_m_per_s: float, rng: np.random.Generator) -> Mechanics:
        """Return the bodies of one impact with every effect that changes them.

        Parameters
        ----------
        shot : Shot
            What falls on what.
        speed_m_per_s : float
            Impact speed. [m/s]
        rng : numpy.random.Generator
            Source of this impact's scatter.

        Returns
        -------
        Mechanics
            Ready to be integrated.
        """
        sphere, cell = self.sphere_specs[shot.sphere], self.cell
        bodies = Mechanics(
            sphere_mass_kg=sphere.mass_kg,
            sphere_radius_m=sphere.radius_m,
            reduced_modulus_pa=self.reduced_modulus_pa(shot.sphere, shot.surface),
            restitution=self.restitution_at(shot.sphere, shot.surface, speed_m_per_s, rng),
            gravity_m_per_s2=self.gravity_m_per_s2,
            cell_mass_kg=cell.crystal_mass_kg,
            cell_stiffness_n_per_m=cell.crystal_stiffness_n_per_m,
            cell_damping_n_s_per_m=cell.crystal_damping_n_s_per_m,
            rigid=cell.rigid,
            coupon_label_mass_kg=self.surface_specs[shot.surface].coupon_mass_kg,
        )
        for effect in self.acting(shot.sphere, shot.surface):
            effect.before_impact(bodies, shot, speed_m_per_s)
        return bodies

    def truth(self) -> dict[str, object]:
        """Return everything drawn, ready for JSON."""
        solids = {
            kind: {
                name: {
                    "youngs_modulus_Pa": solid.youngs_modulus_pa,
                    "poissons_ratio": solid.poissons_ratio,
                    "plane_strain_modulus_Pa": solid.plane_strain_modulus_pa,
                }
                for name, solid in group.items()
            }
            for kind, group in (("spheres", self.sphere_solids), ("surfaces", self.surface_solids))
        }
        cell = self.cell
        return {
            "effects": [effect.to_json() for effect in self.effects],
            **solids,
            "sensor": {
                "crystal_mass_kg": cell.crystal_mass_kg,
                "crystal_stiffness_N_per_m": cell.crystal_stiffness_n_per_m,
                "crystal_damping_N_s_per_m": cell.crystal_damping_n_s_per_m,
                "compliance_m_per_V": cell.compliance_m_per_v,
                "hsd_N_per_V": cell.hsd_n_per_v,
                "model": "hsd" if cell.rigid else "kv",
            },
            "restitution_eq6_at_0.77_m_per_s": {
                f"{sphere}-{surface}": eps for (sphere, surface), eps in self.restitution.items()
            },
            "restitution_slope": self.restitution_slope,
            "restitution_scatter": self.restitution_scatter,
        }


def draw_rig(
    seed: int,
    spheres: Mapping[str, SphereSpec],
    surfaces: Mapping[str, SurfaceSpec],
    cell: CellSpec,
    effects: Sequence[Effect] | str,
    *,
    restitution: Mapping[tuple[str, str], float] | None = None,
    restitution_scatter: float = 0.008,
    gravity_m_per_s2: float = 9.80665,
    rigid_cell: bool = False,
    exact: bool = False,
) -> DrawnRig:
    """Draw a rig.

    Parameters
    ----------
    seed : int
        Two draws with the same seed and labels are the same rig.
    spheres, surfaces : Mapping
        Labels by name.
    cell : CellSpec
        The cell's certificate.
    effects : sequence of Effect or str
        What acts; ``"random"`` draws one.
    restitution : Mapping, optional
        eps of Eq. 6 by pair; pairs left out are drawn from 0.65 to 0.85. [1]
    restitution_scatter : float
        Standard deviation of eps from impact to impact. [1]
    gravity_m_per_s2 : float
        [m/s^2]
    rigid_cell : bool
        Whether the cell is rigid (HSD) instead of a Kelvin-Voigt element.
    exact : bool
        Take every label at its word: nothing about materials and cell is drawn.

    Returns
    -------
    DrawnRig
        The truth.

    Raises
    ------
    ValueError
        If ``effects`` is a word other than ``"random"``.
    """
    if isinstance(effects, str):
        if effects != "random":
            raise ValueError(f"effects is a list of effects or 'random', not {effects!r}.")
        rng = np.random.default_rng([seed, 3])
        effects = [draw_effect(rng, list(spheres), list(surfaces), rigid_cell=rigid_cell)]
    rng = np.random.default_rng([seed, 1])
    true_spheres = {n: draw_solid(s, rng, exact=exact) for n, s in spheres.items()}
    true_surfaces = {n: draw_solid(s, rng, exact=exact) for n, s in surfaces.items()}
    true_cell = draw_cell(cell, np.random.default_rng([seed, 2]), exact=exact, rigid=rigid_cell)
    rng = np.random.default_rng([seed, 4])
    drawn = {(a, b): float(rng.uniform(0.65, 0.85)) for a in spheres for b in surfaces}
    slope = 0.0 if exact else float(rng.normal(0.02, 0.01))
    return DrawnRig(
        sphere_specs=spheres,
        surface_specs=surfaces,
        sphere_solids=true_spheres,
        surface_solids=true_surfaces,
        cell=true_cell,
        restitution=drawn | dict(restitution or {}),
        restitution_slope=slope,
        restitution_scatter=restitution_scatter,
        effects=tuple(effects),
        gravity_m_per_s2=gravity_m_per_s2,
    )


__all__ = ["DrawnRig", "Solid", "TrueCell", "draw_effect", "draw_rig", "make_effect"]
