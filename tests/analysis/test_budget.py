"""The uncertainty budget against the covariance, against another program, and against sampling."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest
from uncertainties import correlated_values, ufloat

from analysis import fit_campaign
from analysis.budget import Budget, Row, budgets
from analysis.budget_monte_carlo import monte_carlo, refits
from analysis.budget_sources import Source
from analysis.campaign import Campaign, Quantity, Sphere, Uncertainty
from analysis.fit.joint import normal_equations
from analysis.fit.measurand import young_from_plane_strain
from analysis.fit.result import FitResult


def stated(campaign: Campaign) -> Campaign:
    """Return a campaign with the uncertainties of balls by grade and a careful ruler."""
    spheres = {
        name: dataclasses.replace(
            one,
            u_mass_kg=Uncertainty(5e-4 * (one.mass_kg or 0.0), degrees_of_freedom=9.0),
            u_radius_m=Uncertainty(2e-3 * (one.radius_m or 0.0), "rectangular", traceable_to="ISO"),
        )
        for name, one in campaign.spheres.items()
    }
    return dataclasses.replace(
        campaign,
        spheres=spheres,
        u_height_offset_m=Uncertainty(3e-4),
        u_sample_rate_relative=Uncertainty(25e-6),
    )


@pytest.fixture(scope="module")
def fit(made: tuple[Any, Campaign]) -> FitResult:
    """Return the joint fit of the synthetic campaign with uncertain inputs."""
    return fit_campaign(stated(made[1]), "kv", heldout=False)


@pytest.fixture(scope="module")
def found(fit: FitResult) -> dict[tuple[str, str], Budget]:
    """Return its budgets by global and measurand."""
    made = budgets(fit.problem, fit.fitted, fit.degrees_of_freedom)
    return {(b.name, b.measurand): b for b in made}


def test_contributions_add_up_to_the_stated_uncertainty(
    fit: FitResult, found: dict[tuple[str, str], Budget]
) -> None:
    """The squares of all contributions are the variance of E' and of E, for every material."""
    moduli = fit.moduli()
    for (name, measurand), budget in found.items():
        said = moduli[name.partition(".")[2]][measurand]
        assert budget.relative_u == pytest.approx(said["u"] / said["value"], rel=1e-9)
        assert budget.value == pytest.approx(said["value"], rel=1e-12)
        parts = budget.part(common=True), budget.part(common=False)
        assert math.hypot(*parts) == pytest.approx(budget.relative_u, rel=1e-12)


def test_every_declared_input_has_its_row(found: dict[tuple[str, str], Budget]) -> None:
    """Inputs keep distribution, degrees of freedom and traceability, and a signed sensitivity."""
    budget = found["surface.specimen", "plane_strain_modulus_Pa"]
    rows = {r.source.name: r for r in budget.rows}
    radius, mass = rows["spheres.acetal.radius_m"], rows["spheres.acetal.mass_kg"]
    assert (radius.source.uncertainty.distribution, radius.source.common) == ("rectangular", True)
    assert radius.source.uncertainty.traceable_to == "ISO"
    assert mass.source.uncertainty.degrees_of_freedom == 9.0
    assert mass.sensitivity is not None
    assert radius.sensitivity is not None
    assert mass.sensitivity > 0 > radius.sensitivity
    assert {"release.height_offset_u_m", "sample_rate_u_relative", "noise"} <= set(rows)
    assert not rows["noise"].source.common
    assert rows["spheres.hdpe.youngs_modulus_Pa"].source.common
    assert budget.degrees_of_freedom > 9.0


def test_linear_chain_agrees_with_another_program(
    fit: FitResult, found: dict[tuple[str, str], Budget]
) -> None:
    """The package ``uncertainties`` gives the same u and the same part of each stated number."""
    matrix, _, parts = normal_equations(fit.problem, fit.fitted)
    precision, names = fit.problem.prior_precision, fit.problem.names
    score = np.array(correlated_values(np.zeros(len(names)), sum(p.matrix for p in parts)))
    cell = [j for j, n in enumerate(names) if n.startswith("sensor.")]
    means = np.array([ufloat(0.0, precision[j, j] ** -0.5) for j in range(len(names))])
    block = np.linalg.inv(precision[np.ix_(cell, cell)])
    means[cell] = correlated_values(np.zeros(len(cell)), block)
    theta = np.linalg.solve(matrix, np.eye(len(names))) @ (precision @ means + score)
    for (name, measurand), budget in found.items():
        if measurand != "plane_strain_modulus_Pa":
            continue
        theirs = theta[names.index(name)]
        assert budget.relative_u == pytest.approx(theirs.std_dev, rel=1e-6)
        by_input = theirs.error_components()
        for row in budget.rows:
            path = row.source.name
            if not path.startswith("spheres.") or not path.endswith(("mass_kg", "radius_m")):
                continue
            _, ball, key = path.split(".")
            mean = means[names.index(f"input.{key.rpartition('_')[0]}.{ball}")]
            assert row.contribution == pytest.approx(by_input[mean], rel=1e-6)


