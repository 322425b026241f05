"""The posterior of a fit: its density, Laplace's draws, and the sampler's."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Campaign, Quantity
from analysis.errors import AnalysisError
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.result import FitResult
from analysis.posterior.density import GlobalDensity, JointDensity
from analysis.posterior.draws import interval95, laplace_draws, posterior_draws
from analysis.posterior.inference_data import inference_data
from tests.analysis.diagnosis.conftest import small_campaign

GUIDE = Path(__file__).parents[3] / "analysis" / "posterior" / "README.md"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Eight drops of a clean rig."""
    return small_campaign(tmp_path_factory.mktemp("small"))


@pytest.fixture(scope="module")
def fit(small: Campaign) -> FitResult:
    """Their fit."""
    return fit_campaign(small, "kv2", heldout=False)


def test_the_gradient_is_that_of_the_density(fit: FitResult) -> None:
    """Beside the mode each derivative is what the density does over a small step."""
    density = JointDensity(fit)
    u = np.concatenate([
        np.sqrt(np.diag(fit.fitted.covariance)),
        *[np.sqrt(np.diag(np.linalg.inv(b.matrix[-4:, -4:]))) for b in fit.fitted.blocks],
    ])  # fmt: skip
    at = density.mode + 0.3 * u * np.random.default_rng(1).standard_normal(u.size)
    value, gradient = density.with_gradient(at)
    assert value == pytest.approx(density(at), abs=1e-6)
    for j in range(u.size):
        step = np.zeros_like(at)
        step[j] = 1e-2 * u[j]
        slope = (density(at + step) - density(at - step)) / (2 * step[j])
        assert gradient[j] * u[j] == pytest.approx(slope * u[j], rel=0.02, abs=0.05), density.names[
            j
        ]


def test_both_densities_are_zero_at_the_fit_and_fall_beside_it(fit: FitResult) -> None:
    """A move by one of the stated uncertainties costs one half, in a density of the globals."""
    density = GlobalDensity(fit)
    root = np.linalg.cholesky(fit.fitted.covariance)
    assert density(density.mode) == 0.0
    for column in range(root.shape[1]):
        assert density(density.mode + root[:, column]) == pytest.approx(-0.5, abs=0.1)
    assert JointDensity(fit)(JointDensity(fit).mode) == pytest.approx(0.0, abs=1e-6)


def test_laplace_draws_state_what_the_fit_states(fit: FitResult) -> None:
    """The quantiles of the drawn moduli are the fit's intervals, by material and pair."""
    arviz = pytest.importorskip("arviz")
    found = inference_data(fit, laplace_draws(fit, 4000, seed=1), seed=2)
    stated = fit.moduli()
    for material, one in stated.items():
        for name in ("plane_strain_modulus_Pa", "youngs_modulus_Pa"):
            drawn = found.posterior[name].sel(material=material).values
            low, high = one[name]["interval95"]
            # the quantile of 4000 draws is good to 4 % of the interval's width
            assert interval95(drawn) == pytest.approx((low, high), abs=0.05 * (high - low))
    for pair, one in fit.pairs().items():
        drawn = found.posterior["reduced_modulus_Pa"].sel(pair=pair).values
        assert drawn.mean() == pytest.approx(one["reduced_modulus_Pa"]["value"], rel=1e-3)
        assert drawn.std() == pytest.approx(one["reduced_modulus_Pa"]["u"], rel=0.1)
    summary = arviz.summary(found, var_names=["youngs_modulus_Pa"])
    assert len(summary) == len(stated)
    assert found.posterior["youngs_modulus_Pa"].attrs["units"] == "Pa"


