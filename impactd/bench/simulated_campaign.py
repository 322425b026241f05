"""Simulated campaigns as the analysis takes them, for benchmarks."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.campaign import Campaign
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign

CLOSED_BASE = "kv2"
BASES = {"paper": "kv", "closed": CLOSED_BASE, "drawn": CLOSED_BASE}
"""Base model of the analysis that has the physics of a simulated rig, by the rig's name."""


def simulated_campaign(settings: CampaignSettings, seed: int) -> Campaign:
    """Return a campaign as a person would have it: labels and recordings, no truth.

    Parameters
    ----------
    seed : int
        Of everything drawn.

    Returns
    -------
    Campaign
        Through the exchange format, so that nothing but what a folder holds gets across.
    """
    return through_a_folder(simulate_campaign(settings, seed))


def through_a_folder(simulated: Mapping[str, Any]) -> Campaign:
    """Return a campaign that was simulated as it is read back from its folder.

    Parameters
    ----------
    simulated : Mapping
        What ``simulate_campaign`` returned.

    Returns
    -------
    Campaign
        Without the truth.
    """
    with tempfile.TemporaryDirectory() as folder:
        return read_campaign(write_campaign_folder(Path(folder), simulated))
