"""One self-contained page that says what was seen, what it is, and what it changes.

Everything comes from the JSON of the diagnosis, so a page can be made again at any time without
the recordings.
"""

from __future__ import annotations

from pathlib import Path

from analysis.diagnosis.document.wording import FAMILIES
from analysis.plots.span import span_us
from analysis.written_numbers import counted
from impactd.aliases import Json
from impactd.diagnosis import closure_figures, figures
from impactd.diagnosis.interactive import charts
from impactd.diagnosis.repair import MEAN_WAVEFORM, is_repaired
from impactd.diagnosis.set_aside import set_aside, shot_words
from impactd.diagnosis.unit import Unit, unit_of
from impactd.effect_list import effect_list
from impactd.reports.charts import with_library
from impactd.reports.rejected import rejected_words
from impactd.reports.templating import render

ORDER_MATTERS = 0.01
"""p value of a drift from which the order of the shots is shown."""
OWNERS = {"rig": "one set for all shots", "shot": "numbers of its own in every shot"}


def write_report(file: Path, document: Json) -> None:
    """Write the page, with the library that draws its charts.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    """
    file.write_text(with_library(page(document)), encoding="utf-8")


def page(document: Json) -> str:
    """Return the page, without the library that draws its charts.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    """
    unit, odd = unit_of(document), set_aside(document)
    drawn = [one for one in odd if one.get("curves")]
    coefficients = (document["closure"] or {}).get("coefficients", {})
    moduli = document["after"].get("moduli", {})
    return render(
        "diagnosis.html",
        document=document,
        campaign=campaign(document),
        unit=unit,
        repaired=is_repaired(document),
        odd_shots=[f"S{shot_words(one)[1:]}. {one['because']}" for one in odd],
        undrawn_shots=len(drawn) - figures.MOST_SET_ASIDE,
        library={one["id"]: one for one in effect_list()},
        stated=[name for name, one in moduli.items() if one["status"] == "fitted"],
        largest_coefficients=sorted(coefficients.items(), key=lambda item: -abs(item[1])),
        conditions=_conditions(document, unit),
        pictures=_pictures(document, unit, drawn),
        charts=charts(document, unit),
        FAMILIES=FAMILIES,
        MEAN_WAVEFORM=MEAN_WAVEFORM,
        OWNERS=OWNERS,
    )


def campaign(document: Json) -> str:
    """Return what the campaign consists of."""
    seen = document["campaign"]
    heights = ", ".join(f"{h * 1e3:.1f}" for h in seen["drop_heights_m"])
    spheres, surfaces = _named(seen["spheres"], "sphere"), _named(seen["surfaces"], "surface")
    said = f"{counted(seen['shots'], 'shot')} of {spheres} on {surfaces}"
    said += f", from {heights} mm" if heights else ""
    count = len(set_aside(document))
    return f"{said}; {count} more set aside" if count else said


def _named(names: list[str | None], what: str) -> str:
    """Return names as a list; recordings made elsewhere may have none, which JSON calls None."""
    known = [name if name and name != "None" else f"an unnamed {what}" for name in names]
    return ", ".join(known or [f"an unnamed {what}"])


def _conditions(document: Json, unit: Unit) -> list[str]:
    """Return the assumptions, the rejected shots and the noise."""
    noise = document["noise_rms_V"] * unit.factor
    return [
        *document["assumptions"],
        *(rejected_words(one) for one in document["rejected"]),
        f"Noise before the trigger: {noise:.4g} {unit.label} rms.",
    ]


def _pictures(document: Json, unit: Unit, odd_shots: list[Json]) -> dict[str, str | None]:
    """Return every picture of the page as a data URI; None where there is nothing to draw."""
    before, after = document["residual"]["before"], document["residual"]["after"] or {}
    closure = document["closure"] or {}
    stacks, noise = before.get("stacks"), document["noise_rms_V"]
    repaired = after if after.get("stacks") else {}
    span = span_us(stacks) if stacks else (0.0, 0.0)

    def residual(side: str, found: Json) -> str | None:
        """Return a model's residual, stacked over repetitions."""
        if not found.get("stacks"):
            return None
        title = f"Residual of {document[side]['model']}, stacked over repetitions"
        return figures.stacked(found["stacks"], noise, title, unit, span)

    p_value = (before.get("order") or {}).get("p_value")
    drifts = p_value is not None and p_value < ORDER_MATTERS
    curves = closure.get("curves")
    moduli = [document[side]["moduli"] for side in ("before", "after")]
    return {
        "set_aside": figures.set_aside_shots(odd_shots, noise, unit),
        "residual_before": residual("before", before),
        "residual_after": residual("after", repaired),
        "in_time": figures.in_time(stacks, unit)
        if stacks and (drifts or closure.get("scope") == "order")
        else None,
        "spectra": figures.spectra(before["spectrum"], repaired.get("spectrum"), unit)
        if before.get("spectrum")
        else None,
        "course": closure_figures.course(closure.get("coefficients", {})),
        "closure": closure_figures.closure(curves, unit) if curves else None,
        "force": closure_figures.force(curves) if curves else None,
        "moduli": figures.moduli(*moduli) if document["effects"] else None,
    }
