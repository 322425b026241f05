"""The true rig: every value that the labels do not state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drivers.simulated.effects import Effect, Shot
from drivers.simulated.fall import Body
from drivers.simulated.impact import Mechanics
from drivers.simulated.label_spread import EXACT_INPUTS, TrueInputs
from drivers.simulated.loss_laws import hunt_crossley_constant, kuwabara_kono_constant
from drivers.simulated.rig_model import LIFT_OFF, LOSS, PAPER, RigModel
from drivers.simulated.specimens import SphereSpec, SurfaceSpec

REFERENCE_SPEED_M_PER_S = 0.77
"""Speed at which a pair's restitution is stated."""


@dataclass(frozen=True)
class Solid:
    """True elastic constants of one body."""

    youngs_modulus_pa: float
    poissons_ratio: float

    @property
    def plane_strain_modulus_pa(self) -> float:
        """Return E / (1 - nu^2). [Pa]"""
        return self.youngs_modulus_pa / (1.0 - self.poissons_ratio**2)


@dataclass(frozen=True)
class TrueCell:
    """The true load cell: c, M, k, mu."""

    compliance_m_per_v: float
    crystal_mass_kg: float
    crystal_stiffness_n_per_m: float
    crystal_damping_n_s_per_m: float
    hsd_n_per_v: float
    """S of Eq. 7, used when the cell is rigid."""
    rigid: bool = False
    """The cell does not move (HSD)."""


@dataclass(frozen=True)
class DrawnRig:
    """Truth of one rig."""

    sphere_specs: Mapping[str, SphereSpec]
    surface_specs: Mapping[str, SurfaceSpec]
    """Spheres and coupons as they truly are, by name; their moduli are in the next two."""
    sphere_solids: Mapping[str, Solid]
    surface_solids: Mapping[str, Solid]
    cell: TrueCell
    restitution: Mapping[tuple[str, str], float]
    """eps of Eq. 6 at 0.77 m/s by (sphere, surface). [1]"""
    restitution_slope: float
    """``eps ~ speed^slope``. [1]"""
    restitution_scatter: float
    """Standard deviation of eps from impact to impact. [1]"""
    effects: tuple[Effect, ...]
    gravity_m_per_s2: float
    model: RigModel = PAPER
    inputs: TrueInputs = EXACT_INPUTS
    """What is true of all drops and differs from what is stated."""

    def acting(self, sphere: str, surface: str) -> list[Effect]:
        """Return the effects that concern a pair, in the order of the chain."""
        here = [e for e in self.effects if e.scope.includes(sphere, surface)]
        return sorted(here, key=lambda e: e.order)

    def reduced_modulus_pa(self, sphere: str, surface: str) -> float:
        """Return E*, 1/E* = sum of (1 - nu^2)/E. [Pa]"""
        a = self.sphere_solids[sphere].plane_strain_modulus_pa
        b = self.surface_solids[surface].plane_strain_modulus_pa
        return a * b / (a + b)

    def restitution_at(
        self, sphere: str, surface: str, speed_m_per_s: float, rng: np.random.Generator
    ) -> float:
        """Return eps of Eq. 6 for one impact, at most 0.99 unless declared as 1."""
        relative = speed_m_per_s / REFERENCE_SPEED_M_PER_S
        eps = self.restitution[sphere, surface] * relative**self.restitution_slope
        eps += self.restitution_scatter * rng.standard_normal()
        lossless = self.restitution[sphere, surface] == 1.0
        return float(min(max(eps, 0.05), 1.0 if lossless else 0.99))

    def mechanics(self, shot: Shot, speed_m_per_s: float, rng: np.random.Generator) -> Mechanics:
        """Return the bodies of one impact with every effect that changes them."""
        sphere, cell = self.sphere_specs[shot.sphere], self.cell
        coupon = self.surface_solids[shot.surface]
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
            third_law=self.model.third_law,
            coupon_rides=self.model.coupon_rides,
            lift_off_rule=LIFT_OFF[self.model.lift_off],
            loss_law=LOSS[self.model.loss],
            coupon_label_mass_kg=self.surface_specs[shot.surface].coupon_mass_kg,
            coupon_plane_strain_modulus_pa=coupon.plane_strain_modulus_pa,
            coupon_poissons_ratio=coupon.poissons_ratio,
        )
        bodies.loss_constant = self._loss_constant(bodies, shot, speed_m_per_s)
        for effect in self.acting(shot.sphere, shot.surface):
            effect.before_impact(bodies, shot, speed_m_per_s)
        return bodies

    def _loss_constant(self, bodies: Mechanics, shot: Shot, speed_m_per_s: float) -> float | None:
        """Return the constant of the law of loss, None for Tsuji's.

        The other laws say themselves how the loss depends on speed: their constant is that of the
        pair, given by its restitution at `REFERENCE_SPEED_M_PER_S` and this impact's scatter.
        """
        if self.model.loss == "tsuji":
            return None
        scatter = bodies.restitution - self._restitution_without_scatter(shot, speed_m_per_s)
        eps = min(max(self.restitution[shot.sphere, shot.surface] + scatter, 0.2), 1.0)
        if self.model.loss == "hunt_crossley":
            return hunt_crossley_constant(eps, REFERENCE_SPEED_M_PER_S)
        return kuwabara_kono_constant(
            eps,
            REFERENCE_SPEED_M_PER_S,
            mass_kg=bodies.sphere_mass_kg,
            contact_stiffness=bodies.contact_stiffness,
            rule=bodies.lift_off_rule,
        )

    def _restitution_without_scatter(self, shot: Shot, speed_m_per_s: float) -> float:
        at_reference = self.restitution[shot.sphere, shot.surface]
        relative = speed_m_per_s / REFERENCE_SPEED_M_PER_S
        return float(at_reference * relative**self.restitution_slope)

    def body(self, sphere: str) -> Body:
        """Return a sphere in air: true size and mass, gravity, the air's temperature."""
        spec = self.sphere_specs[sphere]
        return Body(spec.radius_m, spec.mass_kg, self.gravity_m_per_s2, self.inputs.temperature_k)

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
        for name, sphere in self.sphere_specs.items():
            solids["spheres"][name] |= {"radius_m": sphere.radius_m, "mass_kg": sphere.mass_kg}
        for name, surface in self.surface_specs.items():
            solids["surfaces"][name]["coupon_mass_kg"] = surface.coupon_mass_kg
        return {
            "rig": self.model.to_json(),
            "inputs": {
                "gravity_m_per_s2": self.gravity_m_per_s2,
                **self.inputs.to_json(),
            },
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
