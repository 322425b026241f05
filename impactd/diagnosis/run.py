"""One diagnosis, from a campaign to ``impactd-diagnosis/1``, signed by this program."""

from __future__ import annotations

from collections.abc import Callable

from analysis import diagnosing
from analysis.campaign import Campaign
from analysis.diagnosis.progress import TimeBudget
from impactd.aliases import Json
from impactd.diagnosis.processes import Processes
from impactd.diagnosis.working_time import working_time
from impactd.storage.version import software


def diagnose(
    campaign: Campaign,
    base: str | None = None,
    *,
    budget_s: float | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Json:
    """Diagnose a campaign; see `analysis.diagnosing.diagnose`.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    base : str, optional
        ``kv2``, ``kv`` or ``hsd``; by default ``kv2``, or ``kv`` where the records obey that.
    budget_s : float, optional
        How long it may search, from now on; more than 0. Compiling does not count. [s]
    progress : callable, optional
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    dict
        ``impactd-diagnosis/1``.

    Raises
    ------
    AnalysisError
        If no shot can be used at all, or the budget is no positive number.
    """
    budget = None if budget_s is None else TimeBudget(budget_s, working_time)
    return diagnosing.diagnose(
        campaign,
        base,
        software=software(),
        progress=progress,
        budget=budget,
        cores=Processes(),
    )
