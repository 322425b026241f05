"""One diagnosis in one call, as the document that reports and programs read."""

from __future__ import annotations

from typing import Any

from analysis.campaign import Campaign
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.diagnosis.progress import MethodStep, Progress, TimeBudget
from analysis.fit.cores import ONE_CORE, Cores
from analysis.moduli_html import moduli_html
from analysis.one_thread import on_one_thread


class Diagnosis(dict[str, Any]):
    """A diagnosis as JSON-ready values; a notebook shows its verdict and the moduli."""

    def _repr_html_(self) -> str:
        after = self["after"]
        said = f"{self['verdict'].replace('_', ' ').upper()}. {self['sentence']}"
        return moduli_html(after["model"], said, after["moduli"])


@on_one_thread
def diagnose(
    campaign: Campaign,
    base: str | None = None,
    *,
    software: str = "analysis",
    progress: Progress | None = None,
    budget: TimeBudget | None = None,
    cores: Cores = ONE_CORE,
) -> Diagnosis:
    """Diagnose a campaign.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    base : str, optional
        ``kv2``, ``kv`` or ``hsd``; by default ``kv2``, or ``kv`` where the records obey that.
    software : str, optional
        Who asks, with version; stands in the document.
    progress : callable, optional
        Told what is being done, the step of METHOD.md before it, and a share between 0 and 1.
    budget : TimeBudget, optional
        How long it may search: then the best verdict so far, and ``ended_early`` says so.
    cores : Cores, optional
        How work is spread over cores; by default over one.

    Returns
    -------
    Diagnosis
        ``impactd-diagnosis/1``.

    Raises
    ------
    AnalysisError
        If no shot can be used at all.
    """
    found = diagnose_campaign(campaign, base, progress=progress, budget=budget, cores=cores)
    found.watch(
        MethodStep.HELD_OUT.told("every candidate on shots left out, and the document"), 0.99
    )
    document = diagnosis_json(found, software=software)
    # what "_V" stands for where another instrument recorded something else
    document["campaign"]["quantities"] = sorted({shot.quantity for shot in campaign.shots})
    rejected = [
        {"name": one.name, "path": one.path, "reason": one.reason} for one in campaign.rejected
    ]
    seen = {(one["name"], one["path"]) for one in rejected}
    document["rejected"] = rejected + [
        one for one in document["rejected"] if (one["name"], one["path"]) not in seen
    ]
    return Diagnosis(document)
