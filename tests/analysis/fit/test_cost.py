"""What one shot's fit costs, in operations: a machine's speed does not move them."""

from __future__ import annotations

import cProfile
import dataclasses
import pstats
from typing import Any

from analysis import fit_campaign
from analysis.campaign import Quantity, Sensor

TRACES = 70
"""Simulated traces: some five steps of a Jacobian of nine and a trial each; 62 as measured."""
CALLS = 8000
"""Of functions, Python's and numpy's; 6300 as measured, and 41 000 when a search for 1/f noise took
most of a fit."""


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
    profile = cProfile.Profile()
    found = profile.runcall(fit_campaign, alone, "kv", by_pair=True, heldout=False)
    counted = pstats.Stats(profile)
    traces = sum(
        calls
        for (file, _, name), (_, calls, *_) in counted.stats.items()  # type: ignore[attr-defined]
        if name == "integrate" and file.endswith("solver.py")
    )
    assert found.outcome.status == "converged"
    assert 0 < traces <= TRACES
    assert counted.total_calls <= CALLS  # type: ignore[attr-defined]
