"""The joint fit on campaigns made by an independent integrator."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity, Sensor, Shot
from analysis.errors import AnalysisError, UnknownModelError
from analysis.fit import joint
from analysis.fit.campaign_fit import solve
from analysis.fit.estimates import HSD_FIELDS
from analysis.fit.joint import normal_equations, total_cost
from analysis.fit.problem import SENSOR_FIELDS, build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named


def _inside(interval: list[float], value: float) -> bool:
    return interval[0] <= value <= interval[1]


def _log_modulus_errors(rig: Any, result: FitResult) -> dict[str, tuple[float, float]]:
    """Return each pair's (error, u) of ln E*."""
    found = {}
    for shot in result.shots:
        modulus = result.pair_modulus(shot.item)
        assert modulus is not None
        sphere, surface = shot.item.shot.sphere, shot.item.shot.surface
        radius = rig.spheres[sphere][0]
        true = rig.stiffness(sphere, surface) / (4 / 3 * math.sqrt(radius))
        found[shot.item.pair] = (modulus[0] - math.log(true), modulus[1])
    return found


@pytest.fixture(scope="module")
def fitted(made: tuple[Any, Campaign]) -> FitResult:
    """Return the joint KV fit of the synthetic campaign."""
    return fit_campaign(made[1], "kv")


def test_truth_lies_inside_the_stated_intervals(made: tuple[Any, Campaign], fitted: Any) -> None:
    """Every pair's E* and the specimen's E are recovered within their 95 % intervals."""
    rig, _ = made
    assert fitted.outcome.status == "converged"
    for pair, (error, u) in _log_modulus_errors(rig, fitted).items():
        assert abs(error) < 3 * u, pair
        assert u < 0.02, pair
    specimen = fitted.moduli()["specimen"]
    assert specimen["status"] == "fitted"
    assert _inside(specimen["youngs_modulus_Pa"]["interval95"], rig.moduli["specimen"][0])


def test_residual_is_the_noise(made: tuple[Any, Campaign], fitted: FitResult) -> None:
    """chi2 per degree of freedom is one, the residual is the noise, nothing is widened."""
    assert fitted.chi2_per_dof == pytest.approx(1.0, abs=0.04)
    assert fitted.rms == pytest.approx(made[0].noise_v, rel=0.05)
    assert fitted.noise_rms == pytest.approx(made[0].noise_v, rel=0.1)
    assert fitted.misfit == 1.0
    assert fitted.heldout_rms == pytest.approx(fitted.rms, rel=0.02)
    assert fitted.r2 > 0.9999
    assert fitted.flags() == []


def test_cell_is_recovered_where_it_is_identifiable(
    made: tuple[Any, Campaign], fitted: FitResult
) -> None:
    """Gain, frequency and damping ratio of the cell come out far sharper than its certificate."""
    cell = made[0].cell
    k, mass, mu = cell["crystal_stiffness"], cell["crystal_mass"], cell["crystal_damping"]
    found = fitted.parameters()
    for name, true, relative in (
        ("sensor.natural_frequency_Hz", math.sqrt(k / mass) / (2 * math.pi), 1e-3),
        ("sensor.damping_ratio", mu / (2 * math.sqrt(k * mass)), 5e-3),
        ("sensor.gain_N_per_V", k * 1.2e-8, 2e-2),
    ):
        entry = found[name]
        assert abs(entry["value"] - true) < 3.5 * entry["u"], name
        assert entry["u"] < relative * true, name


def test_a_start_leaves_the_problem_as_it_was_and_is_the_same_from_itself(made: Any) -> None:
    """A prior's mean is a mean before and after; what nothing is known of has a wide prior."""
    stated = build(made[1], model_named("kv"))
    before = stated.prior_mean.copy(), stated.prior_precision.copy()
    first, nuisances = with_start(stated)
    assert np.array_equal(stated.prior_mean, before[0])
    assert np.array_equal(stated.prior_precision, before[1])
    known = np.diag(before[1]) > 0.0
    assert first.prior_mean[known] == pytest.approx(before[0][known], abs=1e-9)
    assert np.all(np.diag(first.prior_precision) > 0.0)
    again, same = with_start(first)
    assert again.start == pytest.approx(first.start, abs=1e-9)
    assert same == pytest.approx(nuisances)


