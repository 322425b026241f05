"""Stored shots as a campaign on this machine: through the daemon, or from their files."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from analysis.campaign import Campaign
from impactd.console.client import connect
from impactd.console.progress_bar import progress
from impactd.jobs.orders import calibrated
from impactd.jobs.rebound import with_restitution
from impactd.storage.exchange import archive_campaign
from impactd.storage.shot_store import read_shot


def download_shots(numbers: Sequence[int], folder: Path, *, url: str | None) -> list[Path]:
    """Fetch shot files from the daemon.

    Returns
    -------
    list of Path
        In the order of the numbers.

    Raises
    ------
    Failure
        If one is not there.
    """
    files = []
    with connect(url) as client:
        for done, number in enumerate(numbers):
            progress(f"fetching shot {number}", share=done / len(numbers))
            file = folder / f"{number:06d}.h5"
            client.download(f"/v1/shots/{number}.h5", file)
            files.append(file)
    return files


def with_calibration(campaign: Campaign, *, url: str | None) -> Campaign:
    """Return a campaign with the calibration in force, as the daemon's own fits use it.

    Parameters
    ----------
    campaign : Campaign
        With the load cell as its certificate has it.

    Returns
    -------
    Campaign
        The same where the cell was never calibrated, and for recordings of other instruments.
    """
    if campaign.sensor.compliance_m_per_v is None and campaign.sensor.hsd_n_per_v is None:
        return campaign
    with connect(url) as client:
        found = client.get("/v1/calibrations", limit=50)["items"]
    result = next(
        (one["result"] for one in found if one["state"] == "done" and one["kind"] == "drops"), None
    )
    if result is None:
        return campaign
    return replace(campaign, sensor=calibrated(result, campaign.sensor))


def campaign_of_files(files: Sequence[Path]) -> Campaign:
    """Return shot files as one campaign, with what they remember of materials and load cell.

    As in the daemon's own fits the restitution is told by the bounce in each record, so that a
    drawn modulus is the one that a drop was answered with.

    Parameters
    ----------
    files : sequence of Path
        NeXus HDF5 as the archive keeps them.

    Returns
    -------
    Campaign
        Shots in the order of their numbers.

    Raises
    ------
    CorruptShotError
        If one is no shot file.
    ArchiveError
        If they do not make one campaign.
    """
    stored = []
    for file in files:
        # nobody says what such a file must hash to; the checksums inside are checked all the same
        sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
        stored.append(read_shot(file, sha256))
    stored.sort(key=lambda one: one.shot.number)
    campaign = archive_campaign(stored)
    bounced = [
        with_restitution(shot, one.metadata, None)
        for shot, one in zip(campaign.shots, stored, strict=True)
    ]
    return replace(campaign, shots=tuple(bounced))
