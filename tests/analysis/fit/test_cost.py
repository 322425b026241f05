"""What one shot's fit costs, in operations: a machine's speed does not move them."""

from __future__ import annotations

import cProfile
import dataclasses
import pstats
from collections.abc import Callable
from functools import partial
from typing import Any

from analysis import fit_campaign
from analysis.campaign import Quantity, Sensor
from analysis.fit.result import FitResult
from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.label_spread import TYPICAL
from drivers.simulated.specimens import SPHERES
from impactd.bench.simulated_campaign import simulated_campaign

TRACES = 70
"""Simulated traces: some five steps of a Jacobian of nine and a trial each; 62 as measured."""
CALLS = 8000
"""Of functions, Python's and numpy's; 6300 as measured, and 41 000 when a search for 1/f noise took
most of a fit."""
JOINT_TRACES_A_SHOT = 200
"""A dozen linearisations of some ten parameters each; 156 as measured, and 246 before a fit ended
where a step promises less than a two-hundredth of an uncertainty."""


def test_one_shots_fit_takes_few_operations(truth: Any) -> None:
    """A calibrated cell's single shot is fitted with few traces, steps and calls of functions."""
    rig = truth(seed=3)
    shot = rig.shot("acetal", "polycarbonate", 0.045, 0.8)
    campaign = rig.campaign(pairs=(("acetal", "polycarbonate"),), heights_m=(0.045,))
    known = rig.sensor()
    sensor = Sensor(
        *(
            Quantity(q.value, 1e-3 * q.value)
            for q in (
                known.compliance_m_per_v,
                known.crystal_mass_kg,
                known.crystal_stiffness_n_per_m,
                known.crystal_damping_n_s_per_m,
            )
        )
    )
    alone = dataclasses.replace(campaign, shots=(shot,), sensor=sensor)
    fit_campaign(alone, "kv", by_pair=True, heldout=False)  # compiles
    found, traces, calls = _counted(partial(fit_campaign, alone, "kv", by_pair=True, heldout=False))
    assert found.outcome.status == "converged"
    assert 0 < traces <= TRACES
    assert calls <= CALLS


def test_a_joint_fit_takes_few_traces_a_shot() -> None:
    """Fit, held-out check and inputs with their uncertainties together stay below so many."""
    settings = CampaignSettings(
        spheres={name: SPHERES[name] for name in ("acetal", "acetal_small")}, spread=TYPICAL
    )
    campaign = simulated_campaign(settings, 5)
    found, traces, _ = _counted(partial(fit_campaign, campaign))
    assert found.outcome.status == "converged"
    assert found.problem.inputs
    assert 0 < traces <= JOINT_TRACES_A_SHOT * len(campaign.shots)


def _counted(fit: Callable[[], FitResult]) -> tuple[FitResult, int, int]:
    """Return a fit, its simulated traces, and its calls of functions."""
    profile = cProfile.Profile()
    found = profile.runcall(fit)
    counted = pstats.Stats(profile)
    traces = sum(
        calls
        for (file, _, name), (_, calls, *_) in counted.stats.items()  # type: ignore[attr-defined]
        if name == "integrate" and file.endswith("solver.py")
    )
    return found, traces, counted.total_calls  # type: ignore[attr-defined]
