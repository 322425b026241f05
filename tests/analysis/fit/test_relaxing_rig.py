"""Fits of a rig whose materials relax and whose contacts end when their force does.

The recordings come from the simulated rig, whose equations and integrator are its own.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.campaign_fit import solve
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import ImpactModel, model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Scope
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign

STRENGTHS = {"aluminium": 0.0, "polycarbonate": 0.15, "specimen": 0.15}


def _campaign(folder: Path, tau_s: float, rig: str) -> Campaign:
    """Return twelve drops on a rig two of whose three coupons relax."""
    relaxing = [
        make_effect(
            "stress_relaxation",
            {"strength": strength, "relaxation_time_s": tau_s},
            Scope(surface=surface),
            "sls",
        )
        for surface, strength in STRENGTHS.items()
        if strength
    ]
    usual = CampaignSettings()
    settings = replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        rig=rig,
        noise=NoiseSettings(rms_v=2e-4, ar1=0.0, pink_corner_hz=0.0),
        effects=relaxing,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 3)))


def _of_each_surface(base: str, effect: str) -> ImpactModel:
    """Return a base model with an effect whose strengths are each surface's own."""
    found = effect_named(effect)
    scoped = tuple(
        p if p.name == "relaxation_time_s" else replace(p, scope="surface")
        for p in found.parameters
    )
    return replace(model_named(base), effects=(replace(found, parameters=scoped),))


def _fitted(campaign: Campaign, model: ImpactModel) -> tuple[JointProblem, joint.Fitted]:
    problem, nuisances = with_start(build(campaign, model))
    found, scale = solve(problem, nuisances)
    assert found.converged
    assert scale == 1.0
    return problem, found


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
@pytest.mark.parametrize("tau_s", [1.5e-5, 2e-5])
def test_strengths_come_back_within_their_intervals(
    tau_s: float, rig: str, base: str, tmp_path: Path
) -> None:
    """A relaxing contact that ends by force gives each surface's strength, and the one time."""
    model = _of_each_surface(base, "stress_relaxation")
    problem, found = _fitted(_campaign(tmp_path, tau_s, rig), model)
    wide = 1.96 * np.sqrt(np.diag(found.covariance))
    scale = effect_named("stress_relaxation").parameters[0].scale
    at = {name: j for j, name in enumerate(problem.names)}
    for surface, strength in STRENGTHS.items():
        j = at[f"stress_relaxation.strength[{surface}]"]
        assert abs(scale * found.theta[j] - strength) <= scale * wide[j]
        assert scale * wide[j] < 2e-3
    j = at["stress_relaxation.relaxation_time_s"]
    assert abs(found.theta[j] - math.log(tau_s)) <= wide[j]
