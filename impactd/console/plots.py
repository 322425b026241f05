"""What ``impactd plot`` draws: finds the thing, fits it where need be, writes the figure."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from analysis import (
    Campaign,
    FitResult,
    fit_campaign,
    literature_of,
    plot_calibrations,
    plot_confusion,
    plot_diagnosis,
    plot_moduli,
    plot_residuals,
    plot_shot,
    plot_traces,
)
from analysis.base_models import BASE_MODELS, DEFAULT_BASE
from analysis.plots import paper_figures
from analysis.plots.style import styled
from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.progress_bar import progress
from impactd.console.stored_shots import campaign_of_files, download_shots, with_calibration
from impactd.console.tables import print_json
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config
from impactd.storage.campaign_folder import read_campaign

_PAPER = {
    "figure-2": paper_figures.figure_2,
    "figure-3": paper_figures.figure_3,
    "figure-4": paper_figures.figure_4,
}
_CALIBRATIONS, _DIAGNOSIS = "calibrations", "diagnosis-"


def run(
    what: Sequence[str],
    out: Path,
    *,
    kind: str | None,
    models: Sequence[str],
    shot: str | None,
    url: str | None,
    as_json: bool,
) -> None:
    """Draw a thing into a file.

    Parameters
    ----------
    what : sequence of str
        As given on the command line.
    kind : str or None
        What of it; ``None`` takes what fits the thing.
    models : sequence of str
        To fit; none means the usual ones.
    as_json : bool
        Print what was done as JSON.

    Raises
    ------
    Failure
        If nobody can tell what the thing is.
    """
    figure = _figure(list(what), kind, list(models), shot, url)
    progress("", last=True)
    save(figure, out)
    if as_json:
        print_json({"file": str(out), "of": list(what), "kind": kind})
    else:
        print(out)


def save(figure: Figure, out: Path) -> None:
    """Write a figure in the format its name ends in.

    Parameters
    ----------
    out : Path
        Ends in ``.pdf``, ``.svg`` or ``.png``; the same figure gives the same bytes.
    """
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with styled():
        figure.savefig(out, metadata=undated.get(out.suffix.lower()))


def _figure(
    what: list[str], kind: str | None, models: list[str], shot: str | None, url: str | None
) -> Figure:
    first = what[0]
    if all(item.isdigit() for item in what):
        with tempfile.TemporaryDirectory() as folder:
            files = download_shots([int(item) for item in what], Path(folder), url=url)
            campaign = with_calibration(campaign_of_files(files), url=url)
        return _of_campaign(campaign, kind or ("trace" if len(what) == 1 else None), models, shot)
    if all(Path(item).suffix == ".h5" for item in what):
        campaign = campaign_of_files([Path(item) for item in what])
        return _of_campaign(campaign, kind or ("trace" if len(what) == 1 else None), models, shot)
    if len(what) > 1:
        raise Failure("give shot numbers, .h5 files, or one other name to draw.")
    if first in _PAPER:
        return _PAPER[first]()
    if first == _CALIBRATIONS:
        with connect(url) as client:
            return plot_calibrations(client.get("/v1/calibrations", limit=200)["series"])
    if first.startswith(_DIAGNOSIS) and first.removeprefix(_DIAGNOSIS).isdigit():
        number = first.removeprefix(_DIAGNOSIS)
        with connect(url) as client:
            made = client.get(f"/v1/diagnoses/{number}")
        if made["state"] != "done":
            raise Failure(f"diagnosis {number} is {made['state']}; only one that is done is drawn.")
        return _of_document(made["result"], kind)
    return _of_file(Path(first), kind, models, shot)


def _of_file(file: Path, kind: str | None, models: list[str], shot: str | None) -> Figure:
    if file.is_dir():
        return _of_campaign(read_campaign(file), kind, models, shot)
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError) as error:
        raise Failure(f"{file} is no JSON ({error}), and no shot's .h5 either.") from error
    if isinstance(document, list):
        return plot_calibrations(document)
    form = document.get("format") if isinstance(document, dict) else None
    if form == "impactd-campaign/1":
        return _of_campaign(read_campaign(file), kind, models, shot)
    if form == "impactd-blind-confusion/1":
        counts = document["counts"]
        return plot_confusion(
            document, "detectable" if any(map(any, counts["detectable"])) else "all"
        )
    if form in ("impactd-diagnosis/1", "impactd-fit/1"):
        return _of_document(document, kind)
    raise Failure(f"{file} has the format {form!r}, which cannot be drawn.")


def _of_document(document: dict[str, Any], kind: str | None) -> Figure:
    is_diagnosis = document["format"] == "impactd-diagnosis/1"
    if is_diagnosis and kind in (None, "diagnosis", "residuals"):
        return plot_diagnosis(document)
    if kind in (None, "moduli"):
        materials = load_materials(find_config("materials.toml"))
        known = literature_of(
            Campaign(shots=(), spheres=dict(materials.spheres), surfaces=dict(materials.surfaces))
        )
        block = document["after"] if is_diagnosis else document
        return plot_moduli(block, {n: q for n, q in known.items() if n in block["moduli"]})
    raise Failure(f"a {kind} needs the recordings; name the campaign.json instead.")


def _of_campaign(
    campaign: Campaign, kind: str | None, models: list[str], shot: str | None
) -> Figure:
    if shot is not None and kind is None:
        kind = "trace"
    if kind == "diagnosis":
        raise Failure("a diagnosis is made first: impactd diagnose CAMPAIGN.json --json OUT.")
    if kind == "trace":
        name = shot or campaign.shots[0].name
        alone = tuple(one for one in campaign.shots if one.name == name)
        if not alone:
            few = ", ".join(one.name for one in campaign.shots[:5])
            raise Failure(f"the campaign has no shot {name!r}; it begins with {few}.")
        one_shot = replace(campaign, shots=alone)
        # By pair, as the daemon answers a drop: what the record says, not the stated moduli.
        fits = (_fit(one_shot, model, by_pair=True) for model in models or list(BASE_MODELS))
        return plot_shot(*fits)
    fit = _fit(campaign, models[-1] if models else DEFAULT_BASE)
    if kind == "moduli":
        return plot_moduli(fit.to_json(), literature_of(campaign))
    return plot_traces(fit) if kind == "traces" else plot_residuals(fit)


def _fit(campaign: Campaign, model: str, *, by_pair: bool = False) -> FitResult:
    return fit_campaign(
        campaign,
        model,
        by_pair=by_pair,
        progress=lambda what, share: progress(f"{model}: {what}", share=share),
    )
