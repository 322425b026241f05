"""A thin coupon under comparable spheres: fits of the simulated rig, whose layer is its own."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.budget import budgets
from analysis.campaign import Campaign, Uncertainty
from analysis.fit.conflicts import conflicts
from analysis.fit.problem import build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Scope
from impactd.storage.campaign_folder import read_campaign

THICKNESS_M = 2e-3
NAME = "kv2+finite_thickness"
THICKNESS = "finite_thickness.thickness_m[specimen]"
SHARE = "finite_thickness.coupon_share"


def stating(campaign: Campaign, thickness_m: float | None, u_m: float | None) -> Campaign:
    """Return a campaign that states the specimen's thickness."""
    specimen = dataclasses.replace(
        campaign.surfaces["specimen"],
        coupon_thickness_m=thickness_m,
        u_coupon_thickness_m=None if u_m is None else Uncertainty(u_m),
    )
    return dataclasses.replace(campaign, surfaces={**campaign.surfaces, "specimen": specimen})


@pytest.fixture(scope="module")
def thin(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, float]:
    """Return twelve drops on a closed rig with a specimen of 2 mm, and the specimen's true E'."""
    usual = CampaignSettings()
    layer = make_effect(
        "finite_thickness", {"thickness_m": THICKNESS_M}, Scope(surface="specimen"), form="layer"
    )
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "hdpe")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0255, 0.0465),
        repeats=1,
        effects=(layer,),
        rig="closed",
    )
    made = simulate_campaign(settings, 5)
    true = float(made["truth"]["surfaces"]["specimen"]["plane_strain_modulus_Pa"])
    folder = write_campaign_folder(tmp_path_factory.mktemp("thin"), made)
    return stating(read_campaign(folder), 1.01 * THICKNESS_M, 0.02 * THICKNESS_M), true


@pytest.fixture(scope="module")
def fitted(thin: tuple[Campaign, float]) -> FitResult:
    """Return the fit with the layer."""
    return fit_campaign(thin[0], NAME, heldout=False)


def modulus(found: FitResult) -> dict[str, Any]:
    """Return the specimen's plane-strain modulus."""
    told: dict[str, Any] = found.moduli()["specimen"]["plane_strain_modulus_Pa"]
    return told


def test_a_thin_specimen_has_its_modulus_within_its_interval(
    thin: tuple[Campaign, float], fitted: FitResult
) -> None:
    """Without the effect it comes out a fifth too high; with it, within 0.5 % and 95 %."""
    campaign, true = thin
    low, high = modulus(fitted)["interval95"]
    assert fitted.outcome.status == "converged"
    assert fitted.misfit == 1.0
    assert low < true < high
    assert modulus(fitted)["value"] == pytest.approx(true, rel=5e-3)
    bare = modulus(fit_campaign(campaign, "kv2", heldout=False))
    assert bare["value"] > 1.2 * true


def test_the_stated_thickness_is_known_with_its_uncertainty(fitted: FitResult) -> None:
    """A prior on the effect's number, found again within it, and one line of the budget."""
    problem, j = fitted.problem, fitted.problem.names.index(THICKNESS)
    stated = 1e-3 / (1.01 * THICKNESS_M)
    assert problem.prior_mean[j] == pytest.approx(stated, rel=1e-9)
    assert problem.prior_precision[j, j] ** -0.5 == pytest.approx(stated * 0.02 / 1.01, rel=1e-6)
    assert 1e-3 / fitted.fitted.theta[j] == pytest.approx(THICKNESS_M, rel=0.04)
    budget = next(b for b in budgets(problem, fitted.fitted, 1e3) if b.name == "surface.specimen")
    rows = {row.source.name: row for row in budget.rows}
    row = rows["surfaces.specimen.coupon_thickness_m"]
    assert row.source.label == "thickness of the coupon specimen"
    assert row.source.unit == "m"
    assert float(np.abs(row.parts).max()) > 0
    assert "surfaces.specimen.poissons_ratio" in rows


