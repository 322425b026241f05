"""Draws a rig from its labels and a seed: materials, cell, losses, and a hidden effect."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from drivers.simulated.drawn_rig import DrawnRig, Solid, TrueCell
from drivers.simulated.effects import EFFECTS, INVENTED, LIBRARY, Effect, Scope
from drivers.simulated.label_spread import EXACT, LabelSpread, draw_true_labels
from drivers.simulated.rig_model import RigModel, rig_model
from drivers.simulated.specimens import CellSpec, SphereSpec, SurfaceSpec

OUTSIDE_LIBRARY_SHARE = 0.25


def draw_effect(
    rng: np.random.Generator,
    spheres: Sequence[str] = (),
    surfaces: Sequence[str] = (),
    *,
    rigid_cell: bool = False,
    among: Sequence[str] = (),
    without: Sequence[str] = (),
    forms: str = "paper",
) -> Effect:
    """Return one effect of random kind, size and scope; one in four from outside the library.

    Parameters
    ----------
    spheres, surfaces : sequence of str
        Materials that an effect of materials may be restricted to, as `draw_scope` says, on the
        paper's rig to one of them at most; none means it acts everywhere.
    rigid_cell : bool
        Whether the base cell is rigid; only then ``crystal_dynamics`` is a candidate.
    among : sequence of str
        Ids to draw from, each as likely as any other; none means all, as said above.
    without : sequence of str
        Ids that the rig has no room for.
    forms : str
        A rig's name: ``"paper"`` and ``"closed"`` take a law in one form, ``"drawn"`` draws it.
    """
    outside = rng.random() < OUTSIDE_LIBRARY_SHARE
    pool = set(among or (INVENTED if outside else LIBRARY))
    if not rigid_cell:
        pool.discard("crystal_dynamics")
    pool.difference_update(without)
    kind = EFFECTS[str(rng.choice(sorted(pool)))]
    scope = Scope()
    if kind.per_material:
        # what holds a coupon belongs to the coupon, never to what falls on it
        movable = () if kind.slot == "mounting" else spheres
        scope = _one_or_all(rng, movable, surfaces)
        if forms != "paper":  # by a chance of its own, so that sizes stay those of old seeds
            scope = draw_scope(rng.spawn(1)[0], movable, surfaces)
    values = kind.draw(rng)
    if forms == "drawn":
        form, values = kind.draw_form(rng, values)
        return kind(values, scope, form)
    return kind(values, scope, kind.form_on(forms))


def _one_or_all(rng: np.random.Generator, spheres: Sequence[str], surfaces: Sequence[str]) -> Scope:
    """Return one material in two draws of five, as the paper's rigs of old seeds have it."""
    if rng.random() < 0.4:
        if rng.integers(2) == 0 and spheres:
            return Scope(sphere=str(rng.choice(list(spheres))))
        if surfaces:
            return Scope(surface=str(rng.choice(list(surfaces))))
    return Scope()


def draw_scope(rng: np.random.Generator, spheres: Sequence[str], surfaces: Sequence[str]) -> Scope:
    """Return materials at random: one, some or all, each of the three as likely.

    Some are two to all but one, each number as likely, of one side; of fewer than three materials
    there are only one and all.
    """
    how_many = str(rng.choice(("one", "some", "all")))
    side = "sphere" if spheres and (not surfaces or rng.integers(2) == 0) else "surface"
    names = list(spheres if side == "sphere" else surfaces)
    if how_many == "all" or not names:
        return Scope()
    count = int(rng.integers(2, len(names))) if how_many == "some" and len(names) > 2 else 1
    chosen = tuple(rng.choice(names, count, replace=False).tolist())
    return Scope(**{side: chosen})


def draw_solid(
    spec: SphereSpec | SurfaceSpec, rng: np.random.Generator, *, exact: bool = False
) -> Solid:
    """Return a body's true constants: around its label, or anywhere when the label is blank.

    If ``exact``, the label is the truth.
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

    If ``exact``, the certificate is the truth; ``rigid`` makes it an HSD cell.
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
    rig: str = "paper",
    spread: LabelSpread = EXACT,
) -> DrawnRig:
    """Draw a rig.

    Parameters
    ----------
    seed : int
        Two draws with the same seed and labels are the same rig.
    effects : sequence of Effect or str
        What acts; ``"random"`` draws one.
    restitution : Mapping, optional
        eps of Eq. 6 by pair; pairs left out are drawn from 0.65 to 0.85. [1]
    restitution_scatter : float
        Standard deviation of eps from impact to impact. [1]
    rigid_cell : bool
        Whether the cell is rigid (HSD) instead of a Kelvin-Voigt element.
    exact : bool
        The labels are the truth: nothing about materials and cell is drawn.
    rig : str
        Which physics it obeys, a name that `rig_model` knows.
    spread : LabelSpread
        How far radii, masses, heights, time base, gravity and temperature may be from what is said.

    Raises
    ------
    ValueError
        If ``effects`` is a word other than ``"random"``, or there is no such rig.
    """
    model = rig_model(rig, seed)
    if isinstance(effects, str):
        if effects != "random":
            raise ValueError(f"effects is a list of effects or 'random', not {effects!r}.")
        rng = np.random.default_rng([seed, 3])
        effects = [
            draw_effect(
                rng,
                list(spheres),
                list(surfaces),
                rigid_cell=rigid_cell,
                without=no_room_for(model),
                forms=rig,
            )
        ]
    rng = np.random.default_rng([seed, 1])
    true_spheres = {n: draw_solid(s, rng, exact=exact) for n, s in spheres.items()}
    true_surfaces = {n: draw_solid(s, rng, exact=exact) for n, s in surfaces.items()}
    true_cell = draw_cell(cell, np.random.default_rng([seed, 2]), exact=exact, rigid=rigid_cell)
    rng = np.random.default_rng([seed, 4])
    drawn = {(a, b): float(rng.uniform(0.65, 0.85)) for a in spheres for b in surfaces}
    slope = 0.0 if exact else float(rng.normal(0.02, 0.01))
    labels = draw_true_labels(spread, seed, spheres, surfaces, gravity_m_per_s2)
    return DrawnRig(
        sphere_specs=labels.spheres,
        surface_specs=labels.surfaces,
        sphere_solids=true_spheres,
        surface_solids=true_surfaces,
        cell=true_cell,
        restitution=drawn | dict(restitution or {}),
        restitution_slope=slope,
        restitution_scatter=restitution_scatter,
        effects=tuple(effects),
        gravity_m_per_s2=labels.gravity_m_per_s2,
        model=model,
        inputs=labels.inputs,
    )


def no_room_for(model: RigModel) -> tuple[str, ...]:
    """Return the ids of effects that a rig of this physics has already.

    With the third law that is the reaction of the dashpot.
    """
    return ("dashpot_reaction",) if model.third_law else ()
