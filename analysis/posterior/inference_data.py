"""Draws as ArviZ reads them: the fit's coordinates, and the moduli with their Poisson's ratios."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from analysis.aliases import Array
from analysis.errors import AnalysisError
from analysis.fit.estimates import pair_modulus
from analysis.fit.priors import modulus_prior
from analysis.fit.result import FitResult
from analysis.parameters import key_in_moduli
from analysis.posterior.draws import Draws

if TYPE_CHECKING:
    import arviz


def inference_data(result: FitResult, draws: Draws, *, seed: int) -> arviz.InferenceData:
    """Return draws as ArviZ's InferenceData.

    ``seed`` is that of the draws of Poisson's ratios, which no shot shows.

    Returns
    -------
    arviz.InferenceData
        ``posterior`` holds ``parameter`` (the globals, mostly logarithms),
        ``plane_strain_modulus_Pa`` and ``youngs_modulus_Pa`` by material and
        ``reduced_modulus_Pa`` by pair; ``sample_stats`` the log density ``lp``; ``constant_data``
        the priors. Units are in the attributes.

    Raises
    ------
    AnalysisError
        If ArviZ is not installed.
    """
    try:
        import arviz  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise AnalysisError("InferenceData needs ArviZ: pip install 'impactd[mcmc]'.") from error
    moduli = _moduli(result, draws, seed)
    pairs, reduced = _reduced(result, draws)
    posterior: dict[str, Array] = {"parameter": draws.theta}
    dims = {"parameter": ["name"], "prior_mean": ["name"], "prior_precision": ["name", "other"]}
    if moduli:
        posterior["plane_strain_modulus_Pa"] = np.stack([m[0] for m in moduli.values()], axis=-1)
        posterior["youngs_modulus_Pa"] = np.stack([m[1] for m in moduli.values()], axis=-1)
        dims |= {name: ["material"] for name in ("plane_strain_modulus_Pa", "youngs_modulus_Pa")}
    if pairs:
        posterior["reduced_modulus_Pa"] = reduced
        dims["reduced_modulus_Pa"] = ["pair"]
    problem = result.problem
    found: arviz.InferenceData = arviz.from_dict(
        posterior=posterior,
        sample_stats={"lp": draws.log_density},
        constant_data={
            "prior_mean": problem.prior_mean,
            "prior_precision": problem.prior_precision,
        },
        coords={"name": draws.names, "other": draws.names, "material": list(moduli), "pair": pairs},
        dims=dims,
        attrs={"model": result.model, "method": draws.method, "accepted": draws.accepted},
    )
    for name, values in found["posterior"].data_vars.items():
        values.attrs["units"] = "Pa" if str(name).endswith("_Pa") else "1"
    return found


def _moduli(result: FitResult, draws: Draws, seed: int) -> dict[str, tuple[Array, Array]]:
    r"""Return draws of E' and E by material.

    Shots see :math:`E' = E / (1 - \nu^2)` alone. Where E was stated, its prior ties E' to the
    ratio; given a draw of ln E', the ratio is then Gaussian with the mean
    :math:`\nu_0 + \beta (\ln E' - m)`, :math:`\beta = 2\nu u_\nu^2 / ((1 - \nu^2) u_{E'}^2)`.
    """
    rng = np.random.default_rng(seed)
    problem, found = result.problem, {}
    for name in problem.names:
        if not name.is_modulus:
            continue
        campaign = problem.campaign
        material = (campaign.spheres if name.kind == "sphere" else campaign.surfaces)[name.owner]
        log = draws.theta[..., problem.names.index(name)]
        ratio = material.poissons_ratio
        young = np.full_like(log, math.nan)
        if ratio is not None:
            prior = modulus_prior(material.youngs_modulus_pa, ratio)
            mean, u = np.full_like(log, ratio.value), ratio.u
            if prior is not None:
                beta = 2 * ratio.value * u**2 / ((1 - ratio.value**2) * prior.u**2)
                mean = mean + beta * (log - prior.mean)
                u = math.sqrt(max(u**2 - (beta * prior.u) ** 2, 0.0))
            nu = mean + u * rng.standard_normal(log.shape)
            young = np.exp(log) * (1 - nu**2)
        found[key_in_moduli(name, problem.names)] = (np.exp(log), young)
    return found


def _reduced(result: FitResult, draws: Draws) -> tuple[list[str], Array]:
    problem = result.problem
    first = {item.pair: item for item in reversed(problem.shots) if item.radius_m is not None}
    flat = draws.theta.reshape(-1, draws.theta.shape[-1])
    found = np.empty((flat.shape[0], len(first)))
    for row, theta in enumerate(flat):
        there = dataclasses.replace(result.fitted, theta=theta)
        for column, item in enumerate(first.values()):
            told = pair_modulus(problem, there, item)
            assert told is not None, "the pair has a radius"
            found[row, column] = told[0]
    shape = (*draws.theta.shape[:-1], len(first))
    return list(first), np.exp(found).reshape(shape)
