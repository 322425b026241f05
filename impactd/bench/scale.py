"""What a joint fit costs per shot when there are eight, sixty-four and five hundred of them."""

from __future__ import annotations

import dataclasses
import resource
import time

import numpy as np

from analysis import fit_campaign
from analysis.campaign import Campaign
from drivers.simulated.campaign import CampaignSettings
from impactd.bench.figure import Figure
from impactd.bench.simulated_campaign import simulated_campaign

SEED = 7
SIZES = (8, 64, 512)
ROUNDS = 3
GROWTH_GOAL = 1.10


def measure() -> list[Figure]:
    """Time joint fits of growing campaigns on one core.

    Returns
    -------
    list of Figure
        Cost per shot by size, growth from 64 to 512, and the memory that the largest one took.
    """
    largest = simulated_campaign(CampaignSettings(repeats=SIZES[-1] // 27 + 1), SEED)
    order = np.random.default_rng(SEED).permutation(len(largest.shots))
    fit_campaign(_some(largest, order[:2]))  # compiles
    before_kib = _peak_kib()
    costs = {size: _cost_per_shot(_some(largest, order[:size])) for size in SIZES}
    grown_kib = _peak_kib() - before_kib
    growth = costs[512] / costs[64]
    figures = [
        Figure(f"joint fit of {size} shots, processor time per shot", costs[size], "s")
        for size in SIZES
    ]
    figures.append(
        Figure(
            name="cost per shot, 512 shots over 64",
            value=growth,
            unit="1",
            reference=1.0,
            reference_name="linear",
            ratio=1.0 / growth,
            goal=f"<= {GROWTH_GOAL:g}",
            met=growth <= GROWTH_GOAL,
        )
    )
    figures.append(
        Figure(f"memory for {SIZES[-1]} shots, per shot", 1024 * grown_kib / SIZES[-1], "B")
    )
    return figures


def _some(campaign: Campaign, which: np.ndarray) -> Campaign:
    shots = tuple(campaign.shots[i] for i in sorted(which))
    return dataclasses.replace(campaign, shots=shots)


def _cost_per_shot(campaign: Campaign) -> float:
    """Return the least of a few rounds: what disturbs a measurement only ever adds to it."""
    best = np.inf
    for _ in range(ROUNDS):
        began = time.process_time()
        fit_campaign(campaign)
        best = min(best, time.process_time() - began)
    return float(best) / len(campaign.shots)


def _peak_kib() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
