"""Starts from the records: where a fit ends does not hang on the moduli somebody put down."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, TypeVar

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity, Sensor, Sphere, Surface
from analysis.fit.result import FitResult
from impactd.bench.coverage import Rigs, draw_settings
from impactd.bench.simulated_campaign import simulated_campaign

M = TypeVar("M", Sphere, Surface)
ALL_SPHERES_AND_SURFACES = ("acetal", "hdpe", "polycarbonate", "specimen")


def _stated(rig: Any, campaign: Campaign, names: tuple[str, ...], factor: float, u: float) -> Any:
    """Return the campaign with these materials stated wrong by a factor, within a relative u."""

    def one(material: M) -> M:
        if material.name not in names:
            return material
        value = rig.moduli[material.name][0] * factor
        return dataclasses.replace(material, youngs_modulus_pa=Quantity(value, u * value))

    return dataclasses.replace(
        campaign,
        spheres={n: one(m) for n, m in campaign.spheres.items()},
        surfaces={n: one(m) for n, m in campaign.surfaces.items()},
    )


def _apart_in_u(one: FitResult, other: FitResult) -> float:
    """Return the largest distance of two fits' globals in standard uncertainties."""
    u = np.sqrt(np.diag(other.fitted.covariance))
    return float(np.max(np.abs(one.fitted.theta - other.fitted.theta) / u))


def _drawn(truth: Any, seed: int) -> Any:
    """Return a rig whose spheres and coupons are drawn from rubber-like to aluminium-like."""
    rng = np.random.default_rng(seed)
    rig = truth(seed=seed)
    for name in rig.moduli:
        modulus = math.exp(rng.uniform(math.log(0.4e9), math.log(80e9)))
        rig.moduli[name] = (modulus, rng.uniform(0.3, 0.42))
    for name in rig.spheres:
        radius = rng.uniform(2.5e-3, 7e-3)
        rig.spheres[name] = (radius, 4 / 3 * math.pi * radius**3 * rng.uniform(900, 8000))
    return rig


@pytest.mark.parametrize("factor", [10.0, 0.1])
@pytest.mark.parametrize("unknown", [("specimen",), ("specimen", "hdpe"), ("acetal", "specimen")])
def test_wrong_starting_moduli_lead_to_the_same_answer(
    made: tuple[Any, Campaign], unknown: tuple[str, ...], factor: float
) -> None:
    """Moduli put down ten times too large or small, loosely, end where true ones end."""
    rig, campaign = made
    near = fit_campaign(_stated(rig, campaign, unknown, 1.0, 3.0), "kv", heldout=False)
    far = fit_campaign(_stated(rig, campaign, unknown, factor, 3.0), "kv", heldout=False)
    assert far.outcome.status == near.outcome.status == "converged"
    # the loose statement itself still pulls by u_fit^2 / 3^2 of ln 10
    assert _apart_in_u(far, near) < 0.05


@pytest.mark.parametrize("seed", range(2, 6))
@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_drawn_pairs_are_found_from_far_off(truth: Any, seed: int, factor: float) -> None:
    """Materials from 0.4 to 80 GPa and spheres of any size: two of four moduli ten times off."""
    rig = _drawn(truth, seed)
    campaign = rig.campaign(heights_m=(0.02, 0.06))
    far = fit_campaign(
        _stated(rig, campaign, ("hdpe", "specimen"), factor, 3.0), "kv", heldout=False
    )
    assert far.outcome.status == "converged"
    assert far.chi2_per_dof == pytest.approx(1.0, abs=0.04)
    for shot in far.shots:
        found = far.pair_modulus(shot.item)
        assert found is not None
        sphere, surface = shot.item.shot.sphere, shot.item.shot.surface
        radius = rig.spheres[sphere][0]
        true = math.log(rig.stiffness(sphere, surface) / (4 / 3 * math.sqrt(radius)))
        assert abs(found[0] - true) < 4 * found[1], shot.item.pair


@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_open_valleys_are_walked_in_few_steps(truth: Any, factor: float) -> None:
    """What a network leaves open, stiff spheres on soft coupons, takes no hundreds of steps."""
    rig = _drawn(truth, 2)
    campaign = _stated(rig, rig.campaign(heights_m=(0.02, 0.06)), ("hdpe", "specimen"), factor, 2.0)
    assert fit_campaign(campaign, "kv", heldout=False).fitted.iterations < 40


@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_a_reference_stated_wrong_is_found_out(made: tuple[Any, Campaign], factor: float) -> None:
    """A modulus stated ten times off within 30 % is overruled by the records, and flagged."""
    rig, campaign = made
    found = fit_campaign(_stated(rig, campaign, ("specimen",), factor, 0.3), "kv", heldout=False)
    assert found.outcome.status == "converged"
    assert "references_contradicted" in found.flags()
    log = found.fitted.theta[found.problem.names.index("surface.specimen")]
    modulus, ratio = rig.moduli["specimen"]
    assert log == pytest.approx(math.log(modulus / (1 - ratio**2)), abs=0.1)


@pytest.mark.parametrize("wrong", ["all", "compliance", "mass", "stiffness", "damping"])
@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_a_certificate_off_by_a_fifth_leads_to_the_same_answer(
    made: tuple[Any, Campaign], wrong: str, factor: float
) -> None:
    """The cell's stated values 20 % off, within 20 %, move no modulus by half its uncertainty."""
    rig, campaign = made
    values = {
        "compliance": 1.2e-8,
        "mass": rig.cell["crystal_mass"],
        "stiffness": rig.cell["crystal_stiffness"],
        "damping": rig.cell["crystal_damping"],
    }

    def fit(by: float) -> FitResult:
        off = {n: v * (by if wrong in (n, "all") else 1.0) for n, v in values.items()}
        sensor = Sensor(*(Quantity(v, 0.2 * values[n]) for n, v in off.items()))
        return fit_campaign(dataclasses.replace(campaign, sensor=sensor), "kv", heldout=False)

    right, found = fit(1.0), fit(factor)
    assert found.outcome.status == "converged"
    for name in right.problem.names:
        if name.startswith(("sphere.", "surface.")):
            j = right.problem.names.index(name)
            u = math.sqrt(right.fitted.covariance[j, j])
            assert abs(found.fitted.theta[j] - right.fitted.theta[j]) < 0.5 * u, name


def test_a_single_shot_needs_no_starting_modulus_at_all(made: tuple[Any, Campaign]) -> None:
    """Shots fitted by pair find the same stiffness whatever the materials are said to be."""
    rig, campaign = made
    one = dataclasses.replace(campaign, shots=campaign.shots[-1:])
    found = [
        fit_campaign(
            _stated(rig, one, ALL_SPHERES_AND_SURFACES, factor, 0.01),
            "kv",
            by_pair=True,
            heldout=False,
        ).fitted.theta
        for factor in (0.1, 1.0, 10.0)
    ]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[2], found[1])


@pytest.mark.parametrize("seed", [7023, 7130])
def test_no_contact_ends_up_giving_energy(seed: int) -> None:
    """Where long first steps lead to rebounds faster than impacts, shorter ones find the better
    end, and the residual is noise.
    """
    settings = draw_settings(seed, Rigs("closed", "typical"))
    found = fit_campaign(simulated_campaign(settings, seed), heldout=False)
    losses = found.fitted.nuisances[:, found.problem.model.nuisances.index("ln_e")]
    assert losses.max() < 0
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.02)
