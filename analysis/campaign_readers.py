"""The registry of campaign readers: the analysis itself reads no files.

As `xarray` finds its backends: an installed package names a function in the entry-point group
``analysis.campaign_readers``. ``impactd`` registers the reader of ``impactd-campaign/1`` folders.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from analysis.campaign import Campaign
from analysis.errors import AnalysisError

GROUP = "analysis.campaign_readers"
DEFAULT = "campaign-folder"


def load_campaign(path: object, reader: str = DEFAULT) -> Campaign:
    """Return a campaign as an installed reader finds it; no daemon is needed.

    Parameters
    ----------
    path : path-like
        For ``campaign-folder``: the folder or its ``campaign.json``.
    reader : str, optional
        Name in the entry-point group ``analysis.campaign_readers``.

    Returns
    -------
    Campaign
        What was refused is under ``rejected``, each with its reason.

    Raises
    ------
    AnalysisError
        If no such reader is installed.
    Exception
        What the reader raises; that of ``impactd`` is a ``CampaignError``.
    """
    found = {one.name: one for one in entry_points(group=GROUP)}
    if reader not in found:
        known = ", ".join(sorted(found)) or "none"
        raise AnalysisError(
            f"No reader {reader!r} of campaigns is installed (there: {known}). Install impactd "
            "again (`pip install -e .`, or `make demo`): it registers one."
        )
    return _read(found[reader], path)


def _read(reader: EntryPoint, path: object) -> Campaign:
    campaign = reader.load()(path)
    if not isinstance(campaign, Campaign):
        raise AnalysisError(f"The reader {reader.name!r} returned no Campaign; report it.")
    return campaign