def test_eliminating_nuisances_equals_the_dense_normal_equations(made: Any) -> None:
    """The Schur complement gives the covariance and the step of the whole dense system."""
    problem, nuisances = with_start(build(made[1], model_named("kv")))
    solution, _ = solve(problem, nuisances)
    matrix, vector, _ = normal_equations(problem, solution)
    g, shots = len(problem.names), len(solution.blocks)
    dense = np.zeros((g + 4 * shots, g + 4 * shots))
    load = np.zeros(g + 4 * shots)
    dense[:g, :g] = problem.prior_precision
    load[:g] = -problem.prior_precision @ (solution.theta - problem.prior_mean)
    for i, block in enumerate(solution.blocks):
        s = block.chain.shape[0]
        own = slice(g + 4 * i, g + 4 * i + 4)
        dense[:g, :g] += block.chain.T @ block.matrix[:s, :s] @ block.chain
        dense[:g, own] = block.chain.T @ block.matrix[:s, s:]
        dense[own, :g] = dense[:g, own].T
        dense[own, own] = block.matrix[s:, s:]
        load[:g] += block.chain.T @ block.vector[:s]
        load[own] = block.vector[s:]
    scale = 1 / np.sqrt(np.diag(dense))
    inverse = np.linalg.inv(dense * np.outer(scale, scale)) * np.outer(scale, scale)
    np.testing.assert_allclose(solution.covariance, inverse[:g, :g], rtol=1e-4, atol=1e-12)
    u = np.sqrt(np.diag(inverse))[:g]
    step = (inverse @ load)[:g]
    np.testing.assert_allclose(np.linalg.solve(matrix, vector) / u, step / u, atol=1e-3)
    assert np.abs(step / u).max() < 0.05  # and it is a minimum


def test_hsd_is_biased_high_on_polymers_and_says_the_residual_exceeds_the_noise(made: Any) -> None:
    """The rigid-cell model stiffens the specimen, and the result warns of its residual."""
    rig, campaign = made
    result = fit_campaign(campaign, "hsd")
    assert result.misfit > 10
    assert {"residual_above_noise", "rigid_cell_model", "references_contradicted"} <= set(
        result.flags()
    )
    specimen = result.moduli()["specimen"]["youngs_modulus_Pa"]
    assert specimen["value"] > 1.05 * rig.moduli["specimen"][0]


def test_without_certificate_the_known_speeds_calibrate(made: Any) -> None:
    """With nothing known of the cell the fit finds its ring and gain from the records."""
    rig, campaign = made
    result = fit_campaign(dataclasses.replace(campaign, sensor=Sensor()), "kv")
    assert result.outcome.status == "converged"
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.05)
    for pair, (error, u) in _log_modulus_errors(rig, result).items():
        assert abs(error) < 3 * u, pair


def test_without_heights_the_speed_is_free(made: Any) -> None:
    """With a certified cell and no heights speeds are found with the moduli."""
    rig, campaign = made
    shots = tuple(dataclasses.replace(s, drop_height_m=None) for s in campaign.shots)
    result = fit_campaign(dataclasses.replace(campaign, shots=shots), "kv")
    assert result.outcome.status == "converged"
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.05)
    for pair, (error, u) in _log_modulus_errors(rig, result).items():
        assert abs(error) < 3.5 * u, pair
    for shot, known in zip(result.shots, campaign.shots, strict=True):
        nominal = math.sqrt(2 * 9.80665 * (known.drop_height_m or math.nan))
        speed = shot.to_json()["impact_speed_m_per_s"]
        assert abs(speed["value"] - nominal) < 4 * math.hypot(speed["u"], 0.003 * nominal)