def test_the_sampler_finds_the_laplace_intervals_of_a_linear_case(fit: FitResult) -> None:
    """Eight clean drops: emcee's spread is the stated one."""
    pytest.importorskip("emcee")
    draws = posterior_draws(fit, 40, seed=1)
    drawn = draws.theta.reshape(-1, draws.theta.shape[-1])
    u = np.sqrt(np.diag(fit.fitted.covariance))
    assert np.all(np.abs(drawn.mean(axis=0) - fit.fitted.theta) < 0.35 * u)
    assert np.all(np.abs(drawn.std(axis=0) / u - 1) < 0.25)
    assert draws.accepted > 0.3


def stiff_coupon(campaign: Campaign) -> Campaign:
    """Return a campaign that seeks a coupon far stiffer than the sphere that falls on it.

    The coupon is a thirtieth of the contact's compliance, so that 0.6 % of the sphere's modulus is
    a tenth of the coupon's, or more.
    """
    ball = dataclasses.replace(
        campaign.spheres["acetal"],
        youngs_modulus_pa=Quantity(3.15e9, 0.006 * 3.15e9),
        poissons_ratio=Quantity(0.35, 1e-4),
    )
    coupon = dataclasses.replace(campaign.surfaces["aluminium"], youngs_modulus_pa=None)
    return dataclasses.replace(
        campaign,
        spheres={**campaign.spheres, "acetal": ball},
        surfaces={**campaign.surfaces, "aluminium": coupon},
        shots=[s for s in campaign.shots if (s.sphere, s.surface) == ("acetal", "aluminium")][:6],
    )


def test_where_the_modulus_bends_the_sampler_says_more_than_laplace(small: Campaign) -> None:
    """A stiff coupon is Gaussian in its compliance, not in ln E': so are the draws."""
    pytest.importorskip("emcee")
    result = fit_campaign(stiff_coupon(small), "kv", heldout=False)
    draws = posterior_draws(result, 250, seed=1)
    at = draws.names.index("surface.aluminium")
    mode, u = result.fitted.theta[at], np.sqrt(result.fitted.covariance[at, at])
    low, high = interval95(np.exp(draws.theta[..., at] - mode))
    # over the mode: Gaussian in compliance, by hand, against Gaussian in the logarithm
    by_hand = (1 / (1 + 1.96 * u), 1 / (1 - 1.96 * u))
    laplace = (np.exp(-1.96 * u), np.exp(1.96 * u))
    print(f"sampled {low:.3f}..{high:.3f}, by hand {by_hand}, Laplace {laplace}")
    assert (low, high) == pytest.approx(by_hand, rel=0.05)
    assert low > laplace[0]
    assert high > laplace[1]


@pytest.mark.integration
@pytest.mark.timeout(1800)
def test_laplace_is_right_on_the_clean_campaign(
    shared_campaign: Callable[[str], tuple[Campaign, dict[str, Any]]],
) -> None:
    """54 drops, 11 globals: each sampled 95 % interval is Laplace's, to the sampler's error."""
    arviz = pytest.importorskip("arviz")
    pytest.importorskip("emcee")
    result = fit_campaign(shared_campaign("campaigns/clean")[0], "kv", heldout=False)
    draws = posterior_draws(result, 150, seed=1)
    found = inference_data(result, draws, seed=2)
    least = float(arviz.ess(found, var_names=["parameter"])["parameter"].min())
    for material, one in result.moduli().items():
        low, high = one["youngs_modulus_Pa"]["interval95"]
        drawn = interval95(found.posterior["youngs_modulus_Pa"].sel(material=material).values)
        off = [(a - b) / (high - low) for a, b in zip(drawn, (low, high), strict=True)]
        print(f"{material}: ends off by {off[0]:+.1%} and {off[1]:+.1%} of the interval")
        assert max(map(abs, off)) < 0.08
    print(f"least effective sample size {least:.0f}, accepted {draws.accepted:.2f}")
    assert least > 200


