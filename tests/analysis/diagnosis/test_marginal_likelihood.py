"""Laplace's marginal likelihood agrees with nested sampling, and a number's price with both."""

from __future__ import annotations

import dataclasses
import math

import dynesty
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.campaign import Campaign
from analysis.diagnosis.candidate import Refit, extended, refitted
from analysis.diagnosis.marginal_likelihood import Price, coordinate_width, log_integral
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

from .conftest import small_campaign

SIGMAS = 6.0
"""Half the box's sides, in the fit's own uncertainties: it holds all but 1e-8 of a Gaussian."""
LIVE_POINTS = 150

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A few drops of a clean rig."""
    return small_campaign(tmp_path_factory.mktemp("clean"))


def _alone(campaign: Campaign, base: str, row: int) -> tuple[JointProblem, joint.Fitted, Array]:
    """Return the fit of one shot by itself, of its own stiffness, and what it leaves."""
    one = dataclasses.replace(campaign, shots=campaign.shots[row : row + 1])
    problem, nuisances = with_start(build(one, model_named(base), by_pair=True))
    fitted = joint.fit(problem, nuisances)
    item = problem.shots[0]
    local = np.concatenate([problem.shared_local(item, fitted.theta)[0], fitted.nuisances[0]])
    return problem, fitted, item.window.signal - problem.model.predict(local, item.frame).signal


def _true(campaign: Campaign, base: str, row: int) -> tuple[JointProblem, joint.Fitted]:
    """Return the same for a record that the model could have made: its trace, and real noise."""
    problem, fitted, left = _alone(campaign, base, row)
    noise = _alone(campaign, "kv2", row)[2]
    item = problem.shots[0]
    window = dataclasses.replace(item.window, signal=item.window.signal - left + noise)
    problem.shots = [dataclasses.replace(item, window=window)]
    return problem, joint.fit(problem, fitted.nuisances, theta=fitted.theta)


def _square_root(problem: JointProblem, fitted: joint.Fitted) -> Array:
    """Return L with the covariance L L' of all parameters, globals first."""
    block = fitted.blocks[0]
    first, size = block.chain.shape[0], fitted.theta.size
    chain = np.zeros((block.matrix.shape[0], size + block.matrix.shape[0] - first))
    chain[:first, :size] = block.chain
    chain[first:, size:] = np.eye(block.matrix.shape[0] - first)
    whole = chain.T @ block.matrix @ chain
    whole[:size, :size] += problem.prior_precision
    return np.asarray(np.linalg.cholesky(np.linalg.inv(whole)))


def _sampled(problem: JointProblem, fitted: joint.Fitted) -> tuple[float, float]:
    """Return ln of the integral over a box about the fit, by nested sampling, and its error."""
    centre = np.concatenate([fitted.theta, fitted.nuisances[0]])
    root, size = _square_root(problem, fitted), fitted.theta.size

    def log_likelihood(unit: Array) -> float:
        at = centre + root @ ((2.0 * unit - 1.0) * SIGMAS)
        cost = joint.total_cost(problem, at[:size], at[None, size:])
        return -0.5 * (cost - fitted.cost) if math.isfinite(cost) else -1e300

    sampler = dynesty.NestedSampler(
        log_likelihood, lambda unit: unit, centre.size, nlive=LIVE_POINTS, sample="rslice",
        rstate=np.random.default_rng(11),
    )  # fmt: skip
    sampler.run_nested(print_progress=False, dlogz=0.05)
    found = sampler.results
    volume = np.linalg.slogdet(2.0 * SIGMAS * root)[1]
    return float(found.logz[-1] + volume - 0.5 * fitted.cost), float(found.logzerr[-1])


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("base", "row"), [("hsd", 0), ("kv", 1), ("kv2", 3)])
def test_laplace_agrees_with_nested_sampling(campaign: Campaign, base: str, row: int) -> None:
    """The integral over all parameters of one shot is right to the sampler's error."""
    problem, fitted = _true(campaign, base, row)
    sampled, error = _sampled(problem, fitted)
    laplace = log_integral(problem, fitted)
    print(f"{base}: ln Z {laplace:.2f}, nested sampling {sampled:.2f} +- {error:.2f}")
    assert laplace == pytest.approx(sampled, abs=0.1 + 3.0 * error)


@pytest.mark.parametrize("effect_id", ["coupler_highpass", "hunt_crossley_damping"])
def test_the_score_is_twice_the_rise_of_the_evidence(campaign: Campaign, effect_id: str) -> None:
    """A needless number costs the logarithm of how much of its range the records exclude."""
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    effect = effect_named(effect_id)
    begin = {
        f"{effect_id}.{p.name}": p.coordinate(p.starts[-1]) if p.form == "log" else 0.0
        for p in effect.parameters
    }
    larger, theta, nuisances = extended(problem, base, effect, begin)
    fitted = joint.fit(larger, nuisances, theta=theta)
    bare = Refit(effect, effect_id, "rig", larger, fitted, 0.0, 0, False, 0.0)
    found = refitted(bare, problem, base)
    widths = sum(math.log(coordinate_width(p)) for p in effect.parameters)
    rise = log_integral(larger, fitted) - log_integral(problem, base) - widths
    assert found.score() == pytest.approx(2.0 * rise, abs=0.5)
    assert found.score() < 3.0


def test_no_number_is_cheaper_for_being_unknown(campaign: Campaign) -> None:
    """Where the records say nothing of it, a number costs next to nothing, and earns nothing."""
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    effect = effect_named("recontact")
    begin = {f"recontact.{p.name}": p.coordinate(p.high) for p in effect.parameters}
    larger, theta, nuisances = extended(problem, base, effect, begin)
    still = joint.fit(larger, nuisances, theta=theta, max_iterations=0)
    bare = Refit(effect, "recontact", "rig", larger, still, 0.0, 0, False, 0.0)
    price = refitted(bare, problem, base).price
    assert price != Price()
    assert 0.0 <= price.shared + price.shots < 30.0


def test_a_fit_that_ran_off_its_base_has_no_price(campaign: Campaign) -> None:
    """Its normal matrix, huge and no longer positive, is not asked for a volume."""
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    effect = effect_named("recontact")
    begin = {f"recontact.{p.name}": p.coordinate(p.high) for p in effect.parameters}
    larger, theta, nuisances = extended(problem, base, effect, begin)
    still = joint.fit(larger, nuisances, theta=theta, max_iterations=0)
    far = [dataclasses.replace(b, matrix=-1e34 * b.matrix) for b in still.blocks]
    lost = dataclasses.replace(still, blocks=far, cost=1e34)
    found = refitted(
        Refit(effect, "recontact", "rig", larger, lost, 0.0, 0, False, 0.0), problem, base
    )
    assert found.price == Price()
    assert found.score() < 0.0