def test_a_thickness_stated_wrong_is_named(thin: tuple[Campaign, float]) -> None:
    """3.5 mm for 2 mm: the statement that the shots contradict most."""
    campaign = stating(thin[0], 3.5e-3, 2e-5)
    found = fit_campaign(campaign, NAME, heldout=False)
    worst = conflicts(found.problem, found.fitted)[0]
    assert worst.path == "surfaces.specimen.coupon_thickness_m"
    assert worst.unit == "m"
    assert worst.stated.value == 3.5e-3
    assert worst.found.value < 3e-3
    assert "coupon thickness of specimen" in worst.sentence


def test_a_thickness_without_uncertainty_is_exact(thin: tuple[Campaign, float]) -> None:
    """It does not move, and is listed among what was taken as exact; unused, it is not."""
    campaign = stating(thin[0], THICKNESS_M, None)
    problem, _ = with_start(build(campaign, model_named(NAME)))
    j = problem.names.index(THICKNESS)
    assert problem.start[j] == pytest.approx(0.5)
    assert problem.prior_precision[j, j] ** -0.5 == pytest.approx(0.5e-6)
    path = "surfaces.specimen.coupon_thickness_m"
    assert any(path in said for said in problem.assumptions)
    assert not any(path in said for said in build(campaign, model_named("kv2")).assumptions)


@pytest.mark.parametrize("by_pair", [False, True])
def test_the_coupons_share_follows_the_moduli(
    thin: tuple[Campaign, float], *, by_pair: bool
) -> None:
    """Its value is that of the compliances, and its derivatives those of differences."""
    problem, _ = with_start(build(thin[0], model_named(NAME), by_pair=by_pair))
    row = problem.model.shared.index(SHARE)
    item = next(s for s in problem.shots if s.pair == "acetal/specimen")
    values, chain = problem.shared_local(item, problem.start)
    assert item.radius_m is not None
    reduced = 0.75 * math.exp(values[0]) / math.sqrt(item.radius_m)
    ball = thin[0].spheres["acetal"]
    assert ball.youngs_modulus_pa is not None
    assert ball.poissons_ratio is not None
    own = ball.youngs_modulus_pa.value / (1 - ball.poissons_ratio.value**2)
    if not by_pair:
        own = math.exp(problem.start[problem.names.index("sphere.acetal")])
    assert values[row] == pytest.approx(1 - reduced / own, rel=1e-6)
    for j in range(problem.start.size):
        moved = problem.start.copy()
        moved[j] += 1e-6
        slope = (problem.shared_local(item, moved)[0][row] - values[row]) / 1e-6
        assert chain[row, j] == pytest.approx(slope, abs=1e-5)


def test_a_pair_of_unknown_moduli_counts_the_sphere_as_rigid(thin: tuple[Campaign, float]) -> None:
    """Nothing tells the two apart."""
    spheres = {
        n: dataclasses.replace(s, youngs_modulus_pa=None) for n, s in thin[0].spheres.items()
    }
    problem = build(dataclasses.replace(thin[0], spheres=spheres), model_named(NAME), by_pair=True)
    problem, _ = with_start(problem)
    item = next(s for s in problem.shots if s.pair == "acetal/specimen")
    values, chain = problem.shared_local(item, problem.start)
    row = problem.model.shared.index(SHARE)
    assert values[row] == 1.0
    assert not chain[row].any()


def test_a_thickness_that_nobody_states_is_free(thin: tuple[Campaign, float]) -> None:
    """It starts as thick; coupons are a millimetre or thicker as a rule."""
    problem, _ = with_start(build(stating(thin[0], None, None), model_named(NAME)))
    j = problem.names.index(THICKNESS)
    assert problem.start[j] == pytest.approx(0.0, abs=1e-6)
    assert problem.prior_mean[j] == pytest.approx(0.0)
    assert problem.prior_precision[j, j] == pytest.approx(1.0)