@pytest.mark.integration
@pytest.mark.timeout(3600)
def test_pymc_samples_the_density_as_the_guide_says(
    shared_folder: Callable[[str], Path], tmp_path: Path
) -> None:
    """NUTS over all 227 parameters of the clean campaign: means and spreads are Laplace's."""
    (tmp_path / "my-campaign").symlink_to(shared_folder("campaigns/clean"))
    (example,) = re.findall(r"```python\n(import numpy.*?)```", GUIDE.read_text(), flags=re.S)
    code = (
        example.replace('"kv2"', '"kv"')
        + """
from arviz import ess, rhat
count = len(fit.problem.names)
walked = draws.posterior["x"][:, :, :count]
u = np.sqrt(np.diag(fit.fitted.covariance))
stat = lambda f: np.asarray(f(walked)["x"]).tolist()
import json
print(json.dumps({
    "names": density.names[:count],
    "off": ((walked.mean(("chain", "draw")) - fit.fitted.theta) / u).values.tolist(),
    "spread": (walked.std(("chain", "draw")) / u).values.tolist(),
    "rhat": stat(rhat), "ess": stat(ess),
    "diverging": int(draws.sample_stats["diverging"].sum()),
}))
"""
    )
    python = _with_pymc(tmp_path / "environment")
    made = subprocess.run(
        [python, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},  # of another numba than ours
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    found = json.loads(made.stdout.splitlines()[-1])
    for name, *one in zip(*(found[k] for k in ("names", "off", "spread", "rhat")), strict=True):
        print(f"{name}: mean off by {one[0]:+.2f} u, spread {one[1]:.2f} u, R-hat {one[2]:.3f}")
    assert found["diverging"] == 0
    assert max(found["rhat"]) < 1.03
    assert min(found["ess"]) > 200
    assert max(map(abs, found["off"])) < 0.15
    assert found["spread"] == pytest.approx([1.0] * len(found["spread"]), abs=0.2)


def _with_pymc(folder: Path) -> Path:
    """Return the Python of a new environment with PyMC, whose PyTensor wants an older numba."""
    python = folder / "bin" / "python"
    wanted = ["--editable", str(GUIDE.parents[2]), "pymc>=5.20,<6"]
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", *wanted], check=True)
    return python


def test_the_density_without_priors_is_the_likelihood(fit: FitResult) -> None:
    """It differs by the Gaussian of what was known, and so does its gradient."""
    whole, likelihood = JointDensity(fit), JointDensity(fit, priors=False)
    at = whole.mode + whole.root() @ np.random.default_rng(1).standard_normal(whole.mode.size)
    away = whole.split(at)[0] - fit.problem.prior_mean
    pull = fit.problem.prior_precision @ away
    assert likelihood(at) == pytest.approx(whole(at) + 0.5 * away @ pull, abs=1e-6)
    value, gradient = likelihood.with_gradient(at)
    assert value == pytest.approx(likelihood(at), abs=1e-6)
    expected = whole.with_gradient(at)[1]
    expected[: pull.size] += pull
    assert gradient == pytest.approx(expected)


def test_without_a_solution_there_is_no_posterior(fit: FitResult) -> None:
    """A fit that could not be evaluated is refused in its own words."""
    outcome = dataclasses.replace(fit.outcome, status="not_evaluable", message="Check masses.")
    with pytest.raises(AnalysisError, match="Check masses"):
        laplace_draws(dataclasses.replace(fit, outcome=outcome), seed=1)


def test_the_command_writes_what_arviz_reads(
    fit: FitResult, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """`impactd posterior` leaves a file that ArviZ opens, and prints both intervals."""
    arviz = pytest.importorskip("arviz")
    pytest.importorskip("h5netcdf")
    folder = tmp_path_factory.mktemp("command")
    small_campaign(folder)
    words = ["posterior", str(folder), "--out", str(folder / "p.nc"), "--sampler", "laplace"]
    made = subprocess.run(
        [sys.executable, "-m", "impactd", *words], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    assert "specimen" in made.stdout
    found = arviz.from_netcdf(folder / "p.nc")
    assert set(found.posterior.material.values) == set(fit.moduli())