def test_reduced_units_where_nothing_is_known(made: Any) -> None:
    """Without materials, cell and heights the shapes are still fitted down to the noise."""
    _, campaign = made
    shots = tuple(
        dataclasses.replace(s, sphere=None, surface=None, drop_height_m=None, restitution=None)
        for s in campaign.shots[:3]
    )
    result = fit_campaign(Campaign(shots), "kv")
    assert result.outcome.status == "converged"
    assert result.r2 > 0.999
    assert result.moduli() == {}
    (pair,) = result.pairs().values()
    assert pair["shots"] == 3
    assert pair["stiffness_over_mass"]["value"] > 0
    json.dumps(result.to_json(), allow_nan=False)


def test_single_shots_by_pair_cover_the_truth(made: Any) -> None:
    """One shot at a time gives E* with an uncertainty that covers its error."""
    rig, campaign = made
    scores = []
    for shot in campaign.shots:
        result = fit_campaign(
            dataclasses.replace(campaign, shots=(shot,)), "kv", by_pair=True, heldout=False
        )
        assert result.outcome.status == "converged", shot.name
        ((error, u),) = _log_modulus_errors(rig, result).values()
        scores.append(error / u)
        (entry,) = result.pairs().values()
        assert 0 <= entry["u_calibration_Pa"] <= entry["reduced_modulus_Pa"]["u"] * (1 + 1e-9)
    assert np.abs(scores).max() < 4
    # one certificate is behind all of them, so the scores share an offset: only their size counts
    assert math.sqrt(np.mean(np.square(scores))) < 2.2


@pytest.mark.parametrize(("model", "fields"), [("kv", 4), ("hsd", 1)])
def test_sensitivity_says_how_the_modulus_follows_the_certificate(
    made: Any, model: str, fields: int
) -> None:
    """Moving the cell's stated values moves a single shot's E* as its sensitivity says."""
    _, campaign = made
    one = dataclasses.replace(campaign, shots=campaign.shots[7:8])
    if model == "hsd":
        one = dataclasses.replace(one, sensor=Sensor(hsd_n_per_v=Quantity(5.0, 0.1)))

    def log_modulus(about: Campaign) -> tuple[float, np.ndarray]:
        result = fit_campaign(about, model, by_pair=True, heldout=False)
        found = result.pair_modulus(result.shots[0].item)
        assert found is not None
        return found[0], result.calibration_part(result.shots[0].item)[1]

    before, sensitivity = log_modulus(one)
    assert sensitivity.shape == (fields,)
    names = SENSOR_FIELDS if model == "kv" else HSD_FIELDS
    for name, expected in zip(names, sensitivity, strict=True):
        known = getattr(one.sensor, name)
        moved = Quantity(known.value * math.exp(0.004), known.u * math.exp(0.004))
        sensor = dataclasses.replace(one.sensor, **{name: moved})
        after, _ = log_modulus(dataclasses.replace(one, sensor=sensor))
        assert after - before == pytest.approx(0.004 * expected, abs=4e-5 + 0.05 * 0.004), name


def test_inverted_records_give_the_same_moduli(made: Any, fitted: FitResult) -> None:
    """A cell wired the other way round gives the same moduli and a flag."""
    _, campaign = made
    shots = tuple(dataclasses.replace(s, signal=-s.signal) for s in campaign.shots)
    result = fit_campaign(dataclasses.replace(campaign, shots=shots), "kv", heldout=False)
    assert result.moduli()["specimen"]["youngs_modulus_Pa"]["value"] == pytest.approx(
        fitted.moduli()["specimen"]["youngs_modulus_Pa"]["value"], rel=1e-3
    )
    assert "inverted_polarity" in result.to_json()["shots"][0]["flags"]


def test_an_unusable_shot_is_listed_and_sinks_no_other(made: Any) -> None:
    """A flat record is rejected by name; the rest is fitted."""
    _, campaign = made
    flat = dataclasses.replace(campaign.shots[0], name="flat", signal=np.zeros(4200))
    mixed = dataclasses.replace(campaign, shots=(flat, *campaign.shots[:4]))
    result = fit_campaign(mixed, "kv", heldout=False).to_json()
    assert [r["name"] for r in result["rejected"]] == ["flat"]
    assert len(result["shots"]) == 4