def test_youngs_modulus_shares_its_statement_out(fit: FitResult, found: Any) -> None:
    """E of a reference is as uncertain as its own two statements and the fit make it."""
    ball = fit.problem.campaign.spheres["hdpe"]
    j = fit.problem.names.index("sphere.hdpe")
    assert ball.poissons_ratio is not None
    log, u = float(fit.fitted.theta[j]), math.sqrt(float(fit.fitted.covariance[j, j]))
    value, relative = young_from_plane_strain(log, u, ball.youngs_modulus_pa, ball.poissons_ratio)
    budget = found["sphere.hdpe", "youngs_modulus_Pa"]
    assert (budget.value, budget.relative_u) == pytest.approx((value, relative), rel=1e-9)
    assert "spheres.hdpe.poissons_ratio" in {r.source.name for r in budget.rows}


def test_the_sentence_names_what_to_measure(made: tuple[Any, Campaign]) -> None:
    """With good references a badly known mass dominates and is named with a value to reach."""
    campaign = made[1]
    spheres = {
        name: dataclasses.replace(
            one, youngs_modulus_pa=_sure(one), u_mass_kg=Uncertainty(0.01 * (one.mass_kg or 0.0))
        )
        for name, one in campaign.spheres.items()
    }
    fit = fit_campaign(dataclasses.replace(campaign, spheres=spheres), "kv", heldout=False)
    (budget,) = [
        b
        for b in budgets(fit.problem, fit.fitted, fit.degrees_of_freedom)
        if (b.name, b.measurand) == ("surface.specimen", "plane_strain_modulus_Pa")
    ]
    masses = {r.source.label for r in budget.rows if r.source.name.endswith("mass_kg")}
    assert budget.rows[0].source.label in masses
    assert budget.advice().startswith("Measure the mass of the sphere")
    assert " % (now 1 %): it is " in budget.advice()


def test_a_number_that_acts_in_two_ways_is_named_once() -> None:
    """A coupon's Poisson's ratio stiffens a thin one and divides E' into E: it is measured once."""
    said, path = Uncertainty(0.02), "surfaces.pvc.poissons_ratio"
    stiffens = Source(path, "ratio of pvc, when thin", 0.4, said, "1", True, True, np.ones((1, 1)))
    divides = dataclasses.replace(stiffens, label="ratio of pvc", relative=False)
    rows = Row(stiffens, np.array([0.02])), Row(divides, np.array([0.01]))
    advice = Budget("surface.pvc", "plane_strain_modulus_Pa", 1e9, rows).advice()
    assert advice.startswith("Measure the ratio of pvc, when thin to ")


def _sure(ball: Sphere) -> Quantity:
    assert ball.youngs_modulus_pa is not None
    return Quantity(ball.youngs_modulus_pa.value, 1e-4 * ball.youngs_modulus_pa.value)


def test_budget_is_in_the_fits_json(fit: FitResult) -> None:
    """Every modulus has its budget in the result, in numbers that JSON can hold."""
    document = fit.to_json()
    json.dumps(document, allow_nan=False)
    assert document["budget"]["format"] == "impactd-budget/1"
    one = document["budget"]["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    assert sum(row["share"] for row in one["rows"]) == pytest.approx(1.0)
    assert one["u"] == pytest.approx(document["moduli"]["specimen"]["plane_strain_modulus_Pa"]["u"])
    assert one["improve"]


def test_draws_agree_with_the_linear_budget(fit: FitResult) -> None:
    """10^4 draws give each modulus' u within 5 % and its interval's ends within 0.2 u."""
    for sampled in monte_carlo(fit, 10_000, seed=3):
        said = sampled.to_json()
        assert said["u_ratio"] == pytest.approx(1.0, abs=0.05), said
        assert max(abs(x) for x in said["ends_apart_in_u"]) < 0.2, said
    with pytest.raises(ValueError, match="95 %"):
        monte_carlo(fit, 10)


def test_whole_refits_agree_with_the_linear_budget(fit: FitResult) -> None:
    """Records and statements drawn and fitted anew scatter as the budget says."""
    count = 40
    for sampled in refits(fit, count, seed=5):
        if sampled.budget.measurand != "plane_strain_modulus_Pa":
            continue
        assert sampled.values.size == count
        # a standard deviation of 40 draws is good to 1/sqrt(2 * 39) = 11 %; four of that
        assert sampled.relative_u == pytest.approx(sampled.budget.relative_u, rel=0.45)
        middle = float(np.log(sampled.values / sampled.budget.value).mean())
        assert abs(middle) < 4 * sampled.budget.relative_u / math.sqrt(count)
