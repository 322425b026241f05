"""One diagnosis, from a campaign to ``impactd-diagnosis/1``, signed by this program."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis import diagnosing
from analysis.base_models import DEFAULT_BASE
from analysis.campaign import Campaign
from impactd.storage.version import software

Json = dict[str, Any]


def diagnose(
    campaign: Campaign,
    base: str = DEFAULT_BASE,
    *,
    progress: Callable[[str, float], None] | None = None,
) -> Json:
    """Close the loop on a campaign; see `analysis.diagnosing.diagnose`.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    base : str
        ``kv`` or ``hsd``.
    progress : callable, optional
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    dict
        ``impactd-diagnosis/1``.

    Raises
    ------
    AnalysisError
        If no shot can be used at all.
    """
    return diagnosing.diagnose(campaign, base, software=software(), progress=progress)