def test_nothing_usable_is_an_error_with_the_reason() -> None:
    """A campaign of flat records only is refused, naming the first one and why."""
    flat = Shot("flat", np.zeros(3000), 1e6, 1000)
    with pytest.raises(AnalysisError, match="flat: nothing leaves the baseline"):
        fit_campaign(Campaign((flat,)), "kv")


def test_unknown_model_is_refused_with_the_known_ones(made: Any) -> None:
    """A model name that does not exist is answered with those that do."""
    with pytest.raises(UnknownModelError, match="kv"):
        fit_campaign(made[1], "hertz")


def test_progress_rises_to_one(made: Any) -> None:
    """The fit reports its progress as a rising share that ends at one."""
    told: list[float] = []
    fit_campaign(
        dataclasses.replace(made[1], shots=made[1].shots[:2]),
        "kv",
        progress=lambda _what, share: told.append(share),
    )
    assert told[-1] == 1.0
    assert all(0 <= x <= 1 for x in told)


def test_materials_known_on_neither_side_are_withheld(made: Any) -> None:
    """Two unknown materials that only met each other are withheld, with a remedy."""
    _, campaign = made
    spheres = {
        n: dataclasses.replace(s, youngs_modulus_pa=None) for n, s in campaign.spheres.items()
    }
    surfaces = {
        n: dataclasses.replace(s, youngs_modulus_pa=None) for n, s in campaign.surfaces.items()
    }
    about = dataclasses.replace(campaign, spheres=spheres, surfaces=surfaces)
    one = fit_campaign(dataclasses.replace(about, shots=about.shots[:2]), "kv", heldout=False)
    for entry in one.moduli().values():
        assert entry["status"] == "withheld"
        assert "stated modulus" in entry["reason"]
        assert entry["youngs_modulus_Pa"] is None
    assert one.pairs()["acetal/polycarbonate"]["reduced_modulus_Pa"]["u"] > 0
    json.dumps(one.to_json(), allow_nan=False)


@pytest.mark.parametrize("far", [-400.0, 400.0, 800.0])
def test_a_modulus_that_no_float_holds_has_no_cost(made: Any, far: float) -> None:
    """A search may step anywhere; such a step is refused, not an exception."""
    _, campaign = made
    problem, nuisances = with_start(build(campaign, model_named("kv")))
    theta = problem.start.copy()
    theta[[n.startswith(("sphere.", "surface.")) for n in problem.names]] = far
    assert not np.isfinite(total_cost(problem, theta, nuisances))


def test_a_pulse_that_has_left_its_window_stops_no_fit(made: tuple[Any, Campaign]) -> None:
    """One shot begins behind its last sample: nothing moves it, and the others are fitted."""
    problem, nuisances = with_start(build(made[1], model_named("kv")))
    whole = joint.fit(problem, nuisances)
    nuisances[0, problem.model.nuisances.index("t0_us")] = 1e5
    lost = joint.fit(problem, nuisances)
    assert not lost.failed
    u = np.sqrt(np.diag(lost.covariance))
    assert np.all(np.abs(lost.theta - whole.theta) < 2.0 * u)
    assert np.all(np.isinf(np.diag(joint.nuisance_covariance(problem, lost, 0))))
    assert np.all(np.isfinite(joint.nuisance_covariance(problem, lost, 1)))


def test_squares_that_no_float_holds_once_more_stop_no_fit(made: tuple[Any, Campaign]) -> None:
    """A start whose squares are some 1e180 ends as a fit, converged or not."""
    problem, nuisances = with_start(build(made[1], model_named("kv")))
    far = nuisances.copy()
    far[:, problem.model.nuisances.index("baseline")] = 1e88
    assert math.isfinite(total_cost(problem, problem.start, far))
    assert joint.fit(problem, far, max_iterations=3).iterations > 0
